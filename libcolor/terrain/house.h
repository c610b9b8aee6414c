// Houses of the terrain: where they stand, what is solid of them, what colour it has.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "libcolor/terrain/light.h"

namespace voxkit::color::terrain {

/// Closed intervals of height, ascending or not, that may overlap.
struct Interval {
  int32_t lo, hi;
};

/// A house with a gabled roof. `a` runs along its ridge, `b` across, both from its middle.
struct House {
  int32_t x, z;           ///< its middle
  int32_t turn;           ///< number of a rotation, 0 to 15, by 22.5 degrees
  int32_t length, width;  ///< half of each, of the walls
  int32_t walls;          ///< height up to the eaves
  int32_t style;
  int32_t base = 0;  ///< height of its floor, from the ground

  struct Local {
    int32_t a, b;
  };
  Local local(int32_t px, int32_t pz) const;
  /// Height of the walls' top under the roof.
  int32_t under_roof(int32_t b) const;
  int32_t top() const;
  /// No part is further from the middle, along x or z.
  int32_t reach() const;
  /// What is solid above a place: parts to add, then parts to take away, in order. Returns their numbers.
  struct Parts {
    std::array<Interval, 8> solid;
    std::array<Interval, 10> hollow;
    int solids = 0, hollows = 0;
  };
  Parts column(int32_t px, int32_t pz) const;
  /// The colour of a voxel on its surface, lit. `edge`: of a voxel.
  Rgb color(int32_t px, int32_t py, int32_t pz, int32_t edge, const Light& light) const;
  /// Height at which a ray of the sun through (u, v) on the floor of the world enters the house, or -1.
  int32_t shadow(int32_t u, int32_t v) const;
};

/// All houses; their `base` is not known yet.
std::span<const House> planned_houses();

}  // namespace voxkit::color::terrain
