// Directions as points of a sphere, for the loops that fit blocks of normals.
#pragma once

#include <array>

#include "libcolor/surface/octahedral.h"

namespace voxkit::color {

/// The radius of the sphere.
inline constexpr int direction_scale = 1 << 14;

inline std::array<float, 3> direction_point(Octahedral o) {
  const std::array<float, 3> d = direction_of(o);
  constexpr float scale = direction_scale;
  return {scale * d[0], scale * d[1], scale * d[2]};
}

/// The greatest squared distance of two such points that are no more than so many degrees apart, whatever is
/// rounded.
uint32_t squared_chord(double degrees);
/// The least angle, in degrees, that points so far apart have between them, or a little more.
double chord_angle(uint32_t squared);
/// Degrees between two directions; those of equal vectors 0.
double angle_between(Octahedral a, Octahedral b);

}  // namespace voxkit::color
