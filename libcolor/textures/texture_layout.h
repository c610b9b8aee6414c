// Where blocks of textures lie in a part (FORMAT.md, section 4.6).
#pragma once

#include <vector>

#include "libcolor/textures/image_curve.h"

namespace voxkit::color {

/// The blocks of a part of 1 to 2^20 colours. Blocks of 4 x 4 follow the curve; others come row by row, each
/// row as far as it has colours.
class TextureLayout {
 public:
  TextureLayout() = default;
  TextureLayout(ImageCurve curve, BlockSize size, uint32_t colors);

  uint32_t blocks() const { return blocks_; }
  BlockSize size() const { return size_; }
  /// The block that has colour `index`, which is at `pixel`.
  uint32_t block_of(uint32_t index, Pixel pixel) const {
    return first_.empty() ? index / 16 : first_[pixel.y / size_.height] + pixel.x / size_.width;
  }
  /// Which pixel of its block it is, row by row.
  uint32_t within(Pixel pixel) const { return pixel.y % size_.height * size_.width + pixel.x % size_.width; }
  /// The first pixel of a block.
  Pixel corner(uint32_t block) const;

 private:
  ImageCurve curve_ = ImageCurve::morton;
  BlockSize size_;
  uint32_t blocks_ = 0;
  std::vector<uint32_t> first_;  ///< blocks before each row; none: blocks follow the curve
};

}  // namespace voxkit::color
