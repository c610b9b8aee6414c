// Direct volume rendering of uncompressed volumes on a device.
#include "librender/device/device_scene.h"

namespace voxkit::render {
namespace {

template <class T>
class DenseScene final : public DeviceScene {
 public:
  using DeviceScene::DeviceScene;
  Status fill(Context& ctx) {
    VOX_CHECK(DeviceScene::fill(ctx));
    const DenseView view = scene().volume().dense()->view();
    const Index3& dims = scene().volume().info().dims;
    const auto bytes = static_cast<size_t>(scene().volume().info().box().voxels() * view.bytes);
    VOX_TRY(voxels_,
            backend().upload(std::span(view.voxels, bytes + DenseView::read_slack), "the volume", ctx));
    view_ = {voxels_.data(), {dims.x, dims.y, dims.z}};
    return {};
  }
  Status draw(const Camera& camera, const DvrOptions& options, Frame& frame, Context& ctx) const override {
    return this->draw_with(view_, camera, options, frame, ctx);
  }

 private:
  DeviceArray<std::byte> voxels_;
  WarpDense<T> view_{};
};

template <class T>
Result<std::unique_ptr<const DeviceDvr>> upload_type(const DvrScene& scene,
                                                     std::shared_ptr<const Backend> backend, Context& ctx) {
  auto device = std::make_unique<DenseScene<T>>(scene, std::move(backend));
  VOX_CHECK(device->fill(ctx));
  return device;
}

}  // namespace

Result<std::unique_ptr<const DeviceDvr>> upload_dense(const DvrScene& scene,
                                                      std::shared_ptr<const Backend> backend, Context& ctx) {
  const VolumeInfo& info = scene.volume().info();
  if (!is_direct(info))
    return fail(ErrorCode::limit, {},
                "--device cuda: expected 2 or more voxels along each axis, and fewer than 2^31");
  switch (voxel_bytes(info.format)) {
    case 1:
      return upload_type<uint8_t>(scene, std::move(backend), ctx);
    case 2:
      return upload_type<uint16_t>(scene, std::move(backend), ctx);
    default:
      return upload_type<float>(scene, std::move(backend), ctx);
  }
}

}  // namespace voxkit::render
