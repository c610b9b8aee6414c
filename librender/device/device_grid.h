// Volumes in the memory of a GPU, and casting there.
#pragma once

#include <memory>

#include "librender/cast/ray_cast.h"

namespace voxkit::render {

/// Whether there is a GPU to render with. ErrorCode::device says why not: no CUDA in this build, no driver,
/// no GPU.
Status check_device();

/// A volume on the GPU: an uncompressed one; the blocks of a compressed one, or the nodes of a surface, a
/// pool for each level, one upload a pool. A surface's colours stay on the host, which looks up those of what
/// was hit.
class DeviceGrid {
 public:
  static Result<std::unique_ptr<const DeviceGrid>> upload(const DenseGrid& grid, Context& ctx);
  static Result<std::unique_ptr<const DeviceGrid>> upload(const SvmmGrid& grid, Context& ctx);
  static Result<std::unique_ptr<const DeviceGrid>> upload(const DagGrid& grid, Context& ctx);
  virtual ~DeviceGrid() = default;
  /// As `cast` on the host, pixel by pixel. Frame::seconds is the time of the kernel, and of looking up
  /// colours.
  virtual Status cast(const Camera& camera, const CastOptions& options, Frame& frame, Context& ctx) const = 0;
};

}  // namespace voxkit::render
