// A mesh that grows, as readers find its parts; its memory is counted before it is taken.
#pragma once

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "formats/context.h"
#include "formats/mesh/mesh_parts.h"
#include "formats/mesh/polygon.h"

namespace voxkit {

/// A list whose memory is counted: it doubles in size, and what it will take is reserved before.
template <class T>
class CountedList {
 public:
  /// Room for `more` further values. ErrorCode::limit.
  Status make_room(uint64_t more, const std::string& what, const Context& ctx) {
    if (more <= values.capacity() - values.size()) return {};
    const uint64_t room = std::max<uint64_t>(values.size() + more, 2 * values.capacity());
    VOX_TRY(Reservation next, Reservation::take(room * sizeof(T), what, ctx));
    values.reserve(room);
    memory = std::move(next);  // what was before goes with `next`
    return {};
  }
  std::vector<T> values;
  Reservation memory;
};

struct MeshVertex {
  glm::dvec3 position{0};
  glm::vec2 uv{0}, emission_uv{0}, rm_uv{0};
  glm::vec4 color{1};
  glm::vec3 normal{0};
};

class MeshBuilder {
 public:
  /// Which attributes vertices have. `path` is for messages, and stays.
  struct Attributes {
    bool uvs = false, emission_uvs = false, rm_uvs = false, colors = false, normals = false;
  };
  MeshBuilder(const std::string& path, Context& ctx) : path_(path), ctx_(ctx) {}

  /// Attributes that vertices have from now on; those before get 0, or white, or as
  /// emission_uvs and rm_uvs their uvs.
  Status add_attributes(const Attributes& more);
  const Attributes& attributes() const { return has_; }

  uint64_t vertices() const { return positions_.values.size(); }
  const glm::dvec3& position(uint32_t vertex) const { return positions_.values[vertex]; }
  glm::vec4 color(uint32_t vertex) const { return has_.colors ? colors_.values[vertex] : glm::vec4(1); }
  glm::vec3 normal(uint32_t vertex) const { return has_.normals ? normals_.values[vertex] : glm::vec3(0); }
  glm::vec2 uv(uint32_t vertex) const { return has_.uvs ? uvs_.values[vertex] : glm::vec2(0); }

  /// Room for so many more, where their number is known.
  Status make_room(uint64_t vertices, uint64_t triangles, uint64_t points);

  /// The number of the vertex. ErrorCode::input at 2^32.
  Result<uint32_t> add_vertex(const MeshVertex& vertex);
  /// Corners are numbers of vertices that are there.
  Status add_triangle(uint32_t a, uint32_t b, uint32_t c, uint32_t material);
  Status add_point(uint32_t vertex, uint32_t material);
  /// Split into triangles (polygon.h); fewer than three corners are nothing.
  Status add_polygon(std::span<const uint32_t> corners, uint32_t material);
  /// Of triangle strips: each corner makes a triangle with the two before, the second turned about.
  Status add_strip(std::span<const uint32_t> corners, uint32_t material);

  /// Where it has no number it gets the next one.
  uint32_t add_material(MeshMaterial material, MeshParts::Maps maps = {});
  /// A copy of a material, of the same number, that uses no pictures, for what has no picture coordinates.
  uint32_t without_pictures(uint32_t material);
  MeshMaterial& material(uint32_t index) { return parts_.mesh.materials[index]; }
  MeshParts::Maps& maps(uint32_t index) { return parts_.maps[index]; }
  void note(std::string sentence) { parts_.mesh.notes.push_back(std::move(sentence)); }

  MeshParts finish() &&;

 private:
  const std::string& path_;
  Context& ctx_;
  Attributes has_;
  CountedList<glm::dvec3> positions_;
  CountedList<glm::vec2> uvs_, emission_uvs_, rm_uvs_;
  CountedList<glm::vec4> colors_;
  CountedList<glm::vec3> normals_;
  CountedList<MeshTriangle> triangles_;
  CountedList<MeshPoint> points_;
  uint32_t numbered_ = 0;        ///< materials that have a number by their place
  std::vector<uint32_t> plain_;  ///< of materials: their copies without pictures, or themselves
  PolygonSplitter splitter_;
  std::vector<glm::dvec3> corners_;
  std::vector<std::array<uint32_t, 3>> split_;
  MeshParts parts_;
};

}  // namespace voxkit
