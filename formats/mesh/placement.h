// Where something is: a linear map and a shift.
#pragma once

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
  glm::dvec3 operator()(const glm::dvec3& p) const { return linear * p + shift; }
};

}  // namespace voxkit
