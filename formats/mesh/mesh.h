// Triangle meshes with colours: what is read from .obj, .gltf, .glb, .ply, .stl and .3ds files.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <optional>
#include <string>
#include <vector>

#include "formats/mesh/picture.h"
#include "formats/reservation.h"
#include "formats/volume.h"

namespace voxkit {

/// How a picture goes on outside of 0..1.
enum class PictureWrap : uint8_t { repeat, mirror, clamp };

/// What is seen between the middles of texels where these are larger than what looks.
enum class PictureFilter : uint8_t {
  linear,   ///< a mean of those around
  nearest,  ///< the nearest one
};

/// What the alpha of a material means.
enum class AlphaMode : uint8_t {
  opaque,  ///< nothing
  mask,    ///< there is a surface where alpha is at least the cut-off
  blend,   ///< how much of the surface is there
};

struct MeshMaterial {
  std::string name;
  glm::vec4 color{1, 1, 1, 1};  ///< linear light and alpha, 0..1; multiplies the picture
  int32_t picture = -1;         ///< index into Mesh::pictures, or -1
  PictureWrap wrap_u = PictureWrap::repeat, wrap_v = PictureWrap::repeat;
  PictureFilter filter = PictureFilter::linear;
  AlphaMode alpha_mode = AlphaMode::opaque;
  float alpha_cutoff = 0.5f;

  glm::vec3 emission{0, 0, 0};    ///< linear light, 0 or more; multiplies its picture
  int32_t emission_picture = -1;  ///< index into Mesh::pictures, or -1
  PictureWrap emission_wrap_u = PictureWrap::repeat, emission_wrap_v = PictureWrap::repeat;
  PictureFilter emission_filter = PictureFilter::linear;
  bool emits() const { return emission.r > 0 || emission.g > 0 || emission.b > 0; }

  /// 0..1; they multiply the green and the blue of their picture, which are no light. Of what says nothing: a
  /// dull material that is no metal.
  float roughness = 1, metalness = 0;
  int32_t rm_picture = -1;  ///< index into Mesh::pictures, or -1
  PictureWrap rm_wrap_u = PictureWrap::repeat, rm_wrap_v = PictureWrap::repeat;
  PictureFilter rm_filter = PictureFilter::linear;

  /// Which material of the file it is; not said: as it is counted by MeshBuilder.
  uint32_t number = UINT32_MAX;
};

struct MeshTriangle {
  std::array<uint32_t, 3> vertices{};
  uint32_t material = 0;
};

/// A vertex that is seen itself.
struct MeshPoint {
  uint32_t vertex = 0, material = 0;
};

/// A scene in one coordinate system. The memory counts against ctx.memory, which must outlive the mesh.
struct Mesh {
  std::vector<glm::dvec3> positions;  ///< finite; in the unit of the file
  /// Picture coordinates of the vertices, or none: (0, 0) is the top left corner of a picture, (1, 1) the
  /// bottom right one. Finite.
  std::vector<glm::vec2> uvs;
  std::vector<glm::vec2> emission_uvs;  ///< of emission pictures; none: these go by `uvs`, too
  std::vector<glm::vec2> rm_uvs;        ///< and of pictures of roughness and metalness
  std::vector<glm::vec3> normals;       ///< of the vertices, or none, finite; 0 where there is none
  std::vector<glm::vec4> colors;        ///< of the vertices, or none: linear light and alpha, 0..1
  std::vector<MeshTriangle> triangles;  ///< all of them have an area
  std::vector<MeshPoint> points;
  std::vector<MeshMaterial> materials;
  std::vector<Picture> pictures;
  /// The grid of voxels whose faces these are, as the file says (voxel_grid.h); in the mesh's coordinates.
  std::optional<VolumeInfo> grid;
  bool says_emission = false, says_rm = false;  ///< whether such files say what gives light, and roughness
  std::vector<std::string> notes;               ///< what the file says and the mesh cannot, a sentence each
  std::vector<Reservation> memory;
};

/// Whether a name ends like a mesh: .obj, .gltf, .glb, .ply, .stl or .3ds.
bool is_mesh_name(const std::string& name);

/// What a user allows a mesh to do, and what is wanted of it beside colours.
struct MeshOptions {
  bool allow_outside = false;  ///< to name files outside of its own folder
  bool normals = false;        ///< those of vertices
  bool rm = false;             ///< roughness and metalness
};

/// Reads a mesh: the triangles and points of all nodes of the scene in their places, polygons split, lines
/// left out, triangles without area dropped. Colours are taken as sRGB, those of glTF as
/// linear light, as their specifications or usual writers have it. Materials of .obj whose picture or
/// opacity map has alpha are masks with a cut-off of 0.5.
///
/// A .ply file without faces is no mesh but points (point_cloud.h): ErrorCode::input.
///
/// A picture, a material library or a buffer that the mesh names and that is not there is an error, since the
/// colours would be wrong in silence; so is one outside of its folder, unless options.allow_outside. Only
/// regular files are read. Errors: ErrorCode::input, ErrorCode::limit.
Result<Mesh> read_mesh(const std::string& path, Context& ctx, const MeshOptions& options = {});

}  // namespace voxkit
