// The vertices of a primitive of a glTF file, as its morph weights have them.
#pragma once

#include <span>
#include <vector>

#include "formats/mesh/gltf_buffers.h"

namespace voxkit::gltf {

struct Geometry {
  std::vector<glm::dvec3> positions;
  std::vector<glm::vec2> uvs, emission_uvs, rm_uvs;  ///< or none; those of others only where they differ
  std::vector<glm::vec4> colors;                     ///< or none
  std::vector<glm::dvec3> normals;                   ///< or none
  std::vector<uint32_t> corners;  ///< numbers of positions, as the primitive's mode has them
  /// Of a skin: joints and weights, four each, of all sets.
  std::vector<Values<float>> joints, weights;
  bool lacks_uvs = false;  ///< that the material's pictures need
  std::vector<Reservation> memory;
};

/// Reads a primitive. `weights` are of its targets, 0 where there are fewer. `skinned`: with joints and
/// weights. `normals`: with normals. Errors: ErrorCode::input, ErrorCode::limit.
Result<Geometry> read_primitive(const Document& document, Buffers& buffers, const Primitive& primitive,
                                std::span<const double> weights, bool skinned, bool normals,
                                const std::string& path, Context& ctx);

}  // namespace voxkit::gltf
