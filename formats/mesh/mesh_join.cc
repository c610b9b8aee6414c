#include "formats/mesh/mesh_join.h"

#include <fmt/format.h>

#include <algorithm>

#include "formats/lab.h"

namespace voxkit {
namespace {

constexpr uint64_t most_numbers = UINT32_MAX;

template <class T>
void append(std::vector<T>& to, std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
  from = {};
}

/// What vertices have, so that all of them have it.
struct Has {
  bool uvs = false, emission_uvs = false, rm_uvs = false, normals = false, colors = false;
};

/// Puts `mesh` behind `out`, which has room for it. Its materials are numbered from `first_number` on.
void add(Mesh& out, Mesh& mesh, const Has& has, uint32_t& first_number) {
  const auto first_vertex = static_cast<uint32_t>(out.positions.size());
  const auto first_material = static_cast<uint32_t>(out.materials.size());
  const auto first_picture = static_cast<int32_t>(out.pictures.size());
  const size_t vertices = mesh.positions.size();
  // Where there are none of emission, those of colours are meant.
  if (has.uvs && mesh.uvs.empty()) mesh.uvs.resize(vertices);
  if (has.emission_uvs && mesh.emission_uvs.empty()) mesh.emission_uvs = mesh.uvs;
  if (has.rm_uvs && mesh.rm_uvs.empty()) mesh.rm_uvs = mesh.uvs;
  if (has.normals && mesh.normals.empty()) mesh.normals.resize(vertices, glm::vec3(0));
  if (has.colors && mesh.colors.empty()) mesh.colors.resize(vertices, glm::vec4(1));
  append(out.positions, mesh.positions);
  append(out.uvs, mesh.uvs);
  append(out.emission_uvs, mesh.emission_uvs);
  append(out.rm_uvs, mesh.rm_uvs);
  append(out.normals, mesh.normals);
  append(out.colors, mesh.colors);
  for (MeshTriangle triangle : mesh.triangles) {
    for (uint32_t& vertex : triangle.vertices) vertex += first_vertex;
    triangle.material += first_material;
    out.triangles.push_back(triangle);
  }
  for (const MeshPoint& point : mesh.points)
    out.points.push_back({point.vertex + first_vertex, point.material + first_material});
  uint32_t own = 0, end = 0;
  for (MeshMaterial& material : mesh.materials) {
    if (material.picture >= 0) material.picture += first_picture;
    if (material.emission_picture >= 0) material.emission_picture += first_picture;
    if (material.rm_picture >= 0) material.rm_picture += first_picture;
    if (material.number == UINT32_MAX) material.number = own;
    ++own;
    end = std::max(end, material.number + 1);
    material.number += first_number;
    out.materials.push_back(std::move(material));
  }
  first_number += end;
  out.says_emission |= mesh.says_emission;
  out.says_rm |= mesh.says_rm;
  std::move(mesh.pictures.begin(), mesh.pictures.end(), std::back_inserter(out.pictures));
  std::move(mesh.notes.begin(), mesh.notes.end(), std::back_inserter(out.notes));
}

}  // namespace

void move_mesh(Mesh& mesh, const glm::dvec3& by) {
  for (glm::dvec3& position : mesh.positions) position += by;
  if (mesh.grid)
    for (int c = 0; c < 3; ++c) mesh.grid->affine.origin[static_cast<size_t>(c)] += by[c];
}

Result<Mesh> mesh_of_points(const PointCloud& points, Context& ctx) {
  if (points.size() > most_numbers) return fail(ErrorCode::limit, {}, "2^32 points or more in a mesh");
  Mesh mesh;
  constexpr uint64_t point_bytes = sizeof(glm::dvec3) + sizeof(glm::vec4) + sizeof(MeshPoint);
  VOX_TRY(Reservation memory, Reservation::take(points.size() * point_bytes, "points of a mesh", ctx));
  mesh.memory.push_back(std::move(memory));
  mesh.positions.reserve(points.size());
  mesh.colors.reserve(points.size());
  mesh.points.reserve(points.size());
  bool faint = false;
  VOX_CHECK(points.read([&](std::span<const CloudPoint> run) -> Status {
    for (const CloudPoint& point : run) {
      const auto light = [&](size_t c) { return static_cast<float>(srgb_to_linear(point.color[c] / 255.0)); };
      mesh.points.push_back({static_cast<uint32_t>(mesh.positions.size()), 0});
      mesh.positions.push_back(point.at);
      mesh.colors.emplace_back(light(0), light(1), light(2), static_cast<float>(point.alpha) / 255);
      faint |= point.alpha < 255;
    }
    return {};
  }));
  mesh.materials.emplace_back();
  if (faint) mesh.materials.front().alpha_mode = AlphaMode::blend;
  mesh.notes = points.notes();
  if (points.grid())
    mesh.notes.emplace_back("its own grid of voxels is dropped: there is one around all inputs");
  if (mesh.points.size() < points.size())
    mesh.notes.push_back(
        fmt::format("{} of {} points are dropped: they are at coordinates that are not finite, or less "
                    "than half opaque",
                    points.size() - mesh.points.size(), points.size()));
  return mesh;
}

Result<Mesh> join_meshes(std::vector<Mesh> meshes, Context& ctx) {
  Has has;
  uint64_t vertices = 0, triangles = 0, points = 0, materials = 0;
  for (const Mesh& mesh : meshes) {
    has.uvs |= !mesh.uvs.empty();
    has.emission_uvs |= !mesh.emission_uvs.empty();
    has.rm_uvs |= !mesh.rm_uvs.empty();
    has.normals |= !mesh.normals.empty();
    has.colors |= !mesh.colors.empty();
    vertices += mesh.positions.size();
    triangles += mesh.triangles.size();
    points += mesh.points.size();
    materials += mesh.materials.size();
  }
  has.uvs |= has.emission_uvs || has.rm_uvs;
  if (std::max(vertices, materials) > most_numbers)
    return fail(ErrorCode::limit, {}, "2^32 vertices or materials, or more, in all of them");
  const uint64_t vertex_bytes = sizeof(glm::dvec3) + (has.uvs ? sizeof(glm::vec2) : 0) +
                                (has.emission_uvs ? sizeof(glm::vec2) : 0) +
                                (has.rm_uvs ? sizeof(glm::vec2) : 0) + (has.normals ? sizeof(glm::vec3) : 0) +
                                (has.colors ? sizeof(glm::vec4) : 0);
  Mesh out;
  VOX_TRY(Reservation memory, Reservation::take(vertices * vertex_bytes + triangles * sizeof(MeshTriangle) +
                                                    points * sizeof(MeshPoint),
                                                "meshes in one", ctx));
  out.memory.push_back(std::move(memory));
  out.positions.reserve(vertices);
  if (has.uvs) out.uvs.reserve(vertices);
  if (has.emission_uvs) out.emission_uvs.reserve(vertices);
  if (has.rm_uvs) out.rm_uvs.reserve(vertices);
  if (has.normals) out.normals.reserve(vertices);
  if (has.colors) out.colors.reserve(vertices);
  out.triangles.reserve(triangles);
  out.points.reserve(points);
  uint32_t first_number = 0;
  for (Mesh& mesh : meshes) {
    add(out, mesh, has, first_number);
    mesh = {};
  }
  return out;
}

}  // namespace voxkit
