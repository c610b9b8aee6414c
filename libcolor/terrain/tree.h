// Trees of the terrain: where they stand, their trunks and leaves.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "libcolor/terrain/house.h"

namespace voxkit::color::terrain {

/// A leaf: a lens on a slope, seen from above.
struct Leaf {
  int32_t x, y, z;           ///< its middle, from the foot of the tree
  int16_t slope_x, slope_z;  ///< in 1/256
  int16_t length;            ///< half of it, in 2^4 units; 0: there is none
  uint8_t direction;         ///< 0..15
  uint8_t shade;             ///< how deep in the crown, and how light it is
  Normal normal;             ///< of the crown
};

/// A tree that is planted in many places. Its leaves are in a grid of cubes, at most one in each.
struct TreeModel {
  int32_t trunk_radius = 0, trunk_height = 0;
  int32_t reach = 0, lo = 0, hi = 0;  ///< of its leaves, from its axis and foot
  std::array<int32_t, 3> cubes{};
  std::vector<Leaf> leaves;  ///< by cube, x fastest, then y
  std::array<uint8_t, 3> albedo{};
  static constexpr int32_t cube = 3 << 13;  ///< 18.75 cm
  static constexpr int32_t longest = cm(14);
};

struct Tree {
  int32_t x, y, z;  ///< its foot
  int32_t model;
  int32_t mirror_x, mirror_z;  ///< 1 or -1
  int32_t tint;
};

/// Where a leaf is above a place, from the leaf's middle; nothing where it is not.
struct LeafShape {
  /// At least as wide as a voxel of that edge, up to half a metre.
  LeafShape(const Leaf& leaf, const Tree& tree, int32_t voxel);
  int32_t x, y, z, length;
  /// No part is further above or below the middle.
  int32_t rise() const { return ((std::abs(slope_x_) + std::abs(slope_z_)) * length >> 8) + 1; }
  /// Height above a place, or INT32_MIN. `rib` tells how near it is to the middle, 0..256.
  int32_t height(int32_t px, int32_t pz, int32_t& rib) const;

 private:
  int32_t slope_x_, slope_z_, cos_, sin_, width_;
};

struct Forest {
  std::vector<TreeModel> models;
  std::vector<Tree> trees;

  Forest(const Ground& ground, std::span<const House> houses);
  const TreeModel& model(const Tree& tree) const { return models[static_cast<size_t>(tree.model)]; }

  /// The top of the trunk above a place, or INT32_MIN.
  int32_t trunk_top(const Tree& tree, int32_t px, int32_t pz) const;
  Rgb trunk_color(const Tree& tree, int32_t px, int32_t py, int32_t pz, const Light& light) const;
  Rgb leaf_color(const Tree& tree, const Leaf& leaf, int32_t rib, int32_t px, int32_t py, int32_t pz,
                 const Light& light) const;
  /// Calls body(leaf) for the leaves that may reach into a box, in an order that does not depend on it.
  template <class Body>
  void leaves_in(const Tree& tree, const std::array<int32_t, 3>& lo, const std::array<int32_t, 3>& hi,
                 const Body& body) const {
    const TreeModel& m = model(tree);
    std::array<int32_t, 3> first, last;
    constexpr int32_t margin = 2 * TreeModel::longest;
    const std::array<int32_t, 3> from = {-m.reach, m.lo, -m.reach};
    const auto range = [&](size_t axis, int32_t begin, int32_t end) {
      first[axis] = std::max((begin - margin - from[axis]) / TreeModel::cube - 1, 0);
      last[axis] = std::min((end + margin - from[axis]) / TreeModel::cube + 1, m.cubes[axis] - 1);
    };
    const int32_t x0 = lo[0] - tree.x, x1 = hi[0] - tree.x, z0 = lo[2] - tree.z, z1 = hi[2] - tree.z;
    range(0, tree.mirror_x > 0 ? x0 : -x1, tree.mirror_x > 0 ? x1 : -x0);
    range(1, lo[1] - tree.y, hi[1] - tree.y);
    range(2, tree.mirror_z > 0 ? z0 : -z1, tree.mirror_z > 0 ? z1 : -z0);
    for (int32_t k = first[2]; k <= last[2]; ++k)
      for (int32_t j = first[1]; j <= last[1]; ++j)
        for (int32_t i = first[0]; i <= last[0]; ++i) {
          const Leaf& leaf = m.leaves[static_cast<size_t>((k * m.cubes[1] + j) * m.cubes[0] + i)];
          if (leaf.length != 0) body(leaf);
        }
  }
};

}  // namespace voxkit::color::terrain
