#include "formats/mesh/mesh_3ds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "formats/mapped_file.h"
#include "formats/mesh/mesh_3ds_parts.h"

namespace voxkit {
namespace {

using namespace studio;

constexpr uint32_t none = UINT32_MAX;

/// Faces of an object that have a material: their numbers, two bytes each.
struct Group {
  std::string material;
  std::span<const std::byte> faces;
};

/// Where in the file the parts of an object are.
struct Object {
  std::string name;
  std::span<const std::byte> places;  ///< three floats a vertex
  std::span<const std::byte> faces;   ///< numbers of three vertices, and flags: two bytes each
  std::span<const std::byte> uvs;     ///< two floats a vertex, or nothing
  size_t first_group = 0, groups = 0;
  Placement axes;
};

class Reader {
 public:
  Reader(std::span<const std::byte> bytes, const std::string& path, Context& ctx)
      : bytes_(bytes), path_(path), ctx_(ctx), builder_(path, ctx), memory_(*ctx.memory) {}

  Result<MeshParts> read() {
    Body file(bytes_, 0, bytes_.size(), path_);
    if (bytes_.size() < 6 || load_le<uint16_t>(bytes_.data()) != m3dmagic)
      return bad_input(path_, "not a 3DS file: expected 4D4D at byte 0");
    VOX_TRY(const Body::Chunk main, file.chunk());
    for (Body body = main.body; body.has_chunk();) {
      VOX_TRY(const Body::Chunk chunk, body.chunk());
      if (chunk.id == mdata) VOX_CHECK(read_scene(chunk.body));
      if (chunk.id == kfdata) VOX_CHECK(read_nodes(chunk.body));
    }
    VOX_CHECK(add_objects());
    if (file.left() > 0) dropped_.insert(fmt::format("{} bytes behind the file's own", file.left()));
    if (has_keys_) dropped_.insert("key frames after the first");
    for (const std::string& name : unknown_)
      builder_.note(fmt::format("material {} is not in the file: white is taken", name));
    if (!dropped_.empty()) builder_.note(fmt::format("dropped: {}", fmt::join(dropped_, ", ")));
    MeshParts parts = std::move(builder_).finish();
    parts.mesh.memory.push_back(std::move(memory_));
    return parts;
  }

 private:
  Status read_scene(Body body) {
    while (body.has_chunk()) {
      VOX_TRY(Body::Chunk chunk, body.chunk());
      if (chunk.id == mat_entry) {
        VOX_TRY(Material material, read_material(chunk.body, dropped_));
        VOX_CHECK(add_material(std::move(material)));
      } else if (chunk.id == named_object) {
        VOX_CHECK(read_object(chunk.body));
      }
    }
    return {};
  }

  /// The first of a name counts.
  Status add_material(Material material) {
    const auto [at, is_new] =
        by_name_.try_emplace(material.material.name, static_cast<uint32_t>(materials_.size()));
    if (!is_new) return {};
    VOX_CHECK(memory_.add(2 * (sizeof(Material) + material.material.name.size()) + 256, "materials"));
    builder_.add_material(material.material, material.maps);
    materials_.push_back(std::move(material));
    return {};
  }

  Status read_object(Body body) {
    VOX_TRY(std::string name, body.text());
    while (body.has_chunk()) {
      VOX_TRY(Body::Chunk chunk, body.chunk());
      if (chunk.id == n_direct_light) dropped_.insert("lights");
      if (chunk.id == n_camera) dropped_.insert("cameras");
      if (chunk.id == obj_hidden) dropped_.insert("that objects are hidden");
      if (chunk.id == n_tri_object) VOX_CHECK(read_triangles(name, chunk.body));
    }
    return {};
  }

  /// A number of elements, and as many bytes as these take.
  static Result<std::span<const std::byte>> read_list(Body& body, uint64_t element) {
    VOX_TRY(const auto count, body.number<uint16_t>());
    return body.take(count * element);
  }

  Status read_triangles(const std::string& name, Body body) {
    const size_t begin = body.at();
    Object object;
    object.name = name;
    object.first_group = groups_.values.size();
    while (body.has_chunk()) {
      VOX_TRY(Body::Chunk chunk, body.chunk());
      switch (chunk.id) {
        case point_array: {
          VOX_TRY(object.places, read_list(chunk.body, 12));
          break;
        }
        case tex_verts: {
          VOX_TRY(object.uvs, read_list(chunk.body, 8));
          break;
        }
        case face_array: {
          VOX_TRY(object.faces, read_list(chunk.body, 8));
          VOX_CHECK(read_groups(chunk.body));
          break;
        }
        case mesh_matrix:
          for (int column = 0; column < 4; ++column)
            for (int a = 0; a < 3; ++a) {
              VOX_TRY(const auto value, chunk.body.number<float>());
              (column < 3 ? object.axes.linear[column] : object.axes.shift)[a] = value;
            }
          break;
        default:
          break;
      }
    }
    object.groups = groups_.values.size() - object.first_group;
    if (!object.uvs.empty() && object.uvs.size() / 8 != object.places.size() / 12)
      return body.bad(begin, fmt::format("object {}: {} texture coordinates of {} vertices", name,
                                         object.uvs.size() / 8, object.places.size() / 12));
    VOX_CHECK(objects_.make_room(1, "the objects", ctx_));
    objects_.values.push_back(std::move(object));
    return {};
  }

  Status read_groups(Body body) {
    while (body.has_chunk()) {
      VOX_TRY(Body::Chunk chunk, body.chunk());
      if (chunk.id != msh_mat_group) continue;
      VOX_CHECK(groups_.make_room(1, "the objects", ctx_));
      Group& group = groups_.values.emplace_back();
      VOX_TRY(group.material, chunk.body.text());
      VOX_TRY(group.faces, read_list(chunk.body, 2));
    }
    return {};
  }

  Status read_nodes(Body body) {
    for (uint32_t index = 0; body.has_chunk();) {
      VOX_TRY(const Body::Chunk chunk, body.chunk());
      const bool is_node = chunk.id > kfdata && chunk.id < 0xb008;
      if (chunk.id == object_node_tag) {
        VOX_CHECK(nodes_.make_room(1, "the nodes", ctx_));
        VOX_TRY(Node node, read_node(chunk.body, index, has_keys_));
        nodes_.values.push_back(std::move(node));
      }
      index += is_node;
    }
    return {};
  }

  Status add_objects() {
    const auto& nodes = nodes_.values;
    VOX_TRY(const Reservation memory,
            Reservation::take(nodes.size() * (sizeof(Placement) + 128), "the nodes", ctx_));
    VOX_TRY(const std::vector<Placement> places, place_nodes(nodes, path_, dropped_));
    std::multimap<std::string_view, size_t> shown;
    for (size_t i = 0; i < nodes.size(); ++i) shown.emplace(nodes[i].object, i);
    for (const Object& object : objects_.values) {
      VOX_CHECK(sort_faces(object));
      if (order_.empty()) continue;
      // Where its vertices are among its own axes.
      const double det = glm::determinant(object.axes.linear);
      Placement inner;
      inner.linear = glm::inverse(object.axes.linear);
      inner.shift = -(inner.linear * object.axes.shift);
      // As programs that write such axes mean them: x is mirrored.
      if (det < 0) inner = Placement{glm::dmat3(-1, 0, 0, 0, 1, 0, 0, 0, 1), {}} * inner;
      const bool has_axes = std::isfinite(det) && det != 0;
      if (!has_axes) dropped_.insert("axes of objects that are flat, and where their nodes are");
      const auto [first, last] = shown.equal_range(object.name);
      if (first == last || !has_axes) {
        VOX_CHECK(add_object(object, has_axes && det < 0 ? object.axes * inner : Placement{}));
        continue;
      }
      for (auto at = first; at != last; ++at)
        VOX_CHECK(add_object(
            object, places[at->second] * Placement{glm::dmat3(1), -nodes[at->second].pivot} * inner));
    }
    return {};
  }

  /// The faces of an object that are triangles, those of materials that move textures behind the others, and
  /// together.
  Status sort_faces(const Object& object) {
    const size_t count = object.faces.size() / 8, vertices = object.places.size() / 12;
    order_.clear();
    made_.resize(std::max(made_.size(), vertices));
    for (uint32_t face = 0; face < count; ++face) {
      const auto [a, b, c] = corners_of(object, face);
      if (const uint32_t last = std::max({a, b, c}); last >= vertices)
        return bad_input(path_, fmt::format("corrupt 3DS file: object {}: face {}: vertex {}: there are {}",
                                            object.name, face, last, vertices));
      if (a != b && b != c && c != a) order_.push_back(face);
    }
    material_.assign(count, none);
    for (size_t g = object.first_group; g < object.first_group + object.groups; ++g) {
      const Group& group = groups_.values[g];
      const auto at = by_name_.find(group.material);
      if (at == by_name_.end() && !group.faces.empty() && unknown_.size() < 16)
        unknown_.insert(group.material);
      for (size_t i = 0; i < group.faces.size() / 2; ++i) {
        const auto face = load_le<uint16_t>(&group.faces[2 * i]);
        if (face >= count)
          return bad_input(path_,
                           fmt::format("corrupt 3DS file: object {}: material {}: face {}: there are {}",
                                       object.name, group.material, face, count));
        material_[face] = at == by_name_.end() ? none : at->second;
      }
    }
    std::stable_sort(order_.begin(), order_.end(),
                     [&](uint32_t a, uint32_t b) { return way_of(material_[a]) < way_of(material_[b]); });
    return {};
  }
  static std::array<uint32_t, 3> corners_of(const Object& object, uint32_t face) {
    std::array<uint32_t, 3> out{};
    for (size_t c = 0; c < 3; ++c) out[c] = load_le<uint16_t>(&object.faces[8 * face + 2 * c]);
    return out;
  }
  /// Materials with one way take the same picture coordinates.
  uint32_t way_of(uint32_t material) const {
    return material != none && materials_[material].moves() ? material + 1 : 0;
  }

  Status add_object(const Object& object, const Placement& place) {
    const bool uvs = !object.uvs.empty();
    if (uvs) VOX_CHECK(builder_.add_attributes({.uvs = true}));
    for (const uint32_t face : order_) {
      const uint32_t material = material_[face], way = way_of(material);
      std::array<uint32_t, 3> corners = corners_of(object, face);
      for (uint32_t& corner : corners) {
        Made& made = made_[corner];
        if (made.vertex == none || made.way != way) {
          VOX_TRY(const uint32_t vertex, builder_.add_vertex(vertex_at(object, place, corner, way)));
          made = {vertex, way};
        }
        corner = made.vertex;
      }
      VOX_TRY(const uint32_t used, use_material(material, uvs));
      VOX_CHECK(builder_.add_triangle(corners[0], corners[1], corners[2], used));
    }
    for (const uint32_t face : order_)
      for (const uint32_t corner : corners_of(object, face)) made_[corner] = {};
    return {};
  }

  MeshVertex vertex_at(const Object& object, const Placement& place, size_t v, uint32_t way) const {
    MeshVertex out;
    const auto number = [](std::span<const std::byte> from, size_t at) {
      return static_cast<double>(load_le<float>(&from[4 * at]));
    };
    out.position = place(
        {number(object.places, 3 * v), number(object.places, 3 * v + 1), number(object.places, 3 * v + 2)});
    if (object.uvs.empty()) return out;
    glm::dvec2 uv(number(object.uvs, 2 * v), number(object.uvs, 2 * v + 1));
    if (way > 0) uv = materials_[way - 1].scale * uv + materials_[way - 1].offset;
    out.uv = glm::vec2(uv.x, 1 - uv.y);
    return out;
  }

  /// The builder's number of a material; of none: white.
  Result<uint32_t> use_material(uint32_t material, bool uvs) {
    if (material == none) {
      if (white_ == none) white_ = builder_.add_material({});
      return white_;
    }
    if (uvs) return material;
    const uint32_t plain = builder_.without_pictures(material);
    builder_.material(plain).color = materials_[material].plain;
    return plain;
  }

  std::span<const std::byte> bytes_;
  const std::string& path_;
  Context& ctx_;
  MeshBuilder builder_;
  Reservation memory_;               ///< of materials
  std::vector<Material> materials_;  ///< with the numbers that the builder has for them
  std::map<std::string, uint32_t> by_name_;
  CountedList<Object> objects_;
  CountedList<Group> groups_;
  CountedList<Node> nodes_;
  bool has_keys_ = false;
  uint32_t white_ = none;
  std::set<std::string> dropped_, unknown_;

  /// Of the faces and vertices of one object: fewer than 65536 of each.
  struct Made {
    uint32_t vertex = none, way = 0;
  };
  std::vector<uint32_t> order_, material_;
  std::vector<Made> made_;
};

}  // namespace

Result<MeshParts> read_3ds(const std::string& path, Context& ctx) {
  VOX_TRY(const auto file, MappedFile::open(path));
  return Reader(file->bytes(), path, ctx).read();
}

}  // namespace voxkit
