// Where nothing was found to compile for a GPU with.
#include "librender/device/device_grid.h"

namespace voxkit::render {

Status check_device() {
  return fail(ErrorCode::device, {},
              "--device cuda: this build has no CUDA: nvcc was not found when it was configured");
}
Result<std::unique_ptr<const DeviceGrid>> DeviceGrid::upload(const DenseGrid&, Context&) {
  VOX_CHECK(check_device());
  return nullptr;
}
Result<std::unique_ptr<const DeviceGrid>> DeviceGrid::upload(const SvmmGrid&, Context&) {
  VOX_CHECK(check_device());
  return nullptr;
}
Result<std::unique_ptr<const DeviceGrid>> DeviceGrid::upload(const DagGrid&, Context&) {
  VOX_CHECK(check_device());
  return nullptr;
}

}  // namespace voxkit::render
