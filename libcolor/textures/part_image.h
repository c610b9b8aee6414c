// Parts of the colours as images (section 4.1 of the paper; FORMAT.md, section 4.6).
#pragma once

#include <span>

#include "formats/image/coded_image.h"
#include "libcolor/surface/surface.h"
#include "libcolor/textures/image_curve.h"

namespace voxkit::color {

/// The least image that holds the first 1 to 2^20 colours of a curve.
ImageSize part_image_size(ImageCurve curve, uint32_t colors);
/// 1 to 2^20 colours as that image. Pixels without a colour have the last one.
RgbImage part_image(std::span<const Rgb> colors, ImageCurve curve);
/// The colours of such an image, so many of them.
std::vector<Rgb> part_colors_of(const RgbImage& image, ImageCurve curve, uint32_t colors);

}  // namespace voxkit::color
