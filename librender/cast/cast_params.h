// A camera before a volume, as the kernel wants it.
#pragma once

#include "librender/cast/cast_kernel.h"
#include "librender/cast/ray_cast.h"

namespace voxkit::render {

/// Errors: ErrorCode::usage where the camera is 2^31 voxels away or more.
Result<CastParams> cast_params(const VolumeInfo& info, const Camera& camera, const CastOptions& options);

/// The counts of a frame whose details and costs are filled.
void add_up(Frame& frame);
/// What is said where Traversal::baseline is asked of a compressed volume.
Status only_dense_has_baseline();

}  // namespace voxkit::render
