// Short keys of bricks, whose distances are at most those of the bricks: what can be ruled out by keys need
// not be looked at.
//
// A brick is rotated to its principal components, the axes along which bricks differ most. A key has the
// first few of them and the norm of the rest, rounded to integers. No rotation and no norm makes a distance
// greater, so |key(a) - key(b)| <= scale |a - b| + what rounding may add, which `reach` allows for. What the
// axes are decides about speed only.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <span>

#include "libvq/brick.h"

namespace voxkit::vq {

/// Coordinates are held in pairs, as the machines multiply them.
inline constexpr int fine_pairs = 16, coarse_pairs = 8;
inline constexpr int fine_axes = 2 * fine_pairs, coarse_axes = 2 * coarse_pairs;

struct Key {
  std::array<int16_t, fine_axes> fine;      ///< 31 components and the norm of the rest, within +-key_limit
  std::array<int16_t, coarse_axes> coarse;  ///< the first 15 components and the norm of the rest
  uint32_t norm;                            ///< the squares of `fine` summed up, modulo 2^32
};
/// So that doubles of coordinates and differences of two fit 16 bits.
inline constexpr int key_limit = 16383;

/// Coordinates 2 i and 2 i + 1 as one number.
template <size_t N>
int32_t key_pair(const std::array<int16_t, N>& axes, int i) {
  int32_t pair;
  std::memcpy(&pair, axes.data() + 2 * i, sizeof pair);
  return pair;
}

class KeySpace {
 public:
  /// Axes that suit `bricks`; they are found from a sample.
  explicit KeySpace(std::span<const Brick> bricks);

  Key key(const Brick& brick) const;
  /// Bricks no further apart than the root of `squared_distance` have keys whose squared distance is less
  /// than this. 0 for 0: nothing is searched for beside what is there already. At most 2^30 + 2^20.
  int32_t reach(uint64_t squared_distance) const;
  /// Whether voxels have at most 12 bits, so that squared distances fit 31 bits.
  bool narrow() const { return narrow_; }

 private:
  double scale_;  // the greatest voxel becomes one of 12 bits
  bool narrow_;
  std::array<double, brick_voxels> mean_;
  // Row v: the weight of voxel v in each component, scale included; the last column is nought.
  std::array<std::array<double, fine_axes>, brick_voxels> weights_;
  // Taken from components and norms, so that they are spread evenly about nought.
  std::array<double, fine_axes> middle_{};
  double coarse_middle_ = 0;
};

}  // namespace voxkit::vq
