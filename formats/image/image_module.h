// What a module offers that reads and writes single images: image_stack.so.
#pragma once

#include <optional>
#include <span>

#include "formats/image/image.h"
#include "formats/module.h"

namespace voxkit {

/// `read_image` and `write_image` of image.h.
struct ImageModule {
  Result<std::optional<Image>> (*read)(const std::string& path, Context& ctx) = nullptr;
  Status (*write)(const std::string& path, const Image& image, bool force,
                  std::span<const ImageLayer> layers) = nullptr;
};

}  // namespace voxkit
