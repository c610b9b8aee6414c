#include "formats/mesh/mesh_obj.h"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "formats/lab.h"
#include "formats/mapped_file.h"
#include "formats/mesh/mesh_builder.h"
#include "formats/mesh/text_statements.h"
#include "formats/mesh/voxel_grid.h"

namespace voxkit {
namespace {

constexpr uint32_t none = UINT32_MAX;
constexpr const char* library_word = "material library";

/// Numbers of a corner, from 0.
struct Corner {
  uint32_t vertex = none, uv = none, normal = none;
};

class ObjReader {
 public:
  ObjReader(std::span<const std::byte> bytes, const std::string& path, MeshFolder& folder, Context& ctx,
            const MeshOptions& options)
      : bytes_(bytes),
        path_(path),
        folder_(folder),
        ctx_(ctx),
        wants_normals_(options.normals),
        builder_(path, ctx) {
    library_.rm = options.rm;
  }

  /// Vertices and materials first: what uses them may come before.
  Result<MeshParts> read() {
    VOX_CHECK(read_vertices());
    if (positions_.values.size() >= none || uvs_.values.size() >= none || normals_.values.size() >= none)
      return bad_input(
          path_, fmt::format("a mesh of {} vertices: expected less than 2^32", positions_.values.size()));
    VOX_CHECK(begin_mesh());
    VOX_CHECK(read_elements());
    for (const std::string& name : unknown_)
      builder_.note(fmt::format("material {} is in none of its libraries: white is taken", name));
    if (!dropped_.empty()) builder_.note(fmt::format("dropped: {}", fmt::join(dropped_, ", ")));
    if (lacks_uvs_)
      builder_.note("dropped: numbers of texture coordinates at corners: the file has no such coordinates");
    if (too_bright_) builder_.note("colors of vertices are above 1: they are taken as 1");
    MeshParts parts = std::move(builder_).finish();
    parts.mesh.says_emission = parts.mesh.says_rm = true;
    parts.mesh.grid = std::move(grid_);
    return parts;
  }

 private:
  tl::unexpected<Error> bad(const TextStatements& lines, const std::string& what) const {
    return bad_input(path_, fmt::format("corrupt OBJ file: line {}: {}", lines.line(), what));
  }

  /// Then a place is a vertex; else it is one with each of its other numbers.
  bool has_places_only() const { return uvs_.values.empty() && normals_.values.empty(); }

  /// What was read of the file.
  struct Before {
    uint32_t vertices = 0, uvs = 0, normals = 0;
  };

  Status read_vertices() {
    TextStatements lines(bytes_);
    while (lines.next()) {
      const std::string_view keyword = lines.word();
      if (keyword == "v") {
        VOX_CHECK(read_vertex(lines));
      } else if (keyword == "vt") {
        double uv[2] = {0, 0};
        const auto first = number_of(lines.word());
        if (!first) return bad(lines, "vt: expected numbers");
        uv[0] = *first;
        if (const std::string_view word = lines.word(); !word.empty()) {
          const auto second = number_of(word);
          if (!second) return bad(lines, "vt: expected numbers");
          uv[1] = *second;
        }
        VOX_CHECK(uvs_.make_room(1, "texture coordinates", ctx_));
        uvs_.values.push_back(glm::vec2(uv[0], uv[1]));
      } else if (keyword == "vn" && wants_normals_) {
        glm::vec3 normal;
        for (int c = 0; c < 3; ++c) {
          const auto value = number_of(lines.word());
          if (!value) return bad(lines, "vn: expected three numbers");
          normal[c] = static_cast<float>(*value);
        }
        VOX_CHECK(normals_.make_room(1, "normals", ctx_));
        normals_.values.push_back(normal);
      } else if (keyword == "mtllib") {
        VOX_CHECK(read_libraries(lines.rest()));
      } else if (keyword.empty() && !grid_) {
        read_grid(lines.rest());
      }
    }
    return {};
  }

  /// A comment that says of which voxels these are the faces.
  void read_grid(std::string_view comment) {
    static const std::string begin = fmt::format("# {} ", voxel_grid_name);
    if (comment.starts_with(begin)) grid_ = parse_voxel_grid(comment.substr(begin.size()));
  }

  /// x y z, x y z w, x y z r g b, or with a, too.
  Status read_vertex(TextStatements& lines) {
    double values[7];
    size_t count = 0;
    for (std::string_view word; count < 7 && !(word = lines.word()).empty(); ++count) {
      const auto value = number_of(word);
      if (!value) return bad(lines, fmt::format("v {}: expected numbers", word));
      values[count] = *value;
    }
    if (count < 3 || count == 5) return bad(lines, "v: expected x, y and z, and perhaps red, green and blue");
    VOX_CHECK(positions_.make_room(1, "the mesh", ctx_));
    positions_.values.push_back({values[0], values[1], values[2]});
    if (count >= 6 || !colors_.values.empty()) {
      const uint64_t before = positions_.values.size() - 1;
      VOX_CHECK(colors_.make_room(positions_.values.size() - colors_.values.size(), "the mesh", ctx_));
      colors_.values.resize(before, glm::vec4(1));
      glm::vec4& color = colors_.values.emplace_back(1.0f);
      for (size_t c = 0; count >= 6 && c < 3; ++c) {
        too_bright_ |= values[3 + c] > 1;
        color[static_cast<int>(c)] = static_cast<float>(srgb_to_linear(static_cast<float>(values[3 + c])));
      }
      if (count == 7) color.a = static_cast<float>(values[6]);
      faint_ |= color.a < 1;
    }
    return {};
  }

  /// One name with spaces, or several names.
  Status read_libraries(std::string_view rest) {
    std::vector<std::string> names{std::string(rest)};
    bool one = rest.find_first_of(" \t") == rest.npos;
    if (!one) {
      const auto found = folder_.find(names[0], library_word);
      one = found && !found->empty();
    }
    if (!one) {
      names.clear();
      for (size_t at = 0; (at = rest.find_first_not_of(" \t", at)) != rest.npos;) {
        const size_t end = std::min(rest.find_first_of(" \t", at), rest.size());
        names.emplace_back(rest.substr(at, end - at));
        at = end;
      }
    }
    for (const std::string& name : names) {
      if (!read_.insert(name).second) continue;
      VOX_TRY(std::string file, folder_.find(name, library_word));
      if (file.empty()) {
        // Of a mesh that was renamed.
        VOX_TRY(file, folder_.find(std::filesystem::path(path_).stem().string() + ".mtl", library_word));
        if (file.empty()) return bad_input(path_, fmt::format("{} is missing, which the mesh needs", name));
        builder_.note(
            fmt::format("{} is missing: {} is taken", name, std::filesystem::path(file).filename().string()));
        if (!read_.insert(file).second) continue;
      }
      VOX_CHECK(read_mtl(file, library_));
    }
    return {};
  }

  Status begin_mesh() {
    bool emission_uvs = false;
    for (const auto& [name, material] : library_.materials)
      emission_uvs |= material.maps.emission.used() && !(material.emission == material.color);
    const bool uvs = !uvs_.values.empty();
    VOX_CHECK(builder_.add_attributes({.uvs = uvs,
                                       .emission_uvs = uvs && emission_uvs,
                                       .colors = !colors_.values.empty(),
                                       .normals = !normals_.values.empty()}));
    VOX_CHECK(builder_.make_room(positions_.values.size(), 0, 0));
    if (has_places_only()) {
      for (uint32_t i = 0; i < positions_.values.size(); ++i) VOX_CHECK(builder_.add_vertex(vertex_at({i})));
    } else {
      VOX_CHECK(made_.make_room(positions_.values.size(), "the mesh", ctx_));
      made_.values.resize(positions_.values.size(), none);
    }
    for (const std::string& name : library_.dropped) dropped_.insert(name);
    return {};
  }

  Status read_elements() {
    TextStatements lines(bytes_);
    Before before;  // up to here: negative numbers count back
    CountedList<uint32_t> corners;
    CountedList<Corner> read;
    while (lines.next()) {
      const std::string_view keyword = lines.word();
      if (keyword == "v") {
        ++before.vertices;
      } else if (keyword == "vt") {
        ++before.uvs;
      } else if (keyword == "vn") {
        ++before.normals;
      } else if (keyword == "f" || keyword == "fo" || keyword == "p") {
        read.values.clear();
        bool has_uvs = true;
        for (std::string_view word; !(word = lines.word()).empty();) {
          VOX_TRY(const Corner corner, read_corner(lines, word, before));
          has_uvs &= corner.uv != none;
          VOX_CHECK(read.make_room(1, "a polygon", ctx_));
          read.values.push_back(corner);
        }
        if (!material_) VOX_CHECK(use_material(""));
        const uint32_t material = has_uvs ? **material_ : builder_.without_pictures(**material_);
        corners.values.clear();
        VOX_CHECK(corners.make_room(read.values.size(), "a polygon", ctx_));
        for (const Corner& corner : read.values) {
          VOX_TRY(const uint32_t vertex, vertex_of(corner));
          corners.values.push_back(vertex);
        }
        if (keyword == "p") {
          for (const uint32_t corner : corners.values) VOX_CHECK(builder_.add_point(corner, material));
        } else {
          VOX_CHECK(builder_.add_polygon(corners.values, material));
        }
      } else if (keyword == "usemtl") {
        VOX_CHECK(use_material(lines.rest()));
      } else if (keyword == "l") {
        dropped_.insert("lines");
      } else if (keyword == "curv" || keyword == "curv2" || keyword == "surf" || keyword == "bzp" ||
                 keyword == "bsp" || keyword == "cdc" || keyword == "cdp" || keyword == "res") {
        dropped_.insert("curves and free-form surfaces");
      } else if (keyword == "call" || keyword == "csh") {
        dropped_.insert("statements of other files and programs (call, csh)");
      } else if (keyword == "maplib" || keyword == "usemap") {
        dropped_.insert("texture map libraries (maplib, usemap)");
      }
    }
    return {};
  }

  /// 1, 1/2, 1//3 or 1/2/3. Some programs write the second number where there are no texture coordinates at
  /// all: it is dropped.
  Result<Corner> read_corner(const TextStatements& lines, std::string_view word, const Before& counts) {
    const std::string_view all = word;
    const auto take = [&] {
      const size_t end = std::min(word.find('/'), word.size());
      const std::string_view digits = word.substr(0, end);
      word.remove_prefix(std::min(end + 1, word.size()));
      return digits;
    };
    const auto index = [&](uint64_t before, uint64_t count, const char* what) -> Result<uint32_t> {
      std::string_view digits = take();
      if (digits.empty()) return none;
      if (digits.starts_with('+')) digits.remove_prefix(1);
      int64_t number = 0;
      const auto [last, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
      if (last != digits.data() + digits.size() || digits.empty() || number == 0 || error != std::errc())
        return bad(lines, fmt::format("{}: expected numbers of vertices, from 1 on", all));
      const int64_t from_one = number < 0 ? number + static_cast<int64_t>(before) + 1 : number;
      if (from_one >= 1 && static_cast<uint64_t>(from_one) <= count)
        return static_cast<uint32_t>(from_one - 1);
      return bad(lines, fmt::format("{}: {} {}: out of range: {}", all, what, number,
                                    count == 0   ? "the file has none"
                                    : number > 0 ? fmt::format("expected 1 to {}", count)
                                    : before > 0 ? fmt::format("expected -1 to -{}, those before it", before)
                                                 : "there are none before it"));
    };
    Corner corner;
    VOX_TRY(corner.vertex, index(counts.vertices, positions_.values.size(), "vertex"));
    if (!uvs_.values.empty()) {
      VOX_TRY(corner.uv, index(counts.uvs, uvs_.values.size(), "texture coordinates"));
    } else {
      lacks_uvs_ |= !word.empty() && word.front() != '/';
      take();
    }
    if (!normals_.values.empty()) {
      VOX_TRY(corner.normal, index(counts.normals, normals_.values.size(), "normal"));
    }
    if (corner.vertex == none) return bad(lines, fmt::format("{}: expected the number of a vertex", all));
    return corner;
  }

  Status use_material(std::string_view name) {
    name_ = name;
    const auto at = library_.materials.find(name_);
    now_ = at == library_.materials.end() ? nullptr : &at->second;
    material_ = &material_of_[name_];
    if (*material_) return {};
    if (now_) {
      *material_ = builder_.add_material(now_->material, now_->maps);
    } else {
      MeshMaterial white;
      white.name = name_;
      *material_ = builder_.add_material(white);
      if (!name_.empty() && !library_.materials.empty()) unknown_.insert(name_);
    }
    if (faint_) builder_.material(**material_).alpha_mode = AlphaMode::blend;
    return {};
  }

  MeshVertex vertex_at(const Corner& corner) const {
    MeshVertex out;
    out.position = positions_.values[corner.vertex];
    if (!colors_.values.empty() && corner.vertex < colors_.values.size())
      out.color = colors_.values[corner.vertex];
    if (corner.normal != none) out.normal = normals_.values[corner.normal];
    if (corner.uv == none) return out;
    const glm::vec2 uv = uvs_.values[corner.uv];
    const auto through = [&](const MapTransform& t) {
      if (t == MapTransform{}) return glm::vec2(uv.x, 1 - uv.y);
      const glm::dvec2 moved = t.scale * glm::dvec2(uv) + t.offset;
      return glm::vec2(moved.x, 1 - moved.y);
    };
    out.uv = through(now_ ? now_->color : MapTransform{});
    out.emission_uv = through(now_ ? now_->emission : MapTransform{});
    return out;
  }

  /// The vertex of a corner: one that was made of the same numbers, among the last few of this place.
  Result<uint32_t> vertex_of(const Corner& corner) {
    if (has_places_only()) return corner.vertex;
    const bool moves = now_ && (!(now_->color == MapTransform{}) || !(now_->emission == MapTransform{}));
    const uint32_t way = moves ? **material_ + 1 : 0;
    uint32_t at = made_.values[corner.vertex];
    for (int steps = 0; at != none && steps < 16; ++steps) {
      const Made& made = chain_.values[at];
      if (made.uv == corner.uv && made.normal == corner.normal && made.way == way) return at;
      at = made.before;
    }
    VOX_CHECK(chain_.make_room(1, "the mesh", ctx_));
    VOX_TRY(const uint32_t vertex, builder_.add_vertex(vertex_at(corner)));
    chain_.values.push_back({corner.uv, corner.normal, way, made_.values[corner.vertex]});
    made_.values[corner.vertex] = vertex;
    return vertex;
  }

  std::span<const std::byte> bytes_;
  const std::string& path_;
  MeshFolder& folder_;
  Context& ctx_;
  bool wants_normals_;
  MeshBuilder builder_;
  CountedList<glm::dvec3> positions_;
  CountedList<glm::vec2> uvs_;
  CountedList<glm::vec3> normals_;
  CountedList<glm::vec4> colors_;  ///< of the first vertices; the others are white
  MaterialLibrary library_;
  std::set<std::string> read_, dropped_, unknown_;
  std::optional<VolumeInfo> grid_;
  bool too_bright_ = false, faint_ = false;  ///< that some color is
  bool lacks_uvs_ = false;  ///< corners have numbers of texture coordinates, the file has none

  std::string name_;
  const ObjMaterial* now_ = nullptr;
  std::map<std::string, std::optional<uint32_t>> material_of_;  ///< of the builder, by name
  std::optional<uint32_t>* material_ = nullptr;

  /// What a vertex of the mesh was made of; the one before of the same place.
  struct Made {
    uint32_t uv, normal, way, before;
  };
  CountedList<uint32_t> made_;  ///< of places: the last vertex
  CountedList<Made> chain_;     ///< of vertices
};

}  // namespace

Result<MeshParts> read_obj(const std::string& path, MeshFolder& folder, Context& ctx,
                           const MeshOptions& options) {
  VOX_TRY(const auto file, MappedFile::open(path));
  return ObjReader(file->bytes(), path, folder, ctx, options).read();
}

}  // namespace voxkit
