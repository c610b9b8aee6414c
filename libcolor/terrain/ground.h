// The ground of the terrain: hills, rock, meadow and a road.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "libcolor/terrain/house.h"

namespace voxkit::color::terrain {

/// The ground at a place.
struct GroundPoint {
  int32_t height;
  int32_t road;    ///< from the middle of the road
  int32_t rock;    ///< 0..255
  int32_t tint;    ///< 0..255: dry to lush
  int32_t detail;  ///< of what is smaller than a metre: about -1024..1023
};

inline constexpr size_t most_across = 34;

/// Everything of half a metre and more is in a table of squares of 12.5 cm, with cubic splines between them;
/// what is smaller is computed where it is asked for, down to twice the size of a voxel.
class Ground {
 public:
  /// Sets the `base` of each house, and makes the ground flat around it.
  static Result<Ground> make(std::span<House> houses, Context& ctx);
  static uint64_t bytes();

  /// The ground at all (x, z), row by row: up to `most_across` of each, ascending, at most an edge apart,
  /// from 0 to side - 1.
  void patch(std::span<const int32_t> xs, std::span<const int32_t> zs, int32_t edge, GroundPoint* out) const;
  /// Without what is smaller than half a metre.
  int32_t height(int32_t x, int32_t z) const;
  int32_t road(int32_t x, int32_t z) const { return int32_t{cell(x >> cell_bits, z >> cell_bits).road} << 8; }
  int32_t rock(int32_t x, int32_t z) const { return cell(x >> cell_bits, z >> cell_bits).rock; }
  /// No height is further from that of `height`.
  static constexpr int32_t most_detail = metre / 8;

  struct Range {
    int32_t lo, hi;
  };
  /// Bounds of the heights of a square of `range_bits`.
  Range range(int32_t i, int32_t k) const;
  static constexpr int range_bits = 16;

  static Rgb albedo(const GroundPoint& p, int32_t x, int32_t z, int32_t slope, int32_t edge);
  /// Of earth that was cut through, `depth` below the surface.
  static Rgb strata(int32_t x, int32_t y, int32_t z, int32_t depth);

 private:
  static constexpr int cell_bits = 14, border = 3;
  static constexpr int32_t cells = side >> cell_bits, stride = cells + 2 * border;
  struct Cell {
    int32_t height = 0;
    uint16_t road = 0;  ///< in steps of 2^8 units
    uint8_t rock = 0, tint = 0;
  };
  const Cell& cell(int32_t i, int32_t k) const {
    return cells_[static_cast<size_t>(k + border) * stride + static_cast<size_t>(i + border)];
  }
  std::vector<Cell> cells_;
};

}  // namespace voxkit::color::terrain
