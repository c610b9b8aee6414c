#include "formats/mesh/mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <utility>

#include "formats/mesh/gltf_scene.h"
#include "formats/mesh/mesh_3ds.h"
#include "formats/mesh/mesh_obj.h"
#include "formats/mesh/mesh_parts.h"
#include "formats/mesh/mesh_ply.h"
#include "formats/mesh/mesh_stl.h"
#include "formats/names.h"

namespace voxkit {
namespace {

bool is_finite(const glm::dvec3& p) {
  // Sums of squares of what a float can hold are far from the end of a double's range.
  constexpr double most = 3.5e38;
  return std::abs(p.x) <= most && std::abs(p.y) <= most && std::abs(p.z) <= most;
}

bool has_area(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const glm::dvec3 u = b - a, v = c - a;
  return u.y * v.z != u.z * v.y || u.z * v.x != u.x * v.z || u.x * v.y != u.y * v.x;
}

/// Written so that a NaN becomes 0.
float within_one(float value) {
  return value > 0 ? std::min(value, 1.0f) : 0.0f;
}

void bring_into_range(glm::vec4& color) {
  for (int c = 0; c < 4; ++c) color[c] = within_one(color[c]);
}

Result<MeshParts> read_parts(const std::string& path, MeshFolder& folder, Context& ctx,
                             const MeshOptions& options) {
  if (has_ending(path, ".ply")) return read_ply(path, ctx, options);
  if (has_ending(path, ".obj")) return read_obj(path, folder, ctx, options);
  if (has_ending(path, ".stl")) return read_stl(path, ctx);
  if (has_ending(path, ".3ds")) return read_3ds(path, ctx);
  return read_gltf(path, folder, ctx, options);
}

/// Drops the points that are nowhere, and says how many.
Status check_points(Mesh& mesh, const std::string& path) {
  size_t kept = 0;
  for (const MeshPoint point : mesh.points) {
    if (point.material >= mesh.materials.size() || point.vertex >= mesh.positions.size())
      return bad_input(path, "corrupt mesh: a point without its vertex or material");
    const glm::vec2 uv = mesh.uvs.empty() ? glm::vec2(0) : mesh.uvs[point.vertex];
    if (is_finite(mesh.positions[point.vertex]) && std::isfinite(uv.x) && std::isfinite(uv.y))
      mesh.points[kept++] = point;
  }
  if (kept < mesh.points.size())
    mesh.notes.push_back(fmt::format("{} of {} points are dropped: their coordinates are not finite",
                                     mesh.points.size() - kept, mesh.points.size()));
  mesh.points.resize(kept);
  return {};
}

}  // namespace

bool is_mesh_name(const std::string& name) {
  for (const char* ending : {".obj", ".gltf", ".glb", ".ply", ".stl", ".3ds"})
    if (has_ending(name, ending)) return true;
  return false;
}

Status check_mesh(Mesh& mesh, const std::string& path) {
  const size_t vertices = mesh.positions.size();
  if ((!mesh.uvs.empty() && mesh.uvs.size() != vertices) ||
      (!mesh.emission_uvs.empty() && mesh.emission_uvs.size() != vertices) ||
      (!mesh.rm_uvs.empty() && mesh.rm_uvs.size() != vertices) ||
      (!mesh.normals.empty() && mesh.normals.size() != vertices) ||
      (!mesh.colors.empty() && mesh.colors.size() != vertices))
    return bad_input(path, "corrupt mesh: vertices without all of their attributes");
  const bool had_triangles = !mesh.triangles.empty();
  size_t kept = 0;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const MeshTriangle triangle = mesh.triangles[i];
    if (triangle.material >= mesh.materials.size())
      return bad_input(path, fmt::format("corrupt mesh: triangle {}: material {}: expected one below {}", i,
                                         triangle.material, mesh.materials.size()));
    for (const uint32_t v : triangle.vertices) {
      if (v >= vertices)
        return bad_input(
            path, fmt::format("corrupt mesh: triangle {}: vertex {}: expected one below {}", i, v, vertices));
      const glm::dvec3& p = mesh.positions[v];
      if (!is_finite(p))
        return bad_input(path,
                         fmt::format("corrupt mesh: triangle {}: a corner at ({}, {}, {}): expected finite "
                                     "coordinates, as a float holds them",
                                     i, p.x, p.y, p.z));
      for (const auto* uvs : {&mesh.uvs, &mesh.emission_uvs, &mesh.rm_uvs})
        if (!uvs->empty() && (!std::isfinite((*uvs)[v].x) || !std::isfinite((*uvs)[v].y)))
          return bad_input(path,
                           fmt::format("corrupt mesh: triangle {}: texture coordinates ({}, {}): expected "
                                       "finite ones",
                                       i, (*uvs)[v].x, (*uvs)[v].y));
    }
    const auto& [a, b, c] = triangle.vertices;
    if (has_area(mesh.positions[a], mesh.positions[b], mesh.positions[c])) mesh.triangles[kept++] = triangle;
  }
  mesh.triangles.resize(kept);
  VOX_CHECK(check_points(mesh, path));
  for (glm::vec4& color : mesh.colors) bring_into_range(color);
  for (glm::vec3& normal : mesh.normals)
    if (!(glm::dot(normal, normal) < 1e30f)) normal = glm::vec3(0);
  for (MeshMaterial& material : mesh.materials) {
    bring_into_range(material.color);
    material.roughness = within_one(material.roughness);
    material.metalness = within_one(material.metalness);
    // Above 1 nothing is there, however opaque.
    if (!(material.alpha_cutoff > 1)) material.alpha_cutoff = within_one(material.alpha_cutoff);
    for (int c = 0; c < 3; ++c)
      material.emission[c] = material.emission[c] > 0 ? std::min(material.emission[c], 1e6f) : 0;
  }
  if (kept == 0 && mesh.points.empty())
    return bad_input(
        path, had_triangles ? "a mesh without triangles that have an area" : "a mesh without triangles");
  return {};
}

Status load_pictures(MeshParts& parts, const std::string& path, MeshFolder& folder, Context& ctx) {
  Mesh& mesh = parts.mesh;
  std::vector<bool> used(mesh.materials.size());
  for (const MeshTriangle& triangle : mesh.triangles) used[triangle.material] = true;
  for (const MeshPoint& point : mesh.points) used[point.material] = true;

  const auto load = [&](const PictureReference& reference, const std::string& material) -> Result<Picture> {
    Result<Picture> picture;
    if (!reference.bytes.empty()) {
      picture = decode_picture(path, reference.bytes, ctx);
    } else {
      VOX_TRY(
          const std::string file,
          folder.find(reference.name, fmt::format("material {}: its texture", material), reference.library));
      if (file.empty())
        return bad_input(path, fmt::format("material {}: its texture {} is missing: expected it beside the "
                                           "mesh, or the file that names it",
                                           material, reference.name));
      picture = read_picture(file, ctx);
    }
    if (picture && (reference.base != 0 || reference.gain != 1))
      adjust_colors(*picture, reference.base, reference.gain);
    return picture;
  };
  // Embedded pictures have names of their own.
  const auto key_of = [](const PictureReference& r) {
    return r.used() ? fmt::format("{}\n{}\n{} {} {}", r.library, r.name, r.base, r.gain,
                                  static_cast<int>(r.channel))
                    : "";
  };
  std::map<std::pair<std::string, std::string>, int32_t> known;
  const auto picture_of = [&](const PictureReference& color, const PictureReference& opacity,
                              const std::string& material) -> Result<int32_t> {
    auto [at, is_new] = known.try_emplace({key_of(color), key_of(opacity)}, 0);
    if (!is_new) return at->second;
    Picture picture;
    if (color.used()) {
      VOX_TRY(picture, load(color, material));
    }
    if (opacity.used()) {
      VOX_TRY(const Picture mask, load(opacity, material));
      if (!color.used()) {
        VOX_TRY(picture, plain_picture(mask.width, mask.height, 0xffffffff, ctx));
      }
      set_opacity(picture, mask, opacity.channel);
    }
    at->second = static_cast<int32_t>(mesh.pictures.size());
    mesh.pictures.push_back(std::move(picture));
    return at->second;
  };
  int masks = 0;
  for (size_t i = 0; i < mesh.materials.size(); ++i) {
    const MeshParts::Maps& maps = parts.maps[i];
    MeshMaterial& material = mesh.materials[i];
    if (used[i] && (maps.color.used() || maps.opacity.used())) {
      VOX_TRY(material.picture, picture_of(maps.color, maps.opacity, material.name));
      if (maps.alpha_from_picture && mesh.pictures[static_cast<size_t>(material.picture)].has_alpha) {
        material.alpha_mode = AlphaMode::mask;
        ++masks;
      }
    }
    if (used[i] && maps.emission.used() && material.emits()) {
      VOX_TRY(material.emission_picture, picture_of(maps.emission, {}, material.name));
    }
    if (used[i] && maps.rm.used()) {
      VOX_TRY(material.rm_picture, picture_of(maps.rm, {}, material.name));
    }
  }
  if (masks)
    mesh.notes.push_back(
        fmt::format("opacity becomes yes or no: of {} materials whose textures have alpha", masks));
  return {};
}

Result<Mesh> read_mesh(const std::string& path, Context& ctx, const MeshOptions& options) {
  if (!is_mesh_name(path))
    return bad_input(path, "not a mesh: expected .obj, .gltf, .glb, .ply, .stl or .3ds");
  MeshFolder folder(path, options.allow_outside);
  VOX_TRY(MeshParts parts, read_parts(path, folder, ctx, options));
  VOX_CHECK(check_mesh(parts.mesh, path));
  VOX_CHECK(load_pictures(parts, path, folder, ctx));
  if (std::string note = folder.note(); !note.empty()) parts.mesh.notes.push_back(std::move(note));
  return std::move(parts.mesh);
}

}  // namespace voxkit
