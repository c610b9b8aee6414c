#include "formats/mesh/gltf_scene.h"

#include <fmt/format.h>

#include <array>
#include <glm/matrix.hpp>
#include <map>
#include <set>
#include <string_view>
#include <utility>

#include "formats/little_endian.h"
#include "formats/mapped_file.h"
#include "formats/mesh/gltf_primitive.h"
#include "formats/mesh/mesh_builder.h"
#include "formats/names.h"

namespace voxkit {
namespace {

using namespace gltf;

/// The text of the file, and the bytes of its own buffer.
struct GltfParts {
  std::string_view json;
  std::optional<std::span<const std::byte>> own_bytes;
};

/// GLB: a header of 12 bytes; chunks with a length, a type and data.
Result<GltfParts> parts_of(std::span<const std::byte> bytes, const std::string& path) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (!text.starts_with("glTF")) {
    if (has_ending(path, ".glb")) return bad_input(path, "not a GLB file: expected glTF at byte 0");
    return GltfParts{text, std::nullopt};
  }
  GltfParts parts;
  constexpr size_t header = 12, chunk_header = 8;
  if (bytes.size() < header || load_le<uint32_t>(bytes.data() + 4) != 2)
    return bad_input(path, "corrupt GLB file: byte 4: expected version 2");
  if (load_le<uint32_t>(bytes.data() + 8) != bytes.size())
    return bad_input(path, fmt::format("GLB file is {} bytes long: expected {}", bytes.size(),
                                       load_le<uint32_t>(bytes.data() + 8)));
  for (size_t at = header; at < bytes.size();) {
    if (bytes.size() - at < chunk_header ||
        load_le<uint32_t>(bytes.data() + at) > bytes.size() - at - chunk_header)
      return bad_input(
          path, fmt::format("corrupt GLB file: chunk at byte {}: it leads past the end of the file", at));
    const size_t length = load_le<uint32_t>(bytes.data() + at);
    const std::string_view type = text.substr(at + 4, 4);
    if ((at == header) != (type == "JSON"))
      return bad_input(path,
                       fmt::format("corrupt GLB file: chunk at byte {}: expected JSON first, and once", at));
    if (type == "JSON") parts.json = text.substr(at + chunk_header, length);
    if (type == std::string_view("BIN\0", 4) && !parts.own_bytes)
      parts.own_bytes = bytes.subspan(at + chunk_header, length);
    at += chunk_header + length;
  }
  return parts;
}

class SceneReader {
 public:
  SceneReader(const Document& document, Buffers& buffers, const std::string& path, Context& ctx,
              const MeshOptions& options)
      : document_(document),
        buffers_(buffers),
        path_(path),
        ctx_(ctx),
        options_(options),
        builder_(path, ctx) {}

  Result<MeshParts> read() {
    VOX_CHECK(place_nodes());
    std::map<uint32_t, std::vector<Placement>> places;  // of meshes that are the same everywhere
    for (const uint32_t index : order_) {
      const Node& node = document_.nodes[index];
      if (node.grid) add_grid(*node.grid, global_[index]);
      if (node.mesh == none) continue;
      if (node.skin != none) {
        VOX_CHECK(add_mesh(node, std::array<Placement, 1>{}));  // its joints say where it is
        continue;
      }
      std::vector<Placement> instances{global_[index]};
      if (node.instances) {
        VOX_TRY(instances, instances_of(*node.instances, global_[index]));
      }
      if (!node.weights.empty()) {
        VOX_CHECK(add_mesh(node, instances));
      } else {
        auto& all = places[node.mesh];
        all.insert(all.end(), instances.begin(), instances.end());
      }
    }
    for (const auto& [mesh, all] : places) {
      Node node;
      node.mesh = mesh;
      VOX_CHECK(add_mesh(node, all));
    }
    for (const std::string& note : document_.notes) builder_.note(note);
    for (const std::string& note : notes_) builder_.note(note);
    MeshParts parts = std::move(builder_).finish();
    parts.mesh.says_emission = parts.mesh.says_rm = true;
    if (grids_.size() == 1) parts.mesh.grid = std::move(grids_[0]);
    return parts;
  }

 private:
  tl::unexpected<Error> bad(const std::string& what) const {
    return bad_input(path_, "corrupt glTF file: " + what);
  }

  /// Where all nodes are, and those of the scene in their order.
  Status place_nodes() {
    const auto& nodes = document_.nodes;
    global_.resize(nodes.size());
    std::vector<bool> below(nodes.size());
    for (const Node& node : nodes)
      for (const uint32_t child : node.children) below[child] = true;
    std::vector<uint32_t> stack;
    for (uint32_t i = 0; i < nodes.size(); ++i)
      if (!below[i]) {
        global_[i] = nodes[i].local;
        stack.push_back(i);
      }
    while (!stack.empty()) {
      const uint32_t at = stack.back();
      stack.pop_back();
      for (const uint32_t child : nodes[at].children) {
        global_[child] = global_[at] * nodes[child].local;
        stack.push_back(child);
      }
    }
    // A root may be below another: then it comes once.
    std::vector<bool> seen(nodes.size());
    for (auto root = document_.roots.rbegin(); root != document_.roots.rend(); ++root) stack.push_back(*root);
    while (!stack.empty()) {
      const uint32_t at = stack.back();
      stack.pop_back();
      if (seen[at]) continue;
      seen[at] = true;
      order_.push_back(at);
      const auto& children = nodes[at].children;
      for (auto child = children.rbegin(); child != children.rend(); ++child) stack.push_back(*child);
    }
    return {};
  }

  void add_grid(VolumeInfo grid, const Placement& place) {
    const auto turned = [&](const Affine::Vector& v) { return place.linear * glm::dvec3(v[0], v[1], v[2]); };
    for (Affine::Vector& axis : grid.affine.axes) {
      const glm::dvec3 to = turned(axis);
      axis = {to.x, to.y, to.z};
    }
    const glm::dvec3 at = turned(grid.affine.origin) + place.shift;
    grid.affine.origin = {at.x, at.y, at.z};
    if (grid.affine.is_valid()) grids_.push_back(std::move(grid));
  }

  Result<std::vector<Placement>> instances_of(const Node::Instances& instances, const Placement& outer) {
    Values<float> translation, rotation, scale;
    uint64_t count = 0;
    for (const auto& [index, to] :
         {std::pair(instances.translation, &translation), std::pair(instances.rotation, &rotation),
          std::pair(instances.scale, &scale)}) {
      if (index == none) continue;
      VOX_TRY(*to, buffers_.floats(index));
      count = document_.accessors[index].count;
    }
    VOX_TRY(Reservation memory,
            Reservation::take(2 * count * sizeof(Placement), "instances of a mesh", ctx_));
    memory_.push_back(std::move(memory));
    std::vector<Placement> out;
    out.reserve(count);
    for (uint64_t i = 0; i < count; ++i) {
      const auto three = [&](const Values<float>& from, double otherwise) {
        return from.values.empty()
                   ? glm::dvec3(otherwise)
                   : glm::dvec3(from.values[3 * i], from.values[3 * i + 1], from.values[3 * i + 2]);
      };
      std::array<double, 4> turn{0, 0, 0, 1};
      for (size_t c = 0; c < 4 && !rotation.values.empty(); ++c) turn[c] = rotation.values[4 * i + c];
      out.push_back(outer * placement_of(three(translation, 0), turn, three(scale, 1)));
    }
    return out;
  }

  /// The material of the builder.
  Result<uint32_t> material_of(uint32_t index) {
    auto [at, is_new] = materials_.try_emplace(index, 0);
    if (!is_new) return at->second;
    if (index == none) {
      // As the specification has it: a metal, without roughness being said.
      MeshMaterial blank;
      blank.number = static_cast<uint32_t>(document_.materials.size());
      blank.metalness = 1;
      at->second = builder_.add_material(std::move(blank));
      return at->second;
    }
    const Material& material = document_.materials[index];
    MeshParts::Maps maps;
    const auto image_of = [&](const PictureInfo& info) -> Result<PictureReference> {
      const gltf::Picture& picture = document_.pictures[info.picture];
      const bool webp =
          picture.webp != none &&
          (picture.image == none || load_module({"webp", "reading WebP textures", "libwebp-dev"}));
      const uint32_t image = webp ? picture.webp : picture.image;
      if (image == none)
        return bad_input(path_,
                         fmt::format("material {}: its texture {} has no picture of a known kind: expected "
                                     "PNG, JPEG or WebP",
                                     material.material.name, info.picture));
      return buffers_.image(image);
    };
    if (material.color.picture != none) {
      VOX_TRY(maps.color, image_of(material.color));
    }
    if (material.emission.picture != none) {
      VOX_TRY(maps.emission, image_of(material.emission));
    }
    if (material.rm.picture != none) {
      VOX_TRY(maps.rm, image_of(material.rm));
    }
    at->second = builder_.add_material(material.material, std::move(maps));
    return at->second;
  }

  Status add_mesh(const Node& node, std::span<const Placement> places) {
    if (places.empty()) return {};
    const gltf::Mesh& mesh = document_.meshes[node.mesh];
    const std::span<const double> weights = node.weights.empty() ? mesh.weights : node.weights;
    for (const Primitive& primitive : mesh.primitives) {
      VOX_CHECK(check_interrupt());
      if (primitive.mode >= 1 && primitive.mode <= 3) {
        notes_.insert("dropped: lines");
        continue;
      }
      VOX_TRY(Geometry geometry, read_primitive(document_, buffers_, primitive, weights, node.skin != none,
                                                options_.normals, path_, ctx_));
      if (geometry.positions.empty()) {
        notes_.insert("dropped: primitives without vertices");
        continue;
      }
      VOX_TRY(uint32_t material, material_of(primitive.material));
      if (geometry.lacks_uvs) material = builder_.without_pictures(material);
      if (node.skin != none) VOX_CHECK(bend(document_.skins[node.skin], node, geometry));
      VOX_CHECK(builder_.add_attributes({.uvs = !geometry.uvs.empty(),
                                         .emission_uvs = !geometry.emission_uvs.empty(),
                                         .rm_uvs = !geometry.rm_uvs.empty(),
                                         .colors = !geometry.colors.empty(),
                                         .normals = !geometry.normals.empty()}));
      const uint64_t vertices = geometry.positions.size(), corners = geometry.corners.size();
      if (vertices > UINT32_MAX / places.size() || corners > (uint64_t{1} << 40) / places.size())
        return bad_input(path_, fmt::format("a mesh of {} x {} vertices: expected less than 2^32",
                                            places.size(), vertices));
      const bool points = primitive.mode == 0;
      const uint64_t triangles = primitive.mode == 4 ? corners / 3 : corners;
      VOX_CHECK(builder_.make_room(vertices * places.size(), points ? 0 : triangles * places.size(),
                                   points ? corners * places.size() : 0));
      for (const Placement& place : places)
        VOX_CHECK(add_geometry(geometry, place, primitive.mode, material));
    }
    return {};
  }

  Status add_geometry(const Geometry& geometry, const Placement& place, uint32_t mode, uint32_t material) {
    const auto first = static_cast<uint32_t>(builder_.vertices());
    for (size_t i = 0; i < geometry.positions.size(); ++i) {
      MeshVertex vertex;
      vertex.position = place(geometry.positions[i]);
      if (!geometry.uvs.empty()) vertex.uv = geometry.uvs[i];
      vertex.emission_uv = geometry.emission_uvs.empty() ? vertex.uv : geometry.emission_uvs[i];
      vertex.rm_uv = geometry.rm_uvs.empty() ? vertex.uv : geometry.rm_uvs[i];
      if (!geometry.colors.empty()) vertex.color = geometry.colors[i];
      if (!geometry.normals.empty()) vertex.normal = glm::vec3(place.normal(geometry.normals[i]));
      VOX_CHECK(builder_.add_vertex(vertex));
    }
    const auto corner = [&](size_t i) { return first + geometry.corners[i]; };
    // The other side of triangles is the front where they are mirrored.
    const bool mirrored = glm::determinant(place.linear) < 0;
    const auto add = [&](uint32_t a, uint32_t b, uint32_t c) {
      return mirrored ? builder_.add_triangle(a, c, b, material) : builder_.add_triangle(a, b, c, material);
    };
    const size_t count = geometry.corners.size();
    switch (mode) {
      case 0:
        for (size_t i = 0; i < count; ++i) VOX_CHECK(builder_.add_point(corner(i), material));
        break;
      case 4:
        for (size_t i = 0; i + 2 < count; i += 3) VOX_CHECK(add(corner(i), corner(i + 1), corner(i + 2)));
        break;
      case 5:
        for (size_t i = 2; i < count; ++i)
          VOX_CHECK(add(corner(i - 2 + i % 2), corner(i - 1 - i % 2), corner(i)));
        break;
      default:
        for (size_t i = 2; i < count; ++i) VOX_CHECK(add(corner(0), corner(i - 1), corner(i)));
    }
    return {};
  }

  /// Puts vertices where their joints have them. What no joint has stays where its node is.
  Status bend(const Skin& skin, const Node& node, Geometry& geometry) {
    std::vector<Placement> joints;
    Values<float> inverse;
    if (skin.inverse_bind != none) {
      VOX_TRY(inverse, buffers_.floats(skin.inverse_bind));
    }
    for (size_t i = 0; i < skin.joints.size(); ++i) {
      Placement bind;
      if (!inverse.values.empty()) {
        const float* const m = inverse.values.data() + 16 * i;
        bind = {{{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}}, {m[12], m[13], m[14]}};
      }
      joints.push_back(global_[skin.joints[i]] * bind);
    }
    const Placement& own = global_[static_cast<size_t>(&node - document_.nodes.data())];
    for (size_t v = 0; v < geometry.positions.size(); ++v) {
      const glm::dvec3 from = geometry.positions[v];
      glm::dvec3 to(0), normal(0);
      const bool has_normal = !geometry.normals.empty();
      double sum = 0;
      for (size_t set = 0; set < geometry.joints.size(); ++set)
        for (size_t k = 0; k < 4; ++k) {
          const double weight = geometry.weights[set].values[4 * v + k];
          if (weight == 0) continue;
          const float joint = geometry.joints[set].values[4 * v + k];
          if (!(joint >= 0 && joint < static_cast<float>(joints.size())))
            return bad(fmt::format("a skin: joint {}: expected one below {}", joint, joints.size()));
          const Placement& place = joints[static_cast<size_t>(joint)];
          to += weight * place(from);
          if (has_normal) normal += weight * place.normal(geometry.normals[v]);
          sum += weight;
        }
      geometry.positions[v] = sum > 0 ? to / sum : own(from);
      if (has_normal) geometry.normals[v] = sum > 0 ? normal : own.normal(geometry.normals[v]);
    }
    return {};
  }

  const Document& document_;
  Buffers& buffers_;
  const std::string& path_;
  Context& ctx_;
  const MeshOptions& options_;
  MeshBuilder builder_;
  std::vector<Placement> global_;
  std::vector<VolumeInfo> grids_;
  std::vector<uint32_t> order_;
  std::map<uint32_t, uint32_t> materials_;
  std::set<std::string> notes_;
  std::vector<Reservation> memory_;
};

}  // namespace

Result<MeshParts> read_gltf(const std::string& path, MeshFolder& folder, Context& ctx,
                            const MeshOptions& options) {
  VOX_TRY(const auto file, MappedFile::open(path));
  VOX_TRY(const GltfParts parts, parts_of(file->bytes(), path));
  const auto own_bytes = parts.own_bytes ? std::optional<uint64_t>(parts.own_bytes->size()) : std::nullopt;
  VOX_TRY(const Document document, read_document(parts.json, own_bytes, path, ctx, options.rm));
  Buffers buffers(document, parts.own_bytes.value_or(std::span<const std::byte>{}), file, path, folder, ctx);
  return SceneReader(document, buffers, path, ctx, options).read();
}

}  // namespace voxkit
