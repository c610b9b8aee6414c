// What of a pixel a coarse cell hides: nine rays side by side in place of the one through its centre, which
// is the only one that is followed.
#pragma once

#include <cmath>
#include <cstdint>

#include "formats/hd.h"

namespace voxkit::render {

/// The bits of a mask of 4^3 parts whose Morton codes' bits i < j are exchanged.
template <int i, int j>
VOX_HD_HOT uint64_t exchange_index_bits(uint64_t parts) {
  constexpr uint64_t with_bit[6] = {0xaaaaaaaaaaaaaaaau, 0xccccccccccccccccu, 0xf0f0f0f0f0f0f0f0u,
                                    0xff00ff00ff00ff00u, 0xffff0000ffff0000u, 0xffffffff00000000u};
  constexpr int by = (1 << j) - (1 << i);
  const uint64_t apart = (parts >> by ^ parts) & with_bit[i] & ~with_bit[j];
  return parts ^ apart ^ apart << by;
}
/// The parts of a cell in Morton order as four layers across an axis, 16 bits each. In a layer bit u + 4 v is
/// the part at u and v along the two other axes, the lower one first.
VOX_HD_HOT uint64_t layers_across(int axis, uint64_t parts) {
  parts = exchange_index_bits<1, 3>(parts);  // x0 y0 z0 x1 y1 z1
  parts = exchange_index_bits<2, 3>(parts);
  parts = exchange_index_bits<3, 4>(parts);  // x0 x1 y0 y1 z0 z1
  if (axis == 2) return parts;
  parts = exchange_index_bits<2, 4>(parts);
  parts = exchange_index_bits<3, 5>(parts);  // x0 x1 z0 z1 y0 y1
  if (axis == 1) return parts;
  parts = exchange_index_bits<0, 4>(parts);
  return exchange_index_bits<1, 5>(parts);  // y0 y1 z0 z1 x0 x1
}

/// A ray, and eight beside it, each a part of a coarse cell apart, where it leaves the planes of the axis
/// that it is nearest to. A bit each: i + 4 j for that which is i - 1 and j - 1 parts off along the other
/// axes.
class Beam {
 public:
  static constexpr uint32_t nine = 0x777, centre = 0x020;
  /// So many open rays do not keep a beam going: what hides the others hides them. Each cell that hides
  /// something hides a ray or more, so there are at most `most_cells` of them.
  static constexpr int few = 5, most_cells = 9 - few;

  /// direction: not zero; both in voxels.
  VOX_HD_HOT Beam(const double (&origin)[3], const double (&direction)[3]) {
    for (int a = 1; a < 3; ++a)
      if (std::fabs(direction[a]) > std::fabs(direction[axis_])) axis_ = a;
    across_[0] = axis_ == 0 ? 1 : 0;
    across_[1] = axis_ == 2 ? 1 : 2;
    towards_ = direction[axis_];
    for (int a = 0; a < 3; ++a) origin_[a] = origin[a];
    for (int i = 0; i < 2; ++i) slope_[i] = direction[across_[i]] / towards_;
  }

  /// How many rays a cell hides that were open, 2^log2_edge voxels wide and 4 at least, which the middle ray
  /// goes through at `voxel`. parts: those of it that hold voxels, in Morton order. t: if any is hidden, when
  /// the middle ray comes to the layer where that begins.
  VOX_HD_HOT int hide(uint64_t parts, const uint32_t (&voxel)[3], int log2_edge, double& t) {
    const uint64_t layers = layers_across(axis_, parts);
    const double edge = static_cast<double>(uint64_t{1} << (log2_edge - 2)), parts_a_voxel = 1 / edge;
    double corner[3];
    for (int a = 0; a < 3; ++a) corner[a] = static_cast<double>(voxel[a] >> log2_edge << log2_edge);
    // Where the rays are when they cross the planes between layers: the lower corner of the nine, in parts.
    int at[5][2];
    for (int i = 0; i < 2; ++i) {
      const double first =
          (origin_[across_[i]] - corner[across_[i]] + (corner[axis_] - origin_[axis_]) * slope_[i]) *
          parts_a_voxel;
      for (int k = 0; k < 5; ++k) {
        const double x = std::floor(first + k * slope_[i]) - 1;
        at[k][i] = x < -4 ? -4 : x > 4 ? 4 : static_cast<int>(x);
      }
    }
    uint32_t hidden = 0, inside = 0;
    int first_plane = -1;
    for (int n = 0; n < 4; ++n) {
      const int k = towards_ > 0 ? n : 3 - n, enter = towards_ > 0 ? k : k + 1;
      const auto layer = static_cast<uint32_t>(layers >> 16 * k & 0xffff);
      hidden |= seen(layer, at[k]) | seen(layer, at[k + 1]);
      inside |= seen(0xffff, at[enter]);
      if (first_plane < 0 && (hidden & open_) != 0) first_plane = enter;
    }
    if (first_plane < 0) return 0;
    const double comes = (corner[axis_] + first_plane * edge - origin_[axis_]) / towards_;
    t = comes > t ? comes : t;
    const int before = open();
    const uint32_t left = open_ & ~hidden;
    // Rays that do not come through this cell fare as the middle one.
    open_ = (left & centre) == 0 && (open_ & centre) != 0 ? left & inside : left;
    if (open() <= few) open_ = 0;
    return before - open();
  }
  /// Hides those that are open. Returns how many.
  VOX_HD_HOT int hide_all() {
    const int before = open();
    open_ = 0;
    return before;
  }
  /// How many are open.
  VOX_HD_HOT int open() const {
    const uint32_t columns = (open_ & 0x111) + (open_ >> 1 & 0x111) + (open_ >> 2 & 0x111);
    return static_cast<int>((columns + (columns >> 4) + (columns >> 8)) & 0xf);
  }

 private:
  /// What the nine meet of a layer, their lower corner being at (u, v) = at.
  VOX_HD_HOT static uint32_t seen(uint32_t layer, const int (&at)[2]) {
    if (at[0] < -2 || at[0] > 3 || at[1] < -2 || at[1] > 3) return 0;
    layer = at[0] >= 0 ? layer >> at[0] & (0xfu >> at[0]) * 0x1111
                       : layer << -at[0] & (0xfu << -at[0] & 0xf) * 0x1111;
    return (at[1] >= 0 ? layer >> 4 * at[1] : layer << -4 * at[1]) & nine;
  }

  int axis_ = 0, across_[2];
  double origin_[3], towards_, slope_[2];
  uint32_t open_ = nine;
};

}  // namespace voxkit::render
