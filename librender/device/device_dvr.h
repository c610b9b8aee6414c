// Direct volume rendering on a device (Guthe and Goesele 2016, section 5).
#pragma once

#include <memory>

#include "librender/device/backend.h"
#include "librender/dvr/dvr.h"

namespace voxkit::render {

/// A scene on a device: an uncompressed volume, or a VQ file whose bricks each group of lanes decodes for
/// itself.
class DeviceDvr {
 public:
  /// The scene must live as long. Errors: those of Backend::upload; ErrorCode::limit where an uncompressed
  /// volume is one voxel thin or has 2^31 voxels; ErrorCode::usage of SVMM volumes, and of VQ volumes with a
  /// code for no value, which have to be decoded; ErrorCode::input of a damaged file.
  static Result<std::unique_ptr<const DeviceDvr>> upload(const DvrScene& scene,
                                                         std::shared_ptr<const Backend> backend,
                                                         Context& ctx);
  virtual ~DeviceDvr() = default;
  /// As DvrScene::draw, pixel by pixel. Of the counts, cells_visited and bricks_decoded are 0, and
  /// blocks_touched counts what all groups decoded. Frame::seconds is the time of the kernel alone. One
  /// picture at a time: others wait.
  virtual Status draw(const Camera& camera, const DvrOptions& options, Frame& frame, Context& ctx) const = 0;
};

}  // namespace voxkit::render
