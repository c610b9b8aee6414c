#include "librender/device/device_grid.h"

#include <vector>

#include "libcolor/store.h"
#include "librender/cast/glimpses.h"
#include "librender/cast/surface_colors.h"
#include "librender/cast/surface_traits.h"
#include "librender/device/backend_run.h"
#include "librender/device/flat_pools.h"
#include "librender/device/frame_buffers.h"
#include "librender/device/pixel_kernel.h"

namespace voxkit::render {
namespace {

/// What all of them have, but for what a view looks at.
class Grid : public DeviceGrid {
 public:
  Grid(const VolumeInfo& info, std::shared_ptr<const Backend> backend)
      : backend_(std::move(backend)), info_(info) {}

 protected:
  const Backend& backend() const { return *backend_; }

  template <class View>
  Status cast_with(const View& view, const Camera& camera, const CastOptions& options, Frame& frame,
                   Context& ctx) const {
    VOX_TRY(const CastParams params, cast_params(info_, camera, options));
    return cast_with(view, params, frame, ctx);
  }
  template <class View>
  Status cast_with(const View& view, const CastParams& params, Frame& frame, Context& ctx) const {
    VOX_CHECK(
        frame.begin({.width = params.width, .height = params.height, .details = true, .costs = true}, ctx));
    const std::lock_guard lock(buffers_.mutex);
    VOX_CHECK(buffers_.reserve(*backend_, frame.rays, ctx));
    const PixelKernel<View> kernel{params, view, buffers_.pixels.data(), buffers_.details.data(),
                                   buffers_.costs.data()};
    VOX_TRY(frame.seconds, backend_->run("casting", kernel.count(), kernel, ctx));
    VOX_CHECK(buffers_.download(*backend_, frame, 0, frame.pixels.size()));
    add_up(frame);
    return {};
  }

 private:
  std::shared_ptr<const Backend> backend_;
  VolumeInfo info_;
  mutable FrameBuffers buffers_;
};

class Dense final : public Grid {
 public:
  using Grid::Grid;
  Status fill(const DenseGrid& grid, Context& ctx) {
    view_ = grid.view();
    const auto bytes = static_cast<size_t>(grid.info().box().voxels() * view_.bytes) + DenseView::read_slack;
    VOX_TRY(voxels_, backend().upload(std::span(view_.voxels, bytes), "the volume", ctx));
    view_.voxels = voxels_.data();
    return {};
  }
  Status cast(const Camera& camera, const CastOptions& options, Frame& frame, Context& ctx) const override {
    VOX_CHECK(options.traversal == Traversal::baseline
                  ? cast_with(BaselineView{view_}, camera, options, frame, ctx)
                  : cast_with(view_, camera, options, frame, ctx));
    if (!options.details) frame.details.clear();
    return {};
  }

 private:
  DenseView view_{};
  DeviceArray<std::byte> voxels_;
};

class Svmm final : public Grid {
 public:
  using Grid::Grid;
  Status fill(const svmm::Volume& volume, Context& ctx) {
    VOX_TRY(blocks_, upload_blocks(volume, backend(), ctx));
    VOX_TRY(pools_, backend().upload(std::span<const svmm::FlatPools>(&blocks_.pools, 1), "pools", ctx));
    VOX_TRY(view_, backend().upload(std::span<const svmm::View>(&volume.store().view, 1), "a view", ctx));
    return {};
  }
  Status cast(const Camera& camera, const CastOptions& options, Frame& frame, Context& ctx) const override {
    using svmm::FlatPools;
    if (options.traversal == Traversal::baseline) return only_dense_has_baseline();
    const svmm::View* const view = view_.data();
    const FlatPools* const pools = pools_.data();
    VOX_CHECK(options.traversal == Traversal::restart
                  ? cast_with(SvmmView<FlatPools, Search::restart>{view, pools}, camera, options, frame, ctx)
                  : cast_with(SvmmView<FlatPools, Search::path>{view, pools}, camera, options, frame, ctx));
    if (!options.details) frame.details.clear();
    return {};
  }

 private:
  FlatBlocks blocks_;
  DeviceArray<svmm::FlatPools> pools_;
  DeviceArray<svmm::View> view_;
};

class Dag final : public Grid {
 public:
  Dag(const DagGrid& grid, std::shared_ptr<const Backend> backend)
      : Grid(grid.info(), std::move(backend)), grid_(grid) {}
  Status fill(Context& ctx) {
    const color::Volume& volume = grid_.volume();
    if (volume.params().attributes.has(color::Attribute::opacity))
      return fail(ErrorCode::device, volume.container().name(),
                  "some of its voxels are translucent, which a GPU does not draw: expected --device cpu");
    VOX_TRY(const color::DagView* const dag, volume.store().dag(volume.container(), volume.params()));
    color::DagView view = *dag;
    VOX_TRY(leaves_, backend().upload(std::span(dag->leaves, dag->leaf_count), "leaves", ctx));
    view.leaves = leaves_.data();
    for (size_t h = 0; h < view.nodes.size(); ++h) {
      VOX_TRY(auto nodes, backend().upload(std::span(dag->nodes[h], dag->words[h]), "nodes", ctx));
      view.nodes[h] = nodes.data();
      nodes_.push_back(std::move(nodes));
      VOX_TRY(auto coded, backend().upload(std::span(dag->coded[h], dag->coded_bytes[h]), "nodes", ctx));
      view.coded[h] = coded.data();
      coded_.push_back(std::move(coded));
    }
    VOX_TRY(view_, backend().upload(std::span<const color::DagView>(&view, 1), "a view", ctx));
    return {};
  }
  Status cast(const Camera& camera, const CastOptions& options, Frame& frame, Context& ctx) const override {
    if (options.traversal == Traversal::baseline) return only_dense_has_baseline();
    VOX_TRY(CastParams params, surface_params(grid_.volume(), camera, options));
    VOX_TRY(const std::unique_ptr<Buffer> buffer, hold_glimpses(params, ctx));
    Glimpse* const glimpses = glimpses_in(buffer);
    DeviceArray<Glimpse> written;
    if (buffer) {
      VOX_CHECK(backend().reserve(written, glimpse_count(params), "what pixels see of coarse cells", ctx));
      params.glimpses = written.data();
    }
    VOX_CHECK(options.traversal == Traversal::restart
                  ? cast_with(DagCastView<Search::restart>{view_.data()}, params, frame, ctx)
                  : cast_with(DagCastView<Search::path>{view_.data()}, params, frame, ctx));
    if (buffer)
      VOX_CHECK(backend().download(written, 0, std::span<Glimpse>(glimpses, glimpse_count(params))));
    VOX_CHECK(look_up_colors(grid_.volume(), glimpses, frame, ctx));
    VOX_CHECK(look_up_traits(grid_.volume(), options.traits, glimpses, frame, ctx));
    if (!options.details) frame.details.clear();
    return {};
  }

 private:
  DagGrid grid_;
  DeviceArray<uint64_t> leaves_;
  std::vector<DeviceArray<uint32_t>> nodes_;
  std::vector<DeviceArray<uint8_t>> coded_;
  DeviceArray<color::DagView> view_;
};

}  // namespace

Result<std::unique_ptr<const DeviceGrid>> DeviceGrid::upload(const DenseGrid& grid,
                                                             std::shared_ptr<const Backend> backend,
                                                             Context& ctx) {
  auto device = std::make_unique<Dense>(grid.info(), std::move(backend));
  VOX_CHECK(device->fill(grid, ctx));
  return device;
}
Result<std::unique_ptr<const DeviceGrid>> DeviceGrid::upload(const SvmmGrid& grid,
                                                             std::shared_ptr<const Backend> backend,
                                                             Context& ctx) {
  auto device = std::make_unique<Svmm>(grid.info(), std::move(backend));
  VOX_CHECK(device->fill(grid.volume(), ctx));
  return device;
}
Result<std::unique_ptr<const DeviceGrid>> DeviceGrid::upload(const DagGrid& grid,
                                                             std::shared_ptr<const Backend> backend,
                                                             Context& ctx) {
  auto device = std::make_unique<Dag>(grid, std::move(backend));
  VOX_CHECK(device->fill(ctx));
  return device;
}

}  // namespace voxkit::render
