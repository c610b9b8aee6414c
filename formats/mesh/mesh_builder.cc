#include "formats/mesh/mesh_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace voxkit {
namespace {

constexpr const char* what = "the mesh";

}  // namespace

Status MeshBuilder::add_attributes(const Attributes& more) {
  const uint64_t count = vertices();
  const auto begin = [&]<class T>(bool asked, bool& has, CountedList<T>& list, T blank) -> Status {
    if (!asked || has) return {};
    VOX_CHECK(list.make_room(positions_.values.capacity(), what, ctx_));
    list.values.resize(count, blank);
    has = true;
    return {};
  };
  VOX_CHECK(begin(more.uvs, has_.uvs, uvs_, glm::vec2(0)));
  if (more.emission_uvs && !has_.emission_uvs) {
    VOX_CHECK(begin(true, has_.emission_uvs, emission_uvs_, glm::vec2(0)));
    std::copy(uvs_.values.begin(), uvs_.values.end(), emission_uvs_.values.begin());
  }
  if (more.rm_uvs && !has_.rm_uvs) {
    VOX_CHECK(begin(true, has_.rm_uvs, rm_uvs_, glm::vec2(0)));
    std::copy(uvs_.values.begin(), uvs_.values.end(), rm_uvs_.values.begin());
  }
  VOX_CHECK(begin(more.normals, has_.normals, normals_, glm::vec3(0)));
  return begin(more.colors, has_.colors, colors_, glm::vec4(1));
}

Status MeshBuilder::make_room(uint64_t vertices, uint64_t triangles, uint64_t points) {
  if (vertices > UINT32_MAX || this->vertices() + vertices > UINT32_MAX)
    return bad_input(
        path_, fmt::format("a mesh of {} vertices: expected less than 2^32", this->vertices() + vertices));
  VOX_CHECK(positions_.make_room(vertices, what, ctx_));
  if (has_.uvs) VOX_CHECK(uvs_.make_room(vertices, what, ctx_));
  if (has_.emission_uvs) VOX_CHECK(emission_uvs_.make_room(vertices, what, ctx_));
  if (has_.rm_uvs) VOX_CHECK(rm_uvs_.make_room(vertices, what, ctx_));
  if (has_.colors) VOX_CHECK(colors_.make_room(vertices, what, ctx_));
  if (has_.normals) VOX_CHECK(normals_.make_room(vertices, what, ctx_));
  VOX_CHECK(triangles_.make_room(triangles, what, ctx_));
  return points_.make_room(points, what, ctx_);
}

Result<uint32_t> MeshBuilder::add_vertex(const MeshVertex& vertex) {
  VOX_CHECK(make_room(1, 0, 0));
  positions_.values.push_back(vertex.position);
  if (has_.uvs) uvs_.values.push_back(vertex.uv);
  if (has_.emission_uvs) emission_uvs_.values.push_back(vertex.emission_uv);
  if (has_.rm_uvs) rm_uvs_.values.push_back(vertex.rm_uv);
  if (has_.colors) colors_.values.push_back(vertex.color);
  if (has_.normals) normals_.values.push_back(vertex.normal);
  return static_cast<uint32_t>(vertices() - 1);
}

Status MeshBuilder::add_triangle(uint32_t a, uint32_t b, uint32_t c, uint32_t material) {
  if (a == b || b == c || c == a) return {};
  VOX_CHECK(triangles_.make_room(1, what, ctx_));
  triangles_.values.push_back({{a, b, c}, material});
  return {};
}

Status MeshBuilder::add_point(uint32_t vertex, uint32_t material) {
  VOX_CHECK(points_.make_room(1, what, ctx_));
  points_.values.push_back({vertex, material});
  return {};
}

Status MeshBuilder::add_polygon(std::span<const uint32_t> corners, uint32_t material) {
  if (corners.size() < 3) return {};
  if (corners.size() == 3) return add_triangle(corners[0], corners[1], corners[2], material);
  VOX_TRY(const Reservation memory,
          Reservation::take(corners.size() > 1024 ? corners.size() * PolygonSplitter::corner_bytes : 0,
                            "splitting a polygon", ctx_));
  corners_.clear();
  for (const uint32_t corner : corners) corners_.push_back(position(corner));
  split_.clear();
  if (!splitter_.split(corners_, split_))
    return bad_input(path_,
                     fmt::format("a polygon of {} corners that cross each other too often to be split: "
                                 "expected triangles",
                                 corners.size()));
  for (const auto& [a, b, c] : split_) VOX_CHECK(add_triangle(corners[a], corners[b], corners[c], material));
  return {};
}

Status MeshBuilder::add_strip(std::span<const uint32_t> corners, uint32_t material) {
  for (size_t i = 2; i < corners.size(); ++i)
    VOX_CHECK(add_triangle(corners[i - 2 + i % 2], corners[i - 1 - i % 2], corners[i], material));
  return {};
}

uint32_t MeshBuilder::add_material(MeshMaterial material, MeshParts::Maps maps) {
  if (material.number == UINT32_MAX) material.number = numbered_++;
  parts_.mesh.materials.push_back(std::move(material));
  parts_.maps.push_back(std::move(maps));
  plain_.push_back(UINT32_MAX);
  return static_cast<uint32_t>(plain_.size() - 1);
}

uint32_t MeshBuilder::without_pictures(uint32_t index) {
  const MeshParts::Maps& maps = parts_.maps[index];
  if (!maps.color.used() && !maps.opacity.used() && !maps.emission.used() && !maps.rm.used()) return index;
  if (plain_[index] == UINT32_MAX) {
    MeshMaterial copy = parts_.mesh.materials[index];
    const uint32_t made = add_material(std::move(copy));
    plain_[index] = made;
    note(fmt::format("material {}: where there are no texture coordinates it goes without its texture",
                     parts_.mesh.materials[index].name));
  }
  return plain_[index];
}

MeshParts MeshBuilder::finish() && {
  Mesh& mesh = parts_.mesh;
  const auto take = [&](auto& list, auto& to) {
    to = std::move(list.values);
    mesh.memory.push_back(std::move(list.memory));
  };
  take(positions_, mesh.positions);
  take(uvs_, mesh.uvs);
  take(emission_uvs_, mesh.emission_uvs);
  take(rm_uvs_, mesh.rm_uvs);
  take(colors_, mesh.colors);
  take(normals_, mesh.normals);
  take(triangles_, mesh.triangles);
  take(points_, mesh.points);
  return std::move(parts_);
}

}  // namespace voxkit
