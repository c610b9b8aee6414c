// What glTF files say, looked at before assimp trusts it, and what assimp leaves out.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "formats/context.h"
#include "formats/result.h"

namespace voxkit {

/// Where the base colour's texture lies on a mesh (KHR_texture_transform): of coordinates that count from the
/// top left.
struct UvTransform {
  std::array<double, 2> offset{0, 0}, scale{1, 1};
  double rotation = 0;  ///< counterclockwise as one looks at the texture, in radians
  int uv_channel = -1;  ///< which coordinates, where it is said
};

/// Checks a .gltf or .glb file (glTF 2.0): that its parts are in it, buffers of the length that is stated,
/// views in buffers and accessors in views, that nodes form a tree, and that no accessor makes zeros of
/// nothing beyond the memory limit. Returns the transforms of its materials, in their order. Errors:
/// ErrorCode::input, ErrorCode::limit.
Result<std::vector<UvTransform>> check_gltf(const std::string& path, const Context& ctx);

}  // namespace voxkit
