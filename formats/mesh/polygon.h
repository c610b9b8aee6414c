// Polygons as triangles.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace voxkit {

/// Splits polygons of one file, in time that is linear in the number of their corners all together. A convex
/// polygon becomes a fan around its first corner. Of any other, as it is seen along its normal (Newell's),
/// ears are cut off: triangles with no other corner in them (G. H. Meisters, "Polygons have ears", 1975);
/// corners that are not convex lie in a grid, so that few are looked at. Polygons whose edges cross become
/// some triangles between their corners.
class PolygonSplitter {
 public:
  /// Bytes that a corner takes at most while its polygon is split.
  static constexpr uint64_t corner_bytes = 160;

  /// Appends numbers of corners, three each. False where it would take too long: over 256 steps a corner,
  /// after 2^26 of them.
  bool split(std::span<const glm::dvec3> corners, std::vector<std::array<uint32_t, 3>>& triangles);

 private:
  bool project(std::span<const glm::dvec3> corners);
  bool is_convex() const;
  double turn(uint32_t a, uint32_t b, uint32_t c) const;
  void fill_grid();
  int cell_along(int axis, double v) const;
  bool is_ear(uint32_t corner);
  bool clip(std::vector<std::array<uint32_t, 3>>& triangles);

  int64_t steps_ = int64_t{1} << 26;  ///< that are left
  std::vector<glm::dvec2> at_;        ///< the corners, counterclockwise
  std::vector<uint32_t> before_, after_;
  std::vector<uint8_t> reflex_;  ///< and still there
  glm::dvec2 lo_{0}, scale_{0};
  int side_ = 0;                               ///< of the grid
  std::vector<uint32_t> cell_begin_, listed_;  ///< the reflex corners of each cell
};

}  // namespace voxkit
