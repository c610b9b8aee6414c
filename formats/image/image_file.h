// Single images by OpenImageIO, as part of the image module: what read_image and write_image of image.h call.
#pragma once

#include <optional>
#include <string>

#include "formats/image/image.h"

namespace voxkit {

Result<std::optional<Image>> read_image_file(const std::string& path, Context& ctx);
Status write_image_file(const std::string& path, const Image& image, bool force,
                        std::span<const ImageLayer> layers);

}  // namespace voxkit
