// Direct volume rendering on a GPU (Guthe and Goesele 2016, section 5).
#pragma once

#include <memory>

#include "librender/dvr/dvr.h"

namespace voxkit::render {

/// A scene on the GPU: an uncompressed volume, or a VQ file whose bricks each warp decodes for itself.
class DeviceDvr {
 public:
  /// The scene must live as long. Errors: ErrorCode::device where no GPU answers; ErrorCode::limit where its
  /// memory does not suffice, or an uncompressed volume is one voxel thin or has 2^31 voxels;
  /// ErrorCode::usage of SVMM volumes, which have to be decoded; ErrorCode::input of a damaged file.
  static Result<std::unique_ptr<const DeviceDvr>> upload(const DvrScene& scene, Context& ctx);
  virtual ~DeviceDvr() = default;
  /// As DvrScene::draw, pixel by pixel. Of the counts, cells_visited and bricks_decoded are 0, and
  /// blocks_touched counts what all warps decoded. Frame::seconds is the time of the kernel alone.
  virtual Status draw(const Camera& camera, const DvrOptions& options, DvrFrame& frame,
                      Context& ctx) const = 0;
};

}  // namespace voxkit::render
