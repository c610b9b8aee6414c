#include "libcolor/surface/mesh_grid.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

namespace voxkit::color {
namespace {

constexpr double steps_per_voxel = 256;
/// What counts as between voxels: meshes of floats, of up to 2^15 voxels a side, are as near.
constexpr double near_border = steps_per_voxel / 64;

/// The border between voxels that is near, if one is.
struct Border {
  bool near = false;
  double steps = 0;
};
Border border_at(double steps) {
  const double border = std::round(steps / steps_per_voxel) * steps_per_voxel;
  return {std::abs(steps - border) <= near_border, border};
}

template <class Visit>
void each_vertex(const Mesh& mesh, const Visit& visit) {
  for (const MeshTriangle& triangle : mesh.triangles)
    for (const uint32_t v : triangle.vertices) visit(mesh.positions[v]);
  for (const MeshPoint& point : mesh.points) visit(mesh.positions[point.vertex]);
}

}  // namespace

MeshGrid MeshGrid::around(const Mesh& mesh, int64_t resolution) {
  MeshGrid grid;
  glm::dvec3 hi(-INFINITY);
  grid.lo_ = glm::dvec3(INFINITY);
  each_vertex(mesh, [&](const glm::dvec3& p) {
    for (int c = 0; c < 3; ++c) {
      grid.lo_[c] = std::min(grid.lo_[c], p[c]);
      hi[c] = std::max(hi[c], p[c]);
    }
  });
  const glm::dvec3 size = hi - grid.lo_;
  const double longest = std::max({size.x, size.y, size.z});
  const double edge = longest > 0 ? longest / static_cast<double>(resolution) : 1;  // else a single point
  const double scale = longest > 0 ? static_cast<double>(resolution * 256) / longest : 256;
  grid.scale_ = glm::dmat3(scale);
  grid.info_.format = VoxelFormat::rgba32;
  for (int c = 0; c < 3; ++c) {
    const auto steps = static_cast<int64_t>(std::llround(size[c] * scale));
    grid.info_.dims[c] = std::clamp<int64_t>((steps + 255) / 256, 1, resolution);
    grid.info_.affine.axes[static_cast<size_t>(c)][static_cast<size_t>(c)] = edge;
    grid.info_.affine.origin[static_cast<size_t>(c)] = grid.lo_[c] + edge / 2;
  }
  return grid;
}

std::optional<MeshGrid> MeshGrid::own(const Mesh& mesh) {
  if (!mesh.grid) return std::nullopt;
  MeshGrid grid;
  grid.own_ = true;
  grid.info_ = *mesh.grid;
  const Affine& affine = grid.info_.affine;
  glm::dmat3 axes;
  for (int i = 0; i < 3; ++i)
    for (int c = 0; c < 3; ++c) axes[i][c] = affine.axes[static_cast<size_t>(i)][static_cast<size_t>(c)];
  const glm::dmat3 to_voxels = glm::inverse(axes);
  // From the corner of the first voxel, half a voxel before its centre.
  for (int c = 0; c < 3; ++c)
    grid.lo_[c] = affine.origin[static_cast<size_t>(c)] - (axes[0][c] + axes[1][c] + axes[2][c]) / 2;
  grid.scale_ = to_voxels * steps_per_voxel;
  grid.mirrored_ = affine.determinant() < 0;
  bool inside = true;
  each_vertex(mesh, [&](const glm::dvec3& p) {
    const glm::dvec3 steps = grid.steps_of(p);
    for (int c = 0; c < 3; ++c)  // written so that what is no number is outside
      inside &= steps[c] >= -near_border &&
                steps[c] <= static_cast<double>(grid.info_.dims[c]) * steps_per_voxel + near_border;
  });
  return inside ? std::optional(grid) : std::nullopt;
}

int32_t MeshGrid::place(double steps, size_t axis) const {
  const auto last = static_cast<double>(info_.dims[static_cast<Index3::length_type>(axis)] * 256 - 1);
  return 2 * static_cast<int32_t>(std::clamp(std::floor(steps), 0.0, last)) + 1;
}

SnappedTriangle MeshGrid::snap(const Mesh& mesh, const MeshTriangle& triangle) const {
  std::array<glm::dvec3, 3> steps;
  for (size_t i = 0; i < 3; ++i) steps[i] = steps_of(mesh.positions[triangle.vertices[i]]);
  if (own_) return snap_faces(steps);
  SnappedTriangle out;
  for (size_t i = 0; i < 3; ++i)
    for (size_t c = 0; c < 3; ++c) out.corners[i][c] = place(steps[i][static_cast<int>(c)], c);
  return out;
}

SnappedTriangle MeshGrid::snap_faces(const std::array<glm::dvec3, 3>& steps) const {
  const glm::dvec3 normal = glm::cross(steps[1] - steps[0], steps[2] - steps[0]);
  SnappedTriangle out;
  std::array<std::array<double, 3>, 3> snapped{};  // by axis
  bool is_face = false;
  for (size_t c = 0; c < 3; ++c) {
    const int axis = static_cast<int>(c);
    std::array<Border, 3> borders;
    for (size_t i = 0; i < 3; ++i) borders[i] = border_at(steps[i][axis]);
    const bool between = std::all_of(borders.begin(), borders.end(), [&](const Border& border) {
      return border.near && border.steps == borders[0].steps;
    });
    double last = -INFINITY;
    for (size_t i = 0; i < 3; ++i) {
      snapped[c][i] = borders[i].near ? borders[i].steps : steps[i][axis];
      last = std::max(last, snapped[c][i]);
    }
    if (between && normal[axis] != 0) {
      is_face = true;
      // Steps begin at borders: the last one of the voxel below, or the first one of that above.
      const bool forwards = (normal[axis] > 0) != mirrored_;
      for (double& step : snapped[c]) step -= forwards ? 1 : 0;
    } else {
      for (size_t i = 0; i < 3; ++i)
        if (borders[i].near && snapped[c][i] == last) snapped[c][i] -= 1;
    }
  }
  for (size_t i = 0; i < 3; ++i)
    for (size_t c = 0; c < 3; ++c)
      out.corners[i][c] = place(is_face ? snapped[c][i] : steps[i][static_cast<int>(c)], c);
  return out;
}

}  // namespace voxkit::color
