#include "libcolor/textures/texture_layout.h"

#include <algorithm>
#include <array>

namespace voxkit::color {
namespace {

/// Of each row of pixels: the least number that is above x of all its pixels with a colour.
std::array<uint32_t, image_side> row_widths(ImageCurve curve, uint32_t colors) {
  std::array<uint32_t, image_side> widths{};
  // The colours are squares of ever fewer pixels, up to three of each size.
  uint32_t done = 0;
  for (int level = image_log2; level >= 0; --level)
    for (; colors - done >= 1u << 2 * level; done += 1u << 2 * level) {
      const uint32_t side = 1u << level;
      const Pixel any = curve_pixel(curve, done);
      const uint32_t right = any.x / side * side + side, top = any.y / side * side;
      for (uint32_t y = top; y < top + side; ++y) widths[y] = std::max(widths[y], right);
    }
  return widths;
}

}  // namespace

TextureLayout::TextureLayout(ImageCurve curve, BlockSize size, uint32_t colors) : curve_(curve), size_(size) {
  if (size == BlockSize{}) {
    blocks_ = (colors + 15) / 16;
    return;
  }
  const auto widths = row_widths(curve, colors);
  for (uint32_t y = 0; y < image_side; y += size.height) {
    uint32_t width = 0;
    for (uint32_t i = y; i < std::min(y + size.height, image_side); ++i) width = std::max(width, widths[i]);
    first_.push_back(blocks_);
    blocks_ += (width + size.width - 1) / size.width;
  }
}

Pixel TextureLayout::corner(uint32_t block) const {
  if (first_.empty()) {
    const Pixel any = curve_pixel(curve_, 16 * block);
    return {any.x / 4 * 4, any.y / 4 * 4};
  }
  // Rows without blocks begin where the next one does.
  const auto row =
      static_cast<uint32_t>(std::upper_bound(first_.begin(), first_.end(), block) - first_.begin()) - 1;
  return {(block - first_[row]) * size_.width, row * size_.height};
}

}  // namespace voxkit::color
