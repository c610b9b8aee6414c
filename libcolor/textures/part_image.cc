#include "libcolor/textures/part_image.h"

#include <algorithm>
#include <cstring>

namespace voxkit::color {

ImageSize part_image_size(ImageCurve curve, uint32_t colors) {
  ImageSize size;
  // The colours are squares of ever fewer pixels, up to three of each size.
  uint32_t done = 0;
  for (int level = image_log2; level >= 0; --level)
    for (; colors - done >= 1u << 2 * level; done += 1u << 2 * level) {
      const uint32_t side = 1u << level;
      const Pixel any = curve_pixel(curve, done);
      size.width = std::max(size.width, any.x / side * side + side);
      size.height = std::max(size.height, any.y / side * side + side);
    }
  return size;
}

RgbImage part_image(std::span<const Rgb> colors, ImageCurve curve) {
  const auto count = static_cast<uint32_t>(colors.size());
  RgbImage image = make_rgb_image(part_image_size(curve, count));
  static_assert(sizeof(Rgb) == 3);
  for (size_t at = 0; at < image.rgb.size(); at += 3) std::memcpy(&image.rgb[at], &colors.back(), 3);
  for (uint32_t i = 0; i < count; ++i) {
    const Pixel at = curve_pixel(curve, i);
    std::memcpy(&image.rgb[size_t{3} * (size_t{at.y} * image.size.width + at.x)], &colors[i], 3);
  }
  return image;
}

std::vector<Rgb> part_colors_of(const RgbImage& image, ImageCurve curve, uint32_t colors) {
  std::vector<Rgb> out(colors);
  for (uint32_t i = 0; i < colors; ++i) {
    const Pixel at = curve_pixel(curve, i);
    std::memcpy(&out[i], &image.rgb[size_t{3} * (size_t{at.y} * image.size.width + at.x)], 3);
  }
  return out;
}

}  // namespace voxkit::color
