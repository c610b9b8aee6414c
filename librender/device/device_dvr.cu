// Direct volume rendering on a GPU: the kernel of warp_kernel.h over a launch grid.
#include "librender/device/device_dvr.h"
#include "librender/device/device_grid.h"
#include "librender/device/device_memory.h"
#include "librender/device/dvr_warp.h"
#include "librender/device/vq_flat_pools.h"
#include "librender/device/warp_kernel.h"
#include "librender/dvr/dvr_job.h"

namespace voxkit::render {
namespace {

constexpr int block_threads = warps_a_block * Warp::count;

template <DvrGradient kind, class View>
__global__ void __launch_bounds__(block_threads)
    dvr_kernel(const __grid_constant__ DvrParams params, const __grid_constant__ View view,
               WarpPicture picture) {
  __shared__ WarpCache caches[warps_a_block];
  const unsigned within = threadIdx.x / Warp::count;
  const int64_t warp = int64_t{blockIdx.x} * warps_a_block + within;
  if (warp >= warps_of(params.cast, Warp::width, Warp::height)) return;  // all threads of a warp, or none
  auto sampler = view.template sampler<Warp>(caches[within]);
  draw_warp<Warp, kind>(params, sampler, warp, picture);
}

/// A scene but for its voxels.
class DeviceScene : public DeviceDvr {
 public:
  static Status fill(const DvrScene& scene, DeviceScene& device) {
    device.scene_ = &scene;
    const auto& transfer = scene.transfer();
    VOX_TRY(device.table_, DeviceArray<TransferFunction::Entry>::allocate(TransferFunction::entries));
    VOX_CHECK(
        check(cudaMemcpy(device.table_.data(), transfer.table(),
                         TransferFunction::entries * sizeof(TransferFunction::Entry), cudaMemcpyHostToDevice),
              "uploading"));
    const auto map = scene.skips().bytes();
    VOX_TRY(device.map_, DeviceArray<uint8_t>::allocate(map.size()));
    return check(cudaMemcpy(device.map_.data(), map.data(), map.size(), cudaMemcpyHostToDevice), "uploading");
  }

 protected:
  template <class View>
  Status launch(const View& view, const Camera& camera, const DvrOptions& options, DvrFrame& frame,
                Context& ctx) const {
    VOX_TRY(DvrJob job, dvr_job(*scene_, camera, options));
    VOX_CHECK(begin_frame(job, frame, ctx));
    frame.seconds = 0;
    const CastParams& cast = job.params.cast;
    const int64_t warps = warps_of(cast, Warp::width, Warp::height);
    const auto width = static_cast<size_t>(std::max(cast.right - cast.left, 0)),
               height = static_cast<size_t>(std::max(cast.bottom - cast.top, 0));
    if (width * height == 0) return {};
    job.params.table = table_.data();
    if (job.params.distances != nullptr)
      job.params.distances = map_.data() + (scene_->skips().distances() - scene_->skips().bytes().data());
    VOX_TRY(const auto pixels, DeviceArray<Pixel>::allocate(width * height));
    VOX_TRY(const auto details, DeviceArray<PixelDetail>::allocate(width * height));
    VOX_TRY(const auto decoded, DeviceArray<uint32_t>::allocate(static_cast<uint64_t>(warps)));
    const WarpPicture picture{pixels.data(), details.data(), decoded.data()};
    VOX_TRY(const Events events, Events::create());
    const auto blocks = static_cast<unsigned>((warps + warps_a_block - 1) / warps_a_block);
    VOX_CHECK(events.record(0));
    switch (job.gradient) {
      case DvrGradient::none:
        dvr_kernel<DvrGradient::none><<<blocks, block_threads>>>(job.params, view, picture);
        break;
      case DvrGradient::analytic:
        dvr_kernel<DvrGradient::analytic><<<blocks, block_threads>>>(job.params, view, picture);
        break;
      default:
        dvr_kernel<DvrGradient::neighbour><<<blocks, block_threads>>>(job.params, view, picture);
    }
    VOX_CHECK(check(cudaGetLastError(), "launching"));
    VOX_CHECK(events.record(1));
    VOX_TRY(frame.seconds, events.seconds());

    const auto at =
        static_cast<size_t>(cast.top) * static_cast<size_t>(cast.width) + static_cast<size_t>(cast.left);
    const auto pitch = static_cast<size_t>(cast.width);
    VOX_CHECK(
        check(cudaMemcpy2D(frame.pixels.data() + at, pitch * sizeof(Pixel), pixels.data(),
                           width * sizeof(Pixel), width * sizeof(Pixel), height, cudaMemcpyDeviceToHost),
              "downloading"));
    std::vector<PixelDetail> seen(width * height);
    VOX_CHECK(check(
        cudaMemcpy(seen.data(), details.data(), seen.size() * sizeof(PixelDetail), cudaMemcpyDeviceToHost),
        "downloading"));
    std::vector<uint32_t> counts(static_cast<size_t>(warps));
    VOX_CHECK(check(
        cudaMemcpy(counts.data(), decoded.data(), counts.size() * sizeof(uint32_t), cudaMemcpyDeviceToHost),
        "downloading"));
    for (const uint32_t count : counts) frame.blocks_touched += count;
    for (size_t i = 0; i < seen.size(); ++i) {
      frame.samples += seen[i].cells;
      frame.rays_hit += seen[i].voxel[0] >= 0;
      if (job.details) frame.details[at + i / width * pitch + i % width] = seen[i];
    }
    return {};
  }

 private:
  const DvrScene* scene_ = nullptr;
  DeviceArray<TransferFunction::Entry> table_;
  DeviceArray<uint8_t> map_;
};

template <class T>
class DenseScene final : public DeviceScene {
 public:
  static Result<std::unique_ptr<const DeviceDvr>> upload(const DvrScene& scene) {
    auto device = std::make_unique<DenseScene>();
    VOX_CHECK(fill(scene, *device));
    const DenseView view = scene.volume().dense()->view();
    const Index3& dims = scene.volume().info().dims;
    const auto bytes = static_cast<uint64_t>(scene.volume().info().box().voxels() * view.bytes);
    VOX_TRY(device->voxels_, DeviceArray<std::byte>::allocate(bytes));
    VOX_CHECK(
        check(cudaMemcpy(device->voxels_.data(), view.voxels, bytes, cudaMemcpyHostToDevice), "uploading"));
    device->view_ = {device->voxels_.data(), {dims.x, dims.y, dims.z}};
    return std::unique_ptr<const DeviceDvr>(std::move(device));
  }
  Status draw(const Camera& camera, const DvrOptions& options, DvrFrame& frame, Context& ctx) const override {
    return this->launch(view_, camera, options, frame, ctx);
  }

 private:
  DeviceArray<std::byte> voxels_;
  WarpDense<T> view_{};
};

class VqScene final : public DeviceScene {
 public:
  static Result<std::unique_ptr<const DeviceDvr>> upload(const DvrScene& scene, Context& ctx) {
    const vq::Volume& volume = *scene.volume().vq();
    VOX_CHECK(volume.check(ctx));
    auto device = std::make_unique<VqScene>();
    VOX_CHECK(fill(scene, *device));
    const auto allocate = [&](uint64_t bytes) -> Result<std::byte*> {
      VOX_TRY(auto memory, DeviceArray<std::byte>::allocate(bytes));
      device->memory_.push_back(std::move(memory));
      return device->memory_.back().data();
    };
    const auto copy = [](std::byte* to, std::span<const std::byte> from) {
      return check(cudaMemcpy(to, from.data(), from.size(), cudaMemcpyHostToDevice), "uploading");
    };
    VOX_TRY(const FlatVqPools pools, flatten(volume, allocate, copy));
    const Index3& dims = volume.info().dims;
    device->view_ = {volume.view(), pools, code_values(volume), {dims.x, dims.y, dims.z}};
    return std::unique_ptr<const DeviceDvr>(std::move(device));
  }
  Status draw(const Camera& camera, const DvrOptions& options, DvrFrame& frame, Context& ctx) const override {
    return launch(view_, camera, options, frame, ctx);
  }

 private:
  std::vector<DeviceArray<std::byte>> memory_;
  WarpVq<FlatVqPools> view_{};
};

}  // namespace

Result<std::unique_ptr<const DeviceDvr>> DeviceDvr::upload(const DvrScene& scene, Context& ctx) {
  VOX_CHECK(check_device());
  const DvrVolume& volume = scene.volume();
  if (volume.svmm()) return bad_usage("--device cuda: an SVMM volume has to be decoded for --mode dvr");
  if (volume.vq()) return VqScene::upload(scene, ctx);
  if (!is_direct(volume.info()))
    return fail(ErrorCode::limit, {},
                "--device cuda: expected 2 or more voxels along each axis, and fewer than 2^31");
  switch (voxel_bytes(volume.info().format)) {
    case 1:
      return DenseScene<uint8_t>::upload(scene);
    case 2:
      return DenseScene<uint16_t>::upload(scene);
    default:
      return DenseScene<float>::upload(scene);
  }
}

}  // namespace voxkit::render
