// What scenes on a device have in common, whatever their voxels come from: device_dvr_dense.cc and
// device_dvr_vq.cc have the rest.
#pragma once

#include "librender/device/backend_run.h"
#include "librender/device/device_dvr.h"
#include "librender/device/frame_buffers.h"
#include "librender/device/warp_kernel.h"
#include "librender/dvr/dvr_job.h"

namespace voxkit::render {

class DeviceScene : public DeviceDvr {
 public:
  DeviceScene(const DvrScene& scene, std::shared_ptr<const Backend> backend)
      : backend_(std::move(backend)), scene_(&scene) {}

 protected:
  const Backend& backend() const { return *backend_; }
  const DvrScene& scene() const { return *scene_; }
  /// Uploads all but the voxels.
  Status fill(Context& ctx);

  template <class View>
  Status draw_with(const View& view, const Camera& camera, const DvrOptions& options, Frame& frame,
                   Context& ctx) const {
    VOX_TRY(DvrJob job, dvr_job(*scene_, camera, options));
    VOX_CHECK(begin(job, frame, ctx));
    const std::lock_guard lock(buffers_.mutex);
    VOX_TRY(const WarpPicture picture, reserve(job, ctx));
    VOX_TRY(frame.seconds, run(job, view, picture, ctx));
    return finish(job, frame, ctx);
  }

 private:
  template <DvrGradient kind, class View>
  Result<double> run_kind(const DvrJob& job, const View& view, const WarpPicture& picture,
                          Context& ctx) const {
    return backend_->run_groups("rendering", WarpKernel<kind, View>{job.params, view, picture}, ctx);
  }
  template <class View>
  Result<double> run(const DvrJob& job, const View& view, const WarpPicture& picture, Context& ctx) const {
    switch (job.gradient) {
      case DvrGradient::none:
        return run_kind<DvrGradient::none>(job, view, picture, ctx);
      case DvrGradient::analytic:
        return run_kind<DvrGradient::analytic>(job, view, picture, ctx);
      default:
        return run_kind<DvrGradient::neighbour>(job, view, picture, ctx);
    }
  }
  /// Begins a frame; has a job point to what was uploaded.
  Status begin(DvrJob& job, Frame& frame, Context& ctx) const;
  Result<WarpPicture> reserve(const DvrJob& job, Context& ctx) const;
  /// Fetches the picture, and what it cost.
  Status finish(const DvrJob& job, Frame& frame, Context& ctx) const;

  std::shared_ptr<const Backend> backend_;
  const DvrScene* scene_;
  DeviceArray<TransferFunction::Entry> table_;
  DeviceArray<uint8_t> map_;
  mutable FrameBuffers buffers_;
};

/// The scenes of DeviceDvr::upload.
Result<std::unique_ptr<const DeviceDvr>> upload_dense(const DvrScene& scene,
                                                      std::shared_ptr<const Backend> backend, Context& ctx);
Result<std::unique_ptr<const DeviceDvr>> upload_vq(const DvrScene& scene,
                                                   std::shared_ptr<const Backend> backend, Context& ctx);

}  // namespace voxkit::render
