// Points as a coloured surface, however many there are.
#pragma once

#include <memory>
#include <optional>

#include "formats/mesh/point_cloud.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// Points of no size in a grid with `resolution` voxels, 1 to 2^21, along their longest side; not said, or
/// where it is that of their own grid (PointCloud::grid): in that, if all of them are in it, else
/// default_resolution. A voxel has the mean of its points' colours in linear light, rounded once. The points
/// are read once now and once for the voxels. What does not fit into a quarter of the memory limit is sorted
/// in parts, 16 bytes a point, which go through a file in $TMPDIR (default /tmp). ErrorCode::usage for the
/// resolution, ErrorCode::input where no point counts; those of the points.
///
/// `attributes`: what voxels have beside colours (point_means.h), of what the points have and were opened
/// with (PointExtras); not said: opacity where some point is neither opaque nor clear, emissive where one
/// gives light. ErrorCode::usage for
/// what they do not have.
Result<std::unique_ptr<SurfaceSource>> surface_of_points(std::unique_ptr<const PointCloud> points,
                                                         std::optional<int64_t> resolution, Context& ctx,
                                                         const std::optional<AttributeSet>& attributes = {});

}  // namespace voxkit::color
