// The places within a distance of one.
#pragma once

#include <cstdint>
#include <vector>

#include "libcolor/params.h"

namespace voxkit::color {

/// From a voxel to another one.
struct Step {
  int8_t x = 0, y = 0, z = 0;
  uint8_t squared = 0;  ///< its length
};

/// All steps with a squared length of at most `squared`, 0 to 64: the shortest first, beginning with the one
/// that stays; of those of one length by z, then y, then x.
std::vector<Step> ball(int squared);

/// Squares of distances between voxels are whole numbers: the greatest one whose root is at most `distance`,
/// which is 0 to most_simplify.
int squared_of(double distance);

}  // namespace voxkit::color
