// Casting the rays of a picture: what each sees first, and the colour that it gathers (thesis sections 3.2
// and 3.3).
#pragma once

#include "librender/camera.h"
#include "librender/cast/dag_grid.h"
#include "librender/cast/grid.h"
#include "librender/cast/mask_grid.h"
#include "librender/cast/packed_grid.h"
#include "librender/frame.h"

namespace voxkit::render {

/// path: keeps the path of blocks from the root. restart: searches from the root at every step
/// (section 3.2.2). baseline: Algorithm 1, one voxel a step with an accumulating float DDA, on dense volumes
/// only; what the others are measured against.
enum class Traversal { path, restart, baseline };

struct CastOptions {
  int width = 1024, height = 768;
  Traversal traversal = Traversal::path;
  bool level_of_detail = false;     ///< stop at voxels no larger than a pixel's cone (section 3.2.4)
  bool native = true;               ///< AVX2 where there is; else what every machine has. For comparisons
  bool details = false;             ///< fill Frame::details
  color::AttributeSet traits = {};  ///< fill Frame::traits with those of them that a surface has
  bool skip = true;                 ///< step over cells; else voxel by voxel, to see what skipping saves
  /// Stored values that a scalar volume shows as 0 and 1, its colour being (d, d, d, d) (section 4.1).
  ValueRange range{0, 255};
};

/// One ray through each pixel's centre. Opacity is per length: a cell of opacity a that is crossed over n
/// base voxels covers 1 - (1 - a)^n, so skipping changes nothing; a ray ends at 99.5 %. The pixels do not
/// depend on ctx.threads. `frame` is overwritten; its memory is used again.
Status cast(const DenseGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx);
Status cast(const SvmmGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx);
Status cast(const DagGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx);
/// Without levels of detail.
Status cast(const MaskGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx);
Status cast(const PackedGrid& grid, const Camera& camera, const CastOptions& options, Frame& frame,
            Context& ctx);

}  // namespace voxkit::render
