// Casting on a GPU: the kernel of cast_kernel.h over a launch grid.
#include <algorithm>
#include <vector>

#include "libcolor/store.h"
#include "librender/cast/cast_params.h"
#include "librender/cast/surface_colors.h"
#include "librender/device/device_grid.h"
#include "librender/device/device_memory.h"
#include "librender/device/flat_pools.h"

namespace voxkit::render {
namespace {

template <class View>
__global__ void __launch_bounds__(block_width* block_height)
    cast_kernel(const __grid_constant__ CastParams params, View view, Pixel* pixels, PixelDetail* details,
                PixelCost* costs) {
  cast_pixel(params, view, {blockIdx.x, blockIdx.y, threadIdx.x, threadIdx.y}, pixels, details, costs);
}

template <class View>
Status launch(const View& view, const VolumeInfo& info, const Camera& camera, const CastOptions& options,
              Frame& frame) {
  VOX_TRY(const CastParams params, cast_params(info, camera, options));
  const size_t count = static_cast<size_t>(options.width) * static_cast<size_t>(options.height);
  VOX_TRY(const auto pixels, DeviceArray<Pixel>::allocate(count));
  VOX_TRY(const auto details, DeviceArray<PixelDetail>::allocate(count));
  VOX_TRY(const auto costs, DeviceArray<PixelCost>::allocate(count));
  VOX_TRY(const Events events, Events::create());
  const dim3 blocks(static_cast<unsigned>((options.width + block_width - 1) / block_width),
                    static_cast<unsigned>((options.height + block_height - 1) / block_height));
  VOX_CHECK(events.record(0));
  cast_kernel<<<blocks, dim3(block_width, block_height)>>>(params, view, pixels.data(), details.data(),
                                                           costs.data());
  VOX_CHECK(check(cudaGetLastError(), "launching"));
  VOX_CHECK(events.record(1));
  VOX_TRY(frame.seconds, events.seconds());

  frame.width = options.width;
  frame.height = options.height;
  frame.pixels.resize(count);
  frame.details.resize(count);
  std::vector<PixelCost> cost(count);
  VOX_CHECK(check(cudaMemcpy(frame.pixels.data(), pixels.data(), count * sizeof(Pixel), cudaMemcpyDefault),
                  "downloading"));
  VOX_CHECK(
      check(cudaMemcpy(frame.details.data(), details.data(), count * sizeof(PixelDetail), cudaMemcpyDefault),
            "downloading"));
  VOX_CHECK(check(cudaMemcpy(cost.data(), costs.data(), count * sizeof(PixelCost), cudaMemcpyDefault),
                  "downloading"));
  add_up(cost, frame);
  if (!options.details) frame.details.clear();
  return {};
}

class DeviceDense final : public DeviceGrid {
 public:
  VolumeInfo info;
  DenseView view{};
  DeviceArray<std::byte> voxels;

  Status cast(const Camera& camera, const CastOptions& options, Frame& frame, Context&) const override {
    if (options.traversal == Traversal::baseline)
      return launch(BaselineView{view}, info, camera, options, frame);
    return launch(view, info, camera, options, frame);
  }
};

class DeviceSvmm final : public DeviceGrid {
 public:
  VolumeInfo info;
  std::vector<DeviceArray<std::byte>> levels;
  DeviceArray<svmm::View> view;
  DeviceArray<svmm::FlatPools> pools;

  Status cast(const Camera& camera, const CastOptions& options, Frame& frame, Context&) const override {
    using svmm::FlatPools;
    switch (options.traversal) {
      case Traversal::path:
        return launch(SvmmView<FlatPools, Search::path>{view.data(), pools.data()}, info, camera, options,
                      frame);
      case Traversal::restart:
        return launch(SvmmView<FlatPools, Search::restart>{view.data(), pools.data()}, info, camera, options,
                      frame);
      default:
        return only_dense_has_baseline();
    }
  }
};

class DeviceDag final : public DeviceGrid {
 public:
  explicit DeviceDag(const DagGrid& dag) : grid(dag) {}
  DagGrid grid;
  DeviceArray<uint64_t> leaves;
  std::vector<DeviceArray<uint32_t>> nodes;
  DeviceArray<color::DagView> view;

  Status cast(const Camera& camera, const CastOptions& options, Frame& frame, Context& ctx) const override {
    if (options.traversal == Traversal::baseline) return only_dense_has_baseline();
    CastOptions detailed = options;
    detailed.details = true;  // where to look colours up
    if (options.traversal == Traversal::restart)
      VOX_CHECK(launch(DagCastView<Search::restart>{view.data()}, grid.info(), camera, detailed, frame));
    else
      VOX_CHECK(launch(DagCastView<Search::path>{view.data()}, grid.info(), camera, detailed, frame));
    VOX_CHECK(look_up_colors(grid.volume(), frame, ctx));
    if (!options.details) frame.details.clear();
    return {};
  }
};

/// `count` words on the device.
template <class Word>
Result<DeviceArray<Word>> uploaded(const Word* words, uint64_t count) {
  VOX_TRY(auto array, DeviceArray<Word>::allocate(std::max<uint64_t>(1, count)));
  VOX_CHECK(
      check(cudaMemcpy(array.data(), words, count * sizeof(Word), cudaMemcpyHostToDevice), "uploading"));
  return array;
}

}  // namespace

Status check_device() {
  int count = 0;
  const cudaError_t error = cudaGetDeviceCount(&count);
  if (error != cudaSuccess)
    return fail(ErrorCode::device, {},
                std::string("--device cuda: no GPU can be used: ") + cudaGetErrorString(error) +
                    ": expected a CUDA device and its driver");
  if (count == 0)
    return fail(ErrorCode::device, {}, "--device cuda: there is no GPU: expected a CUDA device");
  return {};
}

Result<std::unique_ptr<const DeviceGrid>> DeviceGrid::upload(const DenseGrid& grid, Context&) {
  VOX_CHECK(check_device());
  auto device = std::make_unique<DeviceDense>();
  device->info = grid.info();
  const DenseView host = grid.view();
  const auto bytes = static_cast<uint64_t>(grid.info().box().voxels() * host.bytes);
  VOX_TRY(device->voxels, DeviceArray<std::byte>::allocate(bytes));
  VOX_CHECK(
      check(cudaMemcpy(device->voxels.data(), host.voxels, bytes, cudaMemcpyHostToDevice), "uploading"));
  device->view = host;
  device->view.voxels = device->voxels.data();
  return std::unique_ptr<const DeviceGrid>(std::move(device));
}

Result<std::unique_ptr<const DeviceGrid>> DeviceGrid::upload(const SvmmGrid& grid, Context&) {
  VOX_CHECK(check_device());
  auto device = std::make_unique<DeviceSvmm>();
  device->info = grid.info();
  const auto allocate = [&](uint64_t bytes) -> Result<std::byte*> {
    VOX_TRY(auto level, DeviceArray<std::byte>::allocate(bytes));
    device->levels.push_back(std::move(level));
    return device->levels.back().data();
  };
  const auto copy = [](std::byte* to, std::span<const std::byte> from) {
    return check(cudaMemcpy(to, from.data(), from.size(), cudaMemcpyHostToDevice), "uploading");
  };
  VOX_TRY(const svmm::FlatPools pools, flatten(grid.volume(), allocate, copy));
  VOX_TRY(device->pools, DeviceArray<svmm::FlatPools>::copy_of(pools));
  VOX_TRY(device->view, DeviceArray<svmm::View>::copy_of(grid.volume().store().view));
  return std::unique_ptr<const DeviceGrid>(std::move(device));
}

Result<std::unique_ptr<const DeviceGrid>> DeviceGrid::upload(const DagGrid& grid, Context&) {
  VOX_CHECK(check_device());
  const color::Volume& volume = grid.volume();
  VOX_TRY(const color::DagView* const dag, volume.store().dag(volume.container(), volume.params()));
  auto device = std::make_unique<DeviceDag>(grid);
  color::DagView view = *dag;
  VOX_TRY(device->leaves, uploaded(dag->leaves, dag->leaf_count));
  view.leaves = device->leaves.data();
  for (size_t h = 0; h < view.nodes.size(); ++h) {
    if (view.words[h] == 0) continue;
    VOX_TRY(auto nodes, uploaded(dag->nodes[h], dag->words[h]));
    view.nodes[h] = nodes.data();
    device->nodes.push_back(std::move(nodes));
  }
  VOX_TRY(device->view, DeviceArray<color::DagView>::copy_of(view));
  return std::unique_ptr<const DeviceGrid>(std::move(device));
}

}  // namespace voxkit::render
