// Meshes by assimp: .obj, .gltf and .glb files.
#include <assimp/BaseImporter.h>
#include <assimp/GltfMaterial.h>
#include <assimp/config.h>
#include <assimp/importerdesc.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstring>
#include <glm/mat3x3.hpp>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "formats/mesh/mesh_gltf.h"
#include "formats/mesh/mesh_io.h"
#include "formats/mesh/mesh_module.h"
#include "formats/mesh/mesh_parts.h"
#include "formats/names.h"

namespace voxkit {
namespace {

/// How a kind of file means its numbers.
struct Conventions {
  bool linear_colors = false;       ///< of materials and vertices; else sRGB
  bool alpha_from_texture = false;  ///< without being told
};

/// From sRGB, 0..1; what is outside stays for check_mesh to judge.
float to_linear(float stored) {
  if (!(stored > 0.04045f)) return stored / 12.92f;
  return static_cast<float>(std::pow((static_cast<double>(stored) + 0.055) / 1.055, 2.4));
}

glm::vec4 color_of(const aiColor4D& c, const Conventions& use) {
  return use.linear_colors ? glm::vec4(c.r, c.g, c.b, c.a)
                           : glm::vec4(to_linear(c.r), to_linear(c.g), to_linear(c.b), c.a);
}

/// A mesh of the scene in its place.
struct Placed {
  const aiMesh* mesh;
  glm::dmat3 linear;
  glm::dvec3 shift;
};

/// Deeper trees are not made by people; their walk would need a deep stack nowhere here, but in the library.
constexpr size_t most_nodes = size_t{1} << 22;

Result<std::vector<Placed>> place_meshes(const aiScene& scene, const std::string& path) {
  struct Visit {
    const aiNode* node;
    glm::dmat3 linear;
    glm::dvec3 shift;
  };
  std::vector<Placed> placed;
  std::vector<Visit> stack{{scene.mRootNode, glm::dmat3(1), glm::dvec3(0)}};
  size_t nodes = 0;
  while (!stack.empty()) {
    const Visit parent = stack.back();
    stack.pop_back();
    if (++nodes > most_nodes)
      return bad_input(path, fmt::format("a scene of more than {} nodes", most_nodes));
    const aiMatrix4x4& m = parent.node->mTransformation;
    glm::dmat3 local;  // columns
    local[0] = {m.a1, m.b1, m.c1};
    local[1] = {m.a2, m.b2, m.c2};
    local[2] = {m.a3, m.b3, m.c3};
    const glm::dmat3 linear = parent.linear * local;
    const glm::dvec3 shift = parent.linear * glm::dvec3(m.a4, m.b4, m.c4) + parent.shift;
    for (unsigned i = 0; i < parent.node->mNumMeshes; ++i) {
      const unsigned index = parent.node->mMeshes[i];
      if (index >= scene.mNumMeshes)
        return bad_input(path, "corrupt mesh: a node of a mesh that is not there");
      placed.push_back({scene.mMeshes[index], linear, shift});
    }
    // From last to first, so that they come from first to last.
    for (unsigned i = parent.node->mNumChildren; i-- > 0;)
      stack.push_back({parent.node->mChildren[i], linear, shift});
  }
  return placed;
}

TextureWrap wrap_of(const aiMaterial& material, aiTextureType type, bool u) {
  int mode = aiTextureMapMode_Wrap;
  if (u)
    material.Get(AI_MATKEY_MAPPINGMODE_U(type, 0), mode);
  else
    material.Get(AI_MATKEY_MAPPINGMODE_V(type, 0), mode);
  return mode == aiTextureMapMode_Clamp    ? TextureWrap::clamp
         : mode == aiTextureMapMode_Mirror ? TextureWrap::mirror
                                           : TextureWrap::repeat;
}

/// The first texture of a type that the material has.
Result<TextureReference> texture_of(const aiScene& scene, const aiMaterial& material, aiTextureType type,
                                    const std::string& path) {
  TextureReference reference;
  aiString name;
  if (material.Get(AI_MATKEY_TEXTURE(type, 0), name) != aiReturn_SUCCESS || name.length == 0)
    return reference;
  reference.name = name.C_Str();
  const auto [texture, index] = scene.GetEmbeddedTextureAndIndex(name.C_Str());
  if (!texture) return reference;
  if (texture->mHeight != 0)
    return bad_input(path, "an embedded texture of plain texels: expected PNG or JPEG");
  const auto* bytes = reinterpret_cast<const std::byte*>(texture->pcData);
  reference.bytes.assign(bytes, bytes + texture->mWidth);
  reference.name = fmt::format("*{}", index);
  if (reference.bytes.empty()) return bad_input(path, "an embedded texture without bytes");
  return reference;
}

/// A material, its maps, and the channel of texture coordinates that they use.
struct ReadMaterial {
  MeshMaterial material;
  MeshParts::Maps maps;
  unsigned uv_channel = 0;
  std::optional<UvTransform> transform;
};

Result<ReadMaterial> read_material(const aiScene& scene, const aiMaterial& in, const Conventions& use,
                                   const std::string& path) {
  ReadMaterial out;
  MeshMaterial& material = out.material;
  if (aiString name; in.Get(AI_MATKEY_NAME, name) == aiReturn_SUCCESS) material.name = name.C_Str();
  // A mesh without materials is white; assimp's stand-in for one is grey.
  const bool is_default = material.name == AI_DEFAULT_MATERIAL_NAME;
  aiColor4D color(1, 1, 1, 1);
  if (!is_default && in.Get(AI_MATKEY_BASE_COLOR, color) != aiReturn_SUCCESS)
    in.Get(AI_MATKEY_COLOR_DIFFUSE, color);
  material.color = color_of(color, use);
  if (float opacity = 1; !use.linear_colors && in.Get(AI_MATKEY_OPACITY, opacity) == aiReturn_SUCCESS) {
    material.color.a = opacity;
    if (opacity < 1) material.alpha_mode = AlphaMode::blend;
  }
  if (aiString mode; in.Get(AI_MATKEY_GLTF_ALPHAMODE, mode) == aiReturn_SUCCESS) {
    if (std::string_view(mode.C_Str()) == "MASK") material.alpha_mode = AlphaMode::mask;
    if (std::string_view(mode.C_Str()) == "BLEND") material.alpha_mode = AlphaMode::blend;
    in.Get(AI_MATKEY_GLTF_ALPHACUTOFF, material.alpha_cutoff);
  }
  const aiTextureType type =
      in.GetTextureCount(aiTextureType_BASE_COLOR) ? aiTextureType_BASE_COLOR : aiTextureType_DIFFUSE;
  VOX_TRY(out.maps.color, texture_of(scene, in, type, path));
  if (use.alpha_from_texture) {
    VOX_TRY(out.maps.opacity, texture_of(scene, in, aiTextureType_OPACITY, path));
  }
  out.maps.alpha_from_texture = use.alpha_from_texture;
  material.wrap_u = wrap_of(in, type, true);
  material.wrap_v = wrap_of(in, type, false);
  if (int channel = 0; in.Get(AI_MATKEY_UVWSRC(type, 0), channel) == aiReturn_SUCCESS && channel > 0)
    out.uv_channel = static_cast<unsigned>(channel);
  return out;
}

/// Texture coordinates from the top left, turned about there.
glm::vec2 transformed(glm::dvec2 uv, const std::optional<UvTransform>& transform) {
  if (!transform) return uv;
  const double c = std::cos(transform->rotation), s = std::sin(transform->rotation);
  uv *= glm::dvec2(transform->scale[0], transform->scale[1]);
  return glm::dvec2(c * uv.x + s * uv.y + transform->offset[0], c * uv.y - s * uv.x + transform->offset[1]);
}

Status append(const Placed& placed, const ReadMaterial& material, const Conventions& use,
              const std::string& path, Mesh& out) {
  const aiMesh& in = *placed.mesh;
  const auto first = static_cast<uint32_t>(out.positions.size());
  for (unsigned i = 0; i < in.mNumVertices; ++i) {
    const aiVector3D& p = in.mVertices[i];
    out.positions.push_back(placed.linear * glm::dvec3(p.x, p.y, p.z) + placed.shift);
  }
  unsigned uv_channel = material.uv_channel;
  if (uv_channel >= AI_MAX_NUMBER_OF_TEXTURECOORDS || !in.HasTextureCoords(uv_channel)) uv_channel = 0;
  if (in.HasTextureCoords(uv_channel)) {
    out.uvs.resize(first);
    for (unsigned i = 0; i < in.mNumVertices; ++i) {
      const aiVector3D& uv = in.mTextureCoords[uv_channel][i];
      // assimp counts from the bottom, whatever the file does.
      out.uvs.push_back(transformed({uv.x, 1 - uv.y}, material.transform));
    }
  }
  if (in.HasVertexColors(0)) {
    // assimp leaves alpha at 0 where a glTF file has colours without it.
    const aiColor4D *colors = in.mColors[0], *end = colors + in.mNumVertices;
    const bool has_alpha = std::any_of(colors, end, [](const aiColor4D& c) { return c.a != 0; });
    out.colors.resize(first, glm::vec4(1));
    for (; colors != end; ++colors) {
      out.colors.push_back(color_of(*colors, use));
      if (!has_alpha) out.colors.back().a = 1;
    }
  }
  for (unsigned i = 0; i < in.mNumFaces; ++i) {
    const aiFace& face = in.mFaces[i];
    if (face.mNumIndices != 3) continue;  // points and lines
    MeshTriangle triangle;
    for (size_t corner = 0; corner < 3; ++corner) {
      const unsigned index = face.mIndices[corner];
      if (index >= in.mNumVertices)
        return bad_input(
            path, fmt::format("corrupt mesh: vertex {}: expected one below {}", index, in.mNumVertices));
      triangle.vertices[corner] = first + index;
    }
    triangle.material = in.mMaterialIndex;
    out.triangles.push_back(triangle);
  }
  return {};
}

/// `transforms` are of the first materials.
Result<MeshParts> convert(const aiScene& scene, const Conventions& use,
                          const std::vector<UvTransform>& transforms, const std::string& path, Context& ctx) {
  MeshParts parts;
  VOX_TRY(const auto placed, place_meshes(scene, path));
  uint64_t vertices = 0, triangles = 0;
  bool has_uvs = false, has_colors = false;
  for (const Placed& p : placed) {
    vertices += p.mesh->mNumVertices;
    triangles += p.mesh->mNumFaces;
    for (unsigned channel = 0; channel < AI_MAX_NUMBER_OF_TEXTURECOORDS; ++channel)
      has_uvs |= p.mesh->HasTextureCoords(channel);
    has_colors |= p.mesh->HasVertexColors(0);
  }
  if (vertices > UINT32_MAX)
    return bad_input(path, fmt::format("a mesh of {} vertices: expected less than 2^32", vertices));
  Mesh& mesh = parts.mesh;
  const uint64_t vertex_bytes =
      sizeof(glm::dvec3) + has_uvs * sizeof(glm::vec2) + has_colors * sizeof(glm::vec4);
  VOX_TRY(Reservation memory,
          Reservation::take(vertices * vertex_bytes + triangles * sizeof(MeshTriangle), "the mesh", ctx));
  mesh.memory.push_back(std::move(memory));
  mesh.positions.reserve(vertices);
  if (has_uvs) mesh.uvs.reserve(vertices);
  if (has_colors) mesh.colors.reserve(vertices);
  mesh.triangles.reserve(triangles);

  std::vector<ReadMaterial> materials;
  for (unsigned i = 0; i < scene.mNumMaterials; ++i) {
    VOX_TRY(ReadMaterial read, read_material(scene, *scene.mMaterials[i], use, path));
    if (i < transforms.size()) {
      read.transform = transforms[i];
      if (transforms[i].uv_channel >= 0) read.uv_channel = static_cast<unsigned>(transforms[i].uv_channel);
    }
    mesh.materials.push_back(read.material);
    parts.maps.push_back(std::move(read.maps));
    materials.push_back(std::move(read));
  }
  for (const Placed& p : placed) {
    if (p.mesh->mMaterialIndex >= materials.size())
      return bad_input(path, "corrupt mesh: a material that is not there");
    VOX_CHECK(append(p, materials[p.mesh->mMaterialIndex], use, path, mesh));
  }
  if (has_uvs) mesh.uvs.resize(vertices);
  if (has_colors) mesh.colors.resize(vertices, glm::vec4(1));
  return parts;
}

/// The first line of what assimp says.
std::string reason(const char* text) {
  const std::string line =
      text ? std::string(text).substr(0, std::string_view(text).find('\n')) : std::string();
  return line.empty() ? "assimp cannot read it" : line.substr(0, 200);
}

/// Leaves assimp the readers of our formats: others would be tried on files whose start looks like theirs.
void keep_readers(Assimp::Importer& importer) {
  for (size_t i = importer.GetImporterCount(); i-- > 0;) {
    const aiImporterDesc* about = importer.GetImporterInfo(i);
    const std::string_view endings = about && about->mFileExtensions ? about->mFileExtensions : "";
    if (endings == "obj" || endings == "gltf glb") continue;
    const std::unique_ptr<Assimp::BaseImporter> reader(importer.GetImporter(i));  // ours from here on
    importer.UnregisterLoader(reader.get());
  }
}

Result<MeshParts> read(const std::string& path, Context& ctx) {
  std::vector<UvTransform> transforms;
  if (!has_ending(path, ".obj")) {
    VOX_TRY(transforms, check_gltf(path, ctx));
  }
  MeshFiles files(ctx);
  Assimp::Importer importer;
  keep_readers(importer);
  importer.SetIOHandler(mesh_io(path, files));
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene = importer.ReadFile(path, aiProcess_Triangulate | aiProcess_SortByPType);
  VOX_CHECK(files.status);
  const Conventions use{.linear_colors = !has_ending(path, ".obj"),
                        .alpha_from_texture = has_ending(path, ".obj")};
  // assimp goes on without a material library, but tries the mesh's name with the ending .mtl first.
  const auto is_library = [](const std::string& name) { return has_ending(name, ".mtl"); };
  const bool has_library = std::any_of(files.opened.begin(), files.opened.end(), is_library);
  for (const std::string& name : files.missing)
    if (!scene || (is_library(name) && !has_library))
      return bad_input(path,
                       fmt::format("{} is missing, which the mesh needs", name.substr(name.rfind('/') + 1)));
  if (!scene || !scene->mRootNode)
    return bad_input(path, "cannot read the mesh: " + reason(importer.GetErrorString()));
  return convert(*scene, use, transforms, path, ctx);
}

Result<MeshParts> read_file(const std::string& path, Context& ctx) {
  try {
    return read(path, ctx);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, path, "not enough memory to read the mesh");
  } catch (const std::exception& error) {
    return bad_input(path, "cannot read the mesh: " + reason(error.what()));
  }
}

const MeshModule meshes{.read = read_file};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.mesh = &voxkit::meshes)
