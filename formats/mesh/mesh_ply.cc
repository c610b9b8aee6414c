#include "formats/mesh/mesh_ply.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "formats/lab.h"
#include "formats/mapped_file.h"
#include "formats/mesh/mesh_builder.h"
#include "formats/mesh/ply_file.h"

namespace voxkit {
namespace {

using namespace ply;

class PlyReader {
 public:
  PlyReader(const Header& header, std::span<const std::byte> bytes, const std::string& path, Context& ctx)
      : header_(header), numbers_(bytes, header, path), path_(path), ctx_(ctx), builder_(path, ctx) {}

  Result<MeshParts> read() {
    // Faces that come before their vertices wait for these.
    std::vector<std::pair<const Element*, Numbers>> waiting;
    bool has_vertices = false;
    for (const Element& element : header_.elements) {
      VOX_CHECK(numbers_.check_count(element));
      if (element.name == "vertex") {
        if (std::exchange(has_vertices, true)) return bad_vertices();
        VOX_CHECK(read_vertices(element));
        for (auto& [before, numbers] : waiting) VOX_CHECK(read_faces(*before, numbers));
        waiting.clear();
      } else if (!element.has(Role::corners)) {
        VOX_CHECK(pass_over(element));
      } else if (has_vertices) {
        VOX_CHECK(read_faces(element, numbers_));
      } else {
        waiting.emplace_back(&element, numbers_);
        VOX_CHECK(pass_over(element));
      }
    }
    if (!waiting.empty()) return bad_vertices();
    add_materials();
    for (std::string& note : header_.notes()) builder_.note(std::move(note));
    if (too_bright_) builder_.note("colors are above 1: they are taken as 1");
    if (lost_colors_) builder_.note("dropped: colors of faces, since vertices have some");
    return std::move(builder_).finish();
  }

 private:
  tl::unexpected<Error> bad_vertices() const {
    return bad_input(path_, "corrupt PLY file: expected one list of vertices with x, y and z");
  }
  Status pass_over(const Element& element) {
    for (uint64_t i = 0; i < element.count && !element.properties.empty(); ++i)
      for (const Property& p : element.properties) VOX_CHECK(numbers_.pass(p));
    return {};
  }

  /// Of red, green, blue or alpha as they are stored.
  void set_color(glm::vec4& color, const Property& p, double value) {
    const double stored = value * scale_of(p.type);
    if (p.role == Role::alpha) {
      faint_ |= stored < 1;
    } else {
      too_bright_ |= stored > 1;
    }
    color[static_cast<int>(p.role) - static_cast<int>(Role::red)] =
        static_cast<float>(p.role == Role::alpha ? stored : srgb_to_linear(stored));
  }

  Status read_vertices(const Element& element) {
    const bool colors = element.has(Role::red), uvs = element.has(Role::u) && element.has(Role::v);
    if (!element.has(Role::x) || !element.has(Role::y) || !element.has(Role::z)) return bad_vertices();
    VOX_CHECK(builder_.add_attributes({.uvs = uvs, .colors = colors, .normals = element.has(Role::nx)}));
    VOX_CHECK(builder_.make_room(element.count, 0, 0));
    for (uint64_t i = 0; i < element.count; ++i) {
      MeshVertex vertex;
      if (colors) vertex.color = {0, 0, 0, 1};
      for (const Property& p : element.properties) {
        if (p.role == Role::none) {
          VOX_CHECK(numbers_.pass(p));
          continue;
        }
        VOX_TRY(const double value, numbers_.next(p.type));
        if (p.role <= Role::z)
          vertex.position[static_cast<int>(p.role) - static_cast<int>(Role::x)] = value;
        else if (p.role <= Role::alpha && colors)
          set_color(vertex.color, p, value);
        else if (p.role == Role::u)
          vertex.uv.x = static_cast<float>(value);
        else if (p.role == Role::v)
          vertex.uv.y = static_cast<float>(1 - value);
        else if (p.role >= Role::nx && p.role <= Role::nz)
          vertex.normal[static_cast<int>(p.role) - static_cast<int>(Role::nx)] = static_cast<float>(value);
      }
      VOX_CHECK(builder_.add_vertex(vertex));
    }
    vertices_ = element.count;
    vertex_colors_ = colors;
    return {};
  }

  Status read_faces(const Element& element, Numbers& numbers) {
    const bool strips = element.name == "tristrips", colors = element.has(Role::red) && !vertex_colors_;
    lost_colors_ |= element.has(Role::red) && vertex_colors_ && element.count > 0;
    if (colors) VOX_CHECK(builder_.add_attributes({.colors = true}));
    CountedList<int64_t> corner_list;
    CountedList<glm::vec2> texcoord_list;
    auto& corners = corner_list.values;
    auto& texcoords = texcoord_list.values;
    for (uint64_t i = 0; i < element.count; ++i) {
      corners.clear();
      texcoords.clear();
      glm::vec4 color(0, 0, 0, 1);
      uint32_t picture = 0;
      for (const Property& p : element.properties) {
        if (!p.list && p.role != Role::none) {
          VOX_TRY(const double value, numbers.next(p.type));
          if (p.role == Role::picture)
            picture = value >= 0 && value < 65536 ? static_cast<uint32_t>(value) : UINT32_MAX;
          else
            set_color(color, p, value);
          continue;
        }
        if (p.role != Role::corners && p.role != Role::texcoords) {
          VOX_CHECK(numbers.pass(p));
          continue;
        }
        VOX_TRY(const uint64_t count, numbers.list_size(p));
        // Twice: for the numbers that they become.
        VOX_CHECK(corner_list.make_room(p.role == Role::corners ? 2 * count : 0, "a polygon", ctx_));
        VOX_CHECK(texcoord_list.make_room(p.role == Role::texcoords ? count / 2 + 1 : 0, "a polygon", ctx_));
        for (uint64_t j = 0; j < count; ++j) {
          VOX_TRY(const double value, numbers.next(p.type));
          if (p.role == Role::corners) {
            corners.push_back(value >= -1 && value < UINT32_MAX ? static_cast<int64_t>(value) : INT64_MAX);
          } else if (j % 2 == 0) {
            texcoords.push_back({static_cast<float>(value), 1});
          } else {
            texcoords.back().y = static_cast<float>(1 - value);
          }
        }
      }
      if (picture >= std::max<size_t>(header_.pictures.size(), 1))
        return bad_input(path_, fmt::format("corrupt PLY file: a face of texture {}: there are {}", picture,
                                            header_.pictures.size()));
      if (strips) {
        VOX_CHECK(add_strips(corners));
      } else {
        VOX_CHECK(add_face(corners, texcoords, colors ? &color : nullptr, picture));
      }
    }
    return {};
  }

  Status check_corner(int64_t corner) const {
    if (corner >= 0 && static_cast<uint64_t>(corner) < vertices_) return {};
    return bad_input(path_, fmt::format("corrupt mesh: vertex {}: expected one below {}", corner, vertices_));
  }

  Status add_strips(std::span<const int64_t> corners) {
    numbers32_.clear();
    for (const int64_t corner : corners) {
      if (corner != -1) {
        VOX_CHECK(check_corner(corner));
        numbers32_.push_back(static_cast<uint32_t>(corner));
        continue;
      }
      VOX_CHECK(builder_.add_strip(numbers32_, 0));
      numbers32_.clear();
    }
    return builder_.add_strip(numbers32_, 0);
  }

  /// A face with picture coordinates or a colour of its own has vertices of its own.
  Status add_face(std::span<const int64_t> corners, const std::vector<glm::vec2>& texcoords,
                  const glm::vec4* color, uint32_t picture) {
    if (corners.size() < 3) return {};
    const bool uvs = texcoords.size() == corners.size();
    if (uvs) VOX_CHECK(builder_.add_attributes({.uvs = true}));
    numbers32_.clear();
    for (size_t j = 0; j < corners.size(); ++j) {
      VOX_CHECK(check_corner(corners[j]));
      auto number = static_cast<uint32_t>(corners[j]);
      if (uvs || color) {
        MeshVertex vertex;
        vertex.position = builder_.position(number);
        vertex.uv = builder_.uv(number);
        vertex.color = builder_.color(number);
        vertex.normal = builder_.normal(number);
        if (uvs) vertex.uv = texcoords[j];
        if (color) vertex.color = *color;
        VOX_TRY(number, builder_.add_vertex(vertex));
      }
      numbers32_.push_back(number);
    }
    return builder_.add_polygon(numbers32_, picture);
  }

  /// One for each picture, in their order.
  void add_materials() {
    const bool uvs = builder_.attributes().uvs;
    for (size_t i = 0; i < std::max<size_t>(header_.pictures.size(), 1); ++i) {
      MeshParts::Maps maps;
      if (uvs && i < header_.pictures.size()) maps.color.name = header_.pictures[i];
      MeshMaterial material;
      if (faint_) material.alpha_mode = AlphaMode::blend;
      builder_.add_material(material, std::move(maps));
    }
    if (!uvs && !header_.pictures.empty())
      builder_.note(
          fmt::format("the texture {} is left out: there are no texture coordinates", header_.pictures[0]));
  }

  const Header& header_;
  Numbers numbers_;
  const std::string& path_;
  Context& ctx_;
  MeshBuilder builder_;
  uint64_t vertices_ = 0;  ///< of the file
  bool vertex_colors_ = false, too_bright_ = false, faint_ = false, lost_colors_ = false;
  std::vector<uint32_t> numbers32_;
};

}  // namespace

Result<MeshParts> read_ply(const std::string& path, Context& ctx, const MeshOptions& options) {
  VOX_TRY(const auto file, MappedFile::open(path));
  const auto bytes = file->bytes();
  VOX_TRY(ply::Header header, ply::read_header(bytes, path));
  if (!options.normals) header.drop(Role::nx, Role::nz);
  header.drop(Role::roughness, Role::intensity);
  return PlyReader(header, bytes, path, ctx).read();
}

}  // namespace voxkit
