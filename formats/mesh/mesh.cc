#include "formats/mesh/mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <utility>

#include "formats/mesh/mesh_module.h"
#include "formats/mesh/mesh_parts.h"
#include "formats/mesh/mesh_ply.h"
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

Result<MeshParts> read_parts(const std::string& path, Context& ctx) {
  if (has_ending(path, ".ply")) return read_ply(path, ctx);
  VOX_TRY(const ModuleTable* const module, load_module({"mesh", "reading this mesh", "libassimp-dev"}, path));
  return module->mesh->read(path, ctx);
}

}  // namespace

bool is_mesh_name(const std::string& name) {
  for (const char* ending : {".obj", ".gltf", ".glb", ".ply"})
    if (has_ending(name, ending)) return true;
  return false;
}

Status check_mesh(Mesh& mesh, const std::string& path) {
  const size_t vertices = mesh.positions.size();
  if ((!mesh.uvs.empty() && mesh.uvs.size() != vertices) ||
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
                                     "coordinates",
                                     i, p.x, p.y, p.z));
      if (!mesh.uvs.empty() && (!std::isfinite(mesh.uvs[v].x) || !std::isfinite(mesh.uvs[v].y)))
        return bad_input(path,
                         fmt::format("corrupt mesh: triangle {}: texture coordinates ({}, {}): expected "
                                     "finite ones",
                                     i, mesh.uvs[v].x, mesh.uvs[v].y));
    }
    const auto& [a, b, c] = triangle.vertices;
    if (has_area(mesh.positions[a], mesh.positions[b], mesh.positions[c])) mesh.triangles[kept++] = triangle;
  }
  mesh.triangles.resize(kept);
  for (glm::vec4& color : mesh.colors) bring_into_range(color);
  for (MeshMaterial& material : mesh.materials) {
    bring_into_range(material.color);
    material.alpha_cutoff = within_one(material.alpha_cutoff);
  }
  if (kept == 0)
    return bad_input(
        path, had_triangles ? "a mesh without triangles that have an area" : "a mesh without triangles");
  return {};
}

Status load_textures(MeshParts& parts, const std::string& path, Context& ctx) {
  Mesh& mesh = parts.mesh;
  std::vector<bool> used(mesh.materials.size());
  for (const MeshTriangle& triangle : mesh.triangles) used[triangle.material] = true;
  const std::string folder = std::filesystem::path(path).parent_path().string();

  const auto load = [&](const TextureReference& reference, const std::string& material) -> Result<Texture> {
    if (!reference.bytes.empty()) return decode_texture(path, reference.bytes, ctx);
    const std::string file = find_texture(folder, reference.name);
    if (file.empty())
      return bad_input(
          path, fmt::format("material {}: its texture {} is missing: expected it beside the mesh", material,
                            reference.name));
    return read_texture(file, ctx);
  };
  // Embedded textures have names of their own.
  std::map<std::pair<std::string, std::string>, int32_t> known;
  for (size_t i = 0; i < mesh.materials.size(); ++i) {
    const MeshParts::Maps& maps = parts.maps[i];
    MeshMaterial& material = mesh.materials[i];
    if (!used[i] || (!maps.color.used() && !maps.opacity.used())) continue;
    auto [at, is_new] = known.try_emplace({maps.color.name, maps.opacity.name}, 0);
    if (is_new) {
      Texture texture;
      if (maps.color.used()) {
        VOX_TRY(texture, load(maps.color, material.name));
      }
      if (maps.opacity.used()) {
        VOX_TRY(const Texture mask, load(maps.opacity, material.name));
        if (!maps.color.used()) {
          VOX_TRY(texture, plain_texture(mask.width, mask.height, 0xffffffff, ctx));
        }
        set_opacity(texture, mask);
      }
      at->second = static_cast<int32_t>(mesh.textures.size());
      mesh.textures.push_back(std::move(texture));
    }
    material.texture = at->second;
    if (maps.alpha_from_texture && mesh.textures[static_cast<size_t>(at->second)].has_alpha)
      material.alpha_mode = AlphaMode::mask;
  }
  return {};
}

Result<Mesh> read_mesh(const std::string& path, Context& ctx) {
  if (!is_mesh_name(path)) return bad_input(path, "not a mesh: expected .obj, .gltf, .glb or .ply");
  VOX_TRY(MeshParts parts, read_parts(path, ctx));
  VOX_CHECK(check_mesh(parts.mesh, path));
  VOX_CHECK(load_textures(parts, path, ctx));
  return std::move(parts.mesh);
}

}  // namespace voxkit
