// Where nothing was found to compile for a GPU with.
#include "librender/device/device_dvr.h"
#include "librender/device/device_grid.h"

namespace voxkit::render {

Result<std::unique_ptr<const DeviceDvr>> DeviceDvr::upload(const DvrScene&, Context&) {
  VOX_CHECK(check_device());
  return nullptr;
}

}  // namespace voxkit::render
