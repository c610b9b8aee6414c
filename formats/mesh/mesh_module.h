// What modules offer that unpack parts of meshes: webp.so, meshopt.so and draco.so, one function each.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/mesh/picture.h"
#include "formats/module.h"

namespace voxkit {

/// What EXT_meshopt_compression of glTF says of a buffer view.
struct MeshoptView {
  enum class Mode : uint8_t { attributes, triangles, indices };
  enum class Filter : uint8_t { none, octahedral, quaternion, exponential };
  Mode mode = Mode::attributes;
  Filter filter = Filter::none;
  uint64_t count = 0, stride = 0;  ///< what comes of it; the bytes of these are in memory
};

/// Triangles and attributes of KHR_draco_mesh_compression of glTF.
struct DracoMesh {
  std::vector<uint32_t> indices;  ///< three a triangle, below `points`
  uint64_t points = 0;
  std::vector<std::vector<float>> attributes;  ///< as asked for, in the order of the points
};
struct DracoAttribute {
  uint32_t id = 0;
  uint32_t components = 1;
};

struct MeshModule {
  Result<Picture> (*decode_webp)(const std::string& name, std::span<const std::byte> bytes,
                                 Context& ctx) = nullptr;
  /// False where the bytes are damaged. `out` has count * stride bytes.
  bool (*decode_meshopt)(const MeshoptView& view, std::span<const std::byte> bytes,
                         std::span<std::byte> out) = nullptr;
  /// Whole numbers as they are stored. ErrorCode::input without a file where the bytes are damaged, or have
  /// another number of points or triangles than is expected.
  Result<DracoMesh> (*decode_draco)(std::span<const std::byte> bytes,
                                    std::span<const DracoAttribute> attributes, uint64_t points,
                                    uint64_t triangles, Context& ctx) = nullptr;
};

}  // namespace voxkit
