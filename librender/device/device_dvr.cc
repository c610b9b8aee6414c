#include "librender/device/device_dvr.h"

#include "librender/device/device_scene.h"

namespace voxkit::render {
namespace {

/// Rows of a picture that may see the volume.
size_t rows(const CastParams& cast) {
  return cast.bottom > cast.top ? static_cast<size_t>(cast.bottom - cast.top) : 0;
}

}  // namespace

Status DeviceScene::fill(Context& ctx) {
  using Entry = TransferFunction::Entry;
  VOX_TRY(table_,
          backend_->upload(std::span<const Entry>(scene_->transfer().table(), TransferFunction::entries),
                           "a transfer function", ctx));
  VOX_TRY(map_, backend_->upload(scene_->skips().bytes(), "a map of bricks", ctx));
  return {};
}

Status DeviceScene::begin(DvrJob& job, Frame& frame, Context& ctx) const {
  const CastParams& cast = job.params.cast;
  VOX_CHECK(frame.begin({.width = cast.width, .height = cast.height, .details = true, .costs = true}, ctx));
  job.params.table = table_.data();
  if (job.params.distances != nullptr)
    job.params.distances = map_.data() + (scene_->skips().distances() - scene_->skips().bytes().data());
  return {};
}

Result<WarpPicture> DeviceScene::reserve(const DvrJob& job, Context& ctx) const {
  const CastParams& cast = job.params.cast;
  VOX_CHECK(buffers_.reserve(*backend_, rows(cast) * static_cast<size_t>(cast.width), ctx));
  return WarpPicture{buffers_.pixels.data(), buffers_.details.data(), buffers_.costs.data()};
}

Status DeviceScene::finish(const DvrJob& job, Frame& frame, Context& ctx) const {
  const CastParams& cast = job.params.cast;
  const auto width = static_cast<size_t>(cast.width);
  if (rows(cast) > 0)
    VOX_CHECK(buffers_.download(*backend_, frame, static_cast<size_t>(cast.top) * width, rows(cast) * width));
  VOX_CHECK(blank_around(job, frame, ctx));
  for (size_t i = 0; i < frame.pixels.size(); ++i) {
    frame.samples += frame.details[i].cells;
    frame.rays_hit += frame.details[i].voxel[0] >= 0;
    frame.blocks_touched += frame.costs[i].blocks;
  }
  if (!job.details) frame.details.clear();
  return {};
}

Result<std::unique_ptr<const DeviceDvr>> DeviceDvr::upload(const DvrScene& scene,
                                                           std::shared_ptr<const Backend> backend,
                                                           Context& ctx) {
  const DvrVolume& volume = scene.volume();
  if (volume.svmm()) return bad_usage("--device cuda: an SVMM volume has to be decoded for --mode dvr");
  if (volume.vq() && volume.vq()->params().special)
    return bad_usage("--device cuda: a VQ volume with NaN or a fill value has to be decoded for --mode dvr");
  return volume.vq() ? upload_vq(scene, std::move(backend), ctx)
                     : upload_dense(scene, std::move(backend), ctx);
}

}  // namespace voxkit::render
