// The light of all pictures: Blinn-Phong, from over the viewer's left shoulder.
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "librender/camera.h"

namespace voxkit::render {

/// Shares of ambient, diffuse and specular light; the specular one falls off as the cosine to the power of
/// 2^log2_shine.
inline constexpr float ambient_light = 0.3f, diffuse_light = 0.6f, specular_light = 0.15f;
inline constexpr int log2_shine = 5;

/// Unit vector to the light, in the world.
inline glm::dvec3 light_of(const RayGenerator& rays) {
  const glm::dvec3 forward = rays.forward();
  const glm::dvec3 side = std::abs(forward.y) < 0.999
                              ? glm::normalize(glm::cross(forward, glm::dvec3(0, 1, 0)))
                              : glm::dvec3(1, 0, 0);
  return glm::normalize(-forward - 0.5 * side + 0.6 * glm::cross(side, forward));
}

}  // namespace voxkit::render
