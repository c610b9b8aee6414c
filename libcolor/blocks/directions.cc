#include "libcolor/blocks/directions.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace voxkit::color {
namespace {

constexpr double degrees_of_radian = 180 / std::numbers::pi;

}  // namespace

uint32_t squared_chord(double degrees) {
  constexpr double precision = 0.01;  // of points, by far
  const double chord = 2 * std::sin(std::clamp(degrees, 0.0, 180.0) / 2 / degrees_of_radian);
  const double within = std::max(0.0, direction_scale * chord - precision);
  return static_cast<uint32_t>(within * within);
}

double chord_angle(uint32_t squared) {
  const double chord = std::sqrt(static_cast<double>(squared)) / direction_scale;
  return 2 * degrees_of_radian * std::asin(std::min(1.0, chord / 2));
}

double angle_between(Octahedral a, Octahedral b) {
  const std::array<int, 3> p = octahedron_point(a), q = octahedron_point(b);
  // Exact: atan2 of whole numbers, so that small angles are not lost.
  const double x = p[1] * q[2] - p[2] * q[1], y = p[2] * q[0] - p[0] * q[2], z = p[0] * q[1] - p[1] * q[0];
  const double dot = p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
  return degrees_of_radian * std::atan2(std::sqrt(x * x + y * y + z * z), dot);
}

}  // namespace voxkit::color
