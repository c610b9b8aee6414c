// Several clouds of points as one.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "formats/mesh/point_cloud.h"

namespace voxkit {

/// Points, by how much they are moved, and what is put before each of their notes.
struct PlacedPoints {
  std::unique_ptr<const PointCloud> points;
  glm::dvec3 by{0};
  std::string prefix;
};

/// The points of all of them, one cloud after the other.
std::unique_ptr<const PointCloud> join_points(std::vector<PlacedPoints> clouds);

}  // namespace voxkit
