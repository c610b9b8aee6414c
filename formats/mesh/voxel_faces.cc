#include "formats/mesh/voxel_faces.h"

#include "formats/image/coded_image.h"
#include "formats/mesh/face_files.h"
#include "formats/names.h"

namespace voxkit {

std::array<std::array<int32_t, 3>, 4> corners_of(const FaceRectangle& face) {
  const size_t w = face.axis, u = (w + 1) % 3, v = (w + 2) % 3;
  std::array<std::array<int32_t, 3>, 4> corners{};
  for (size_t i = 0; i < 4; ++i) {
    // Around: lo lo, hi lo, hi hi, lo hi; for who looks from the other side the other way round.
    const bool far_u = i == 1 || i == 2, far_v = i >= 2;
    auto& corner = corners[face.positive ? i : 3 - i];
    corner[w] = face.plane;
    corner[u] = far_u ? face.hi[0] : face.lo[0];
    corner[v] = far_v ? face.hi[1] : face.lo[1];
  }
  return corners;
}

bool is_face_output(const std::string& name) {
  return has_ending(name, ".glb") || has_ending(name, ".obj");
}

std::vector<std::string> files_of_faces(const std::string& name) {
  std::vector<std::string> names{name};
  if (!has_ending(name, ".obj")) return names;
  const std::string stem = name.substr(0, name.size() - 4);
  names.push_back(stem + ".mtl");
  names.push_back(stem + ".png");
  return names;
}

Result<std::unique_ptr<FaceWriter>> create_faces(const std::string& path, const VolumeInfo& info, bool force,
                                                 Context& ctx) {
  VOX_CHECK(image_encoder_support(ImageFormat::png, {}));
  if (has_ending(path, ".glb")) return create_glb_faces(path, info, force, ctx);
  if (has_ending(path, ".obj")) return create_obj_faces(path, info, force, ctx);
  return fail(ErrorCode::usage, path, "no mesh that voxels can be written as: expected .glb or .obj");
}

}  // namespace voxkit
