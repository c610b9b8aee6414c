// The order in which a walk through an octree comes to the octants of a cell: along a Morton or a Hilbert
// curve (section 3 of the paper; FORMAT.md, section 4.4). The Hilbert curve is that of C. Hamilton, "Compact
// Hilbert Indices", 2006: a cell is entered at one corner, `entry`, and left along an axis from there,
// `axis`.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "libcolor/params.h"

namespace voxkit::color {

/// A way to go through a cell: one of the twelve of the Hilbert curve, or that of the Morton curve.
using OrderState = uint32_t;
inline constexpr OrderState morton_state = 12, order_states = 13;

constexpr OrderState first_state(Curve curve) {
  return curve == Curve::morton ? morton_state : 0;
}

/// For each state.
struct OctantOrders {
  std::array<std::array<uint8_t, 8>, order_states> octant{};  ///< which one comes first, second ...
  std::array<std::array<uint8_t, 8>, order_states> next{};    ///< by octant: the state in it
  std::array<std::array<uint8_t, 8>, order_states> before{};  ///< by octant: those before it, as a mask
  /// By bit of a leaf word: the bits of the voxels before it.
  std::array<std::array<uint64_t, 64>, order_states> voxels_before{};
};

constexpr OctantOrders make_octant_orders() {
  OctantOrders orders;
  const auto rotate = [](uint32_t octant, uint32_t by) { return (octant << by | octant >> (3 - by)) & 7; };
  const auto gray = [](uint32_t i) { return i ^ i >> 1; };
  for (OrderState state = 0; state < order_states; ++state)
    for (uint32_t i = 0; i < 8; ++i) {
      if (state == morton_state) {
        orders.octant[state][i] = static_cast<uint8_t>(i);
        orders.next[state][i] = morton_state;
        continue;
      }
      // Entries have an even number of bits, 0, 3, 5 and 6, so half of one is enough to number a state.
      const uint32_t axis = state % 3, half = state / 3, entry = 2 * half + (half == 1 || half == 2 ? 1 : 0);
      const uint32_t turn = (axis + 1) % 3, octant = rotate(gray(i), turn) ^ entry;
      const uint32_t entry_within = i == 0 ? 0 : gray((i - 1) / 2 * 2);
      const uint32_t axis_within =
          i == 0 ? 0 : static_cast<uint32_t>(std::countr_one(i % 2 == 0 ? i - 1 : i)) % 3;
      const uint32_t next_entry = entry ^ rotate(entry_within, turn);
      orders.octant[state][i] = static_cast<uint8_t>(octant);
      orders.next[state][octant] = static_cast<uint8_t>(3 * (next_entry / 2) + (axis + axis_within + 1) % 3);
    }
  for (OrderState state = 0; state < order_states; ++state) {
    uint32_t octants = 0;
    uint64_t voxels = 0;
    for (const uint8_t octant : orders.octant[state]) {
      orders.before[state][octant] = static_cast<uint8_t>(octants);
      octants |= 1u << octant;
      for (const uint8_t voxel : orders.octant[orders.next[state][octant]]) {
        const uint32_t bit = 8u * octant + voxel;
        orders.voxels_before[state][bit] = voxels;
        voxels |= uint64_t{1} << bit;
      }
    }
  }
  return orders;
}
inline constexpr OctantOrders octant_orders = make_octant_orders();

}  // namespace voxkit::color
