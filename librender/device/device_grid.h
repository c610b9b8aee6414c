// Volumes in the memory of a backend, and casting there.
#pragma once

#include <memory>

#include "librender/cast/ray_cast.h"
#include "librender/device/backend.h"

namespace voxkit::render {

/// A volume on a device: an uncompressed one; the blocks of a compressed one, or the nodes of a surface, a
/// pool for each level. A surface's colours stay on the host, which looks up those of what was hit.
class DeviceGrid {
 public:
  /// Errors: those of Backend::upload; ErrorCode::input of a damaged file.
  static Result<std::unique_ptr<const DeviceGrid>> upload(const DenseGrid& grid,
                                                          std::shared_ptr<const Backend> backend,
                                                          Context& ctx);
  static Result<std::unique_ptr<const DeviceGrid>> upload(const SvmmGrid& grid,
                                                          std::shared_ptr<const Backend> backend,
                                                          Context& ctx);
  static Result<std::unique_ptr<const DeviceGrid>> upload(const DagGrid& grid,
                                                          std::shared_ptr<const Backend> backend,
                                                          Context& ctx);
  virtual ~DeviceGrid() = default;
  /// As `cast` on the host, pixel by pixel. Frame::seconds is the time of the kernel, and of looking up
  /// colours. One picture at a time: others wait.
  virtual Status cast(const Camera& camera, const CastOptions& options, Frame& frame, Context& ctx) const = 0;
};

}  // namespace voxkit::render
