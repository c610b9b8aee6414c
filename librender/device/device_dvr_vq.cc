// Direct volume rendering of VQ files on a device.
#include "librender/device/device_scene.h"
#include "librender/device/vq_flat_pools.h"

namespace voxkit::render {
namespace {

class VqScene final : public DeviceScene {
 public:
  using DeviceScene::DeviceScene;
  Status fill(Context& ctx) {
    const vq::Volume& volume = *scene().volume().vq();
    VOX_CHECK(volume.check(ctx));
    VOX_CHECK(DeviceScene::fill(ctx));
    VOX_TRY(chunks_, upload_chunks(volume, backend(), ctx));
    const Index3& dims = volume.info().dims;
    view_ = {volume.view(), chunks_.pools, code_values(volume), {dims.x, dims.y, dims.z}};
    return {};
  }
  Status draw(const Camera& camera, const DvrOptions& options, Frame& frame, Context& ctx) const override {
    return draw_with(view_, camera, options, frame, ctx);
  }

 private:
  FlatChunks chunks_;
  WarpVq<FlatVqPools> view_{};
};

}  // namespace

Result<std::unique_ptr<const DeviceDvr>> upload_vq(const DvrScene& scene,
                                                   std::shared_ptr<const Backend> backend, Context& ctx) {
  auto device = std::make_unique<VqScene>(scene, std::move(backend));
  VOX_CHECK(device->fill(ctx));
  return device;
}

}  // namespace voxkit::render
