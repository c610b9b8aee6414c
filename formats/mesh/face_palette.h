// The colours of voxel faces as a picture of one texel each.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "formats/context.h"

namespace voxkit {

/// A set of colours, in the order of their numbers, whatever order they come in. Sides of the picture are
/// powers of two, up to 4096: so the middles of its texels are numbers that floats and short decimals hold
/// exactly. Memory: 3 MiB.
class FacePalette {
 public:
  FacePalette();
  void add(const std::array<uint8_t, 3>& color);
  /// After the last colour, before what is below. At least one was added.
  void arrange();

  uint32_t count() const { return count_; }
  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }
  /// The number of a colour that was added.
  uint32_t index_of(const std::array<uint8_t, 3>& color) const;
  /// The middle of the texel of a number, from the top left, in 0..1.
  std::array<double, 2> texel(uint32_t index) const {
    return {(index % width_ + 0.5) / width_, (index / width_ + 0.5) / height_};
  }
  /// The picture as the bytes of a PNG file; texels behind the last colour are black. Errors:
  /// ErrorCode::limit, ErrorCode::usage where there is no library for it.
  Result<std::vector<std::byte>> png(Context& ctx) const;

 private:
  static uint32_t number_of(const std::array<uint8_t, 3>& color) {
    return uint32_t{color[0]} << 16 | uint32_t{color[1]} << 8 | color[2];
  }
  std::vector<uint64_t> bits_;    ///< by number, whether it is there
  std::vector<uint32_t> before_;  ///< how many there are before each word of these
  uint32_t count_ = 0, width_ = 1, height_ = 1;
};

}  // namespace voxkit
