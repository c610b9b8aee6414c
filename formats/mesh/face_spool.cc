#include "formats/mesh/face_spool.h"

#include <algorithm>
#include <cstring>

namespace voxkit {
namespace {

static_assert(sizeof(FaceRectangle) == 28 && std::is_trivially_copyable_v<FaceRectangle>);
static_assert(sizeof(ModelVoxel) == 16 && std::is_trivially_copyable_v<ModelVoxel>);

template <class T>
Status each(const MappedFile& file, const std::function<Status(std::span<const T>)>& take) {
  constexpr size_t at_once = 1 << 16;
  std::vector<T> run;
  for (std::span<const std::byte> left = file.bytes(); !left.empty();) {
    VOX_CHECK(check_interrupt());
    const auto bytes = left.first(std::min(left.size(), at_once * sizeof(T)));
    run.resize(bytes.size() / sizeof(T));
    std::memcpy(run.data(), bytes.data(), bytes.size());
    VOX_CHECK(take(run));
    release_bytes(bytes);
    left = left.subspan(bytes.size());
  }
  return {};
}

}  // namespace

Status FaceSpool::add(std::span<const FaceRectangle> faces) {
  for (const FaceRectangle& face : faces) palette_.add(face.color);
  faces_ += faces.size();
  return face_file_.write(std::as_bytes(faces));
}

Status FaceSpool::add_enclosed(std::span<const ModelVoxel> voxels) {
  for (const ModelVoxel& voxel : voxels) palette_.add(voxel.color);
  enclosed_ += voxels.size();
  return enclosed_file_.write(std::as_bytes(voxels));
}

Status FaceSpool::close() {
  palette_.arrange();
  VOX_TRY(face_bytes_, face_file_.map());
  VOX_TRY(enclosed_bytes_, enclosed_file_.map());
  return {};
}

Status FaceSpool::each_face(const std::function<Status(std::span<const FaceRectangle>)>& take) const {
  return each<FaceRectangle>(*face_bytes_, take);
}
Status FaceSpool::each_enclosed(const std::function<Status(std::span<const ModelVoxel>)>& take) const {
  return each<ModelVoxel>(*enclosed_bytes_, take);
}

}  // namespace voxkit
