// Where something is: a linear map and a shift.
#pragma once

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace voxkit {

/// p goes to linear * p + shift.
struct Placement {
  glm::dmat3 linear{1};
  glm::dvec3 shift{0};
  Placement operator*(const Placement& inner) const {
    return {linear * inner.linear, linear * inner.shift + shift};
  }
  /// Where a vector points that stands on a surface; its length is lost, and it is 0 where the map is flat.
  glm::dvec3 normal(const glm::dvec3& n) const {
    // The inverse transposed, but for its length: cofactors.
    const glm::dvec3 yz = glm::cross(linear[1], linear[2]), zx = glm::cross(linear[2], linear[0]),
                     xy = glm::cross(linear[0], linear[1]);
    const glm::dvec3 to = n.x * yz + n.y * zx + n.z * xy;
    const double length = glm::length(to), side = glm::dot(linear[0], yz) < 0 ? -1 : 1;
    return length > 0 ? to * (side / length) : glm::dvec3(0);
  }
  glm::dvec3 operator()(const glm::dvec3& p) const { return linear * p + shift; }
};

}  // namespace voxkit
