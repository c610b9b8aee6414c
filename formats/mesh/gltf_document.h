// What the text of a glTF 2.0 file says (Khronos, "glTF 2.0 Specification"), every number in it checked:
// lists are as long as what refers to them needs, and ranges are within what they are ranges of.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/context.h"
#include "formats/mesh/mesh.h"
#include "formats/mesh/mesh_module.h"
#include "formats/mesh/placement.h"

namespace voxkit::gltf {

/// Of a number that refers to nothing.
inline constexpr uint32_t none = UINT32_MAX;

/// componentType of accessors.
enum class Component : uint16_t { i8 = 5120, u8, i16, u16, u32 = 5125, f32 = 5126 };
constexpr uint64_t bytes_of(Component c) {
  return c == Component::i8 || c == Component::u8 ? 1 : c == Component::i16 || c == Component::u16 ? 2 : 4;
}

struct Buffer {
  std::optional<std::string> uri;  ///< none: the file's own bytes, or a fallback that is not there
  uint64_t length = 0;
};
/// Of EXT_meshopt_compression: the bytes that the view is made of.
struct PackedView {
  uint32_t buffer = 0;
  uint64_t offset = 0, length = 0;
  MeshoptView how;
};
struct View {
  uint32_t buffer = 0;
  uint64_t offset = 0, length = 0, stride = 0;  ///< stride 0: without gaps
  std::optional<PackedView> packed;
};

struct Accessor {
  struct Values {
    uint32_t view = none;  ///< none: zeros
    uint64_t offset = 0;
    Component component = Component::f32;
  };
  Values values;
  uint64_t count = 0;
  uint32_t components = 1, rows = 1;  ///< of a matrix: its rows; columns begin at multiples of 4 bytes
  bool normalized = false;
  struct Sparse {
    uint64_t count = 0;
    Values indices, values;
  };
  std::optional<Sparse> sparse;
  /// Bytes of an element.
  uint64_t element_bytes() const {
    const uint64_t column = rows * bytes_of(values.component);
    return components == rows ? column : components / rows * ((column + 3) / 4 * 4);
  }
};

struct Image {
  std::string uri;
  uint32_t view = none;
};
struct Sampler {
  PictureWrap wrap_u = PictureWrap::repeat, wrap_v = PictureWrap::repeat;
  PictureFilter filter = PictureFilter::linear;
};
struct Picture {
  uint32_t image = none, webp = none;
  Sampler sampler;
};
/// How a material uses a picture; (u, v) goes to row 0 and row 1 of `transform`.
struct PictureInfo {
  uint32_t picture = none, channel = 0;
  std::optional<std::array<std::array<double, 3>, 2>> transform;
};
struct Material {
  MeshMaterial material;
  PictureInfo color, emission, rm;
};

using Attributes = std::map<std::string, uint32_t>;  ///< accessors by name
struct Primitive {
  Attributes attributes;
  std::vector<Attributes> targets;
  uint32_t indices = none, material = none, mode = 4;
  struct Draco {
    uint32_t view = 0;
    Attributes ids;
  };
  std::optional<Draco> draco;
};
struct Mesh {
  std::vector<Primitive> primitives;
  std::vector<double> weights;
};

/// Of a translation, a rotation as a quaternion x, y, z, w of any length, and a scale.
Placement placement_of(const glm::dvec3& translation, const std::array<double, 4>& rotation,
                       const glm::dvec3& scale);

struct Node {
  Placement local;
  std::vector<uint32_t> children;
  uint32_t mesh = none, skin = none;
  std::vector<double> weights;
  struct Instances {
    uint32_t translation = none, rotation = none, scale = none;
  };
  std::optional<Instances> instances;  ///< EXT_mesh_gpu_instancing
  std::optional<VolumeInfo> grid;      ///< of voxels, in the node's coordinates: voxel_grid.h, in extras
};
struct Skin {
  std::vector<uint32_t> joints;
  uint32_t inverse_bind = none;
};

struct Document {
  std::vector<Buffer> buffers;
  std::vector<View> views;
  std::vector<Accessor> accessors;
  std::vector<Image> images;
  std::vector<Picture> pictures;
  std::vector<Material> materials;
  std::vector<Mesh> meshes;
  std::vector<Node> nodes;  ///< trees: no node is below itself, or below two others
  std::vector<Skin> skins;
  std::vector<uint32_t> roots;     ///< of the scene
  std::vector<std::string> notes;  ///< what of the file is left out
  Reservation memory;              ///< of its texts
};

/// Reads the text. `own_bytes`: how many bytes of buffers are in the file itself. Errors: ErrorCode::input
/// with what is wrong, also for a glTF of another version and for an extension that is required and not
/// known; ErrorCode::limit. `rm`: roughness and metalness are wanted.
Result<Document> read_document(std::string_view text, std::optional<uint64_t> own_bytes,
                               const std::string& path, Context& ctx, bool rm = false);

}  // namespace voxkit::gltf
