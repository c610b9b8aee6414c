// Casting the rays of a picture: what each sees first, and the colour that it gathers (thesis sections 3.2
// and 3.3).
#pragma once

#include <limits>
#include <vector>

#include "librender/camera.h"
#include "librender/grid.h"

namespace voxkit::render {

/// What a ray found.
struct Pixel {
  float colour[4] = {};                                     ///< R, G, B times opacity, and opacity; 0..1
  float distance = std::numeric_limits<float>::infinity();  ///< from the eye to the first voxel that is not
                                                            ///< void, world units
  int32_t voxel[3] = {-1, -1, -1};                          ///< that voxel; of a coarser cell its first
  uint32_t cells = 0;                                       ///< cells looked at
};

/// The pixels of a picture before shading, row by row from the top, and what they cost.
struct Frame {
  int width = 0, height = 0;
  std::vector<Pixel> pixels;
  uint64_t rays = 0, rays_hit = 0, cells_visited = 0, blocks_touched = 0;
  double seconds = 0;  ///< of casting alone
};

/// path: keeps the path of blocks from the root. restart: searches from the root at every step
/// (section 3.2.2). baseline: Algorithm 1, one voxel a step with an accumulating float DDA, on dense volumes
/// only; what the others are measured against.
enum class Traversal { path, restart, baseline };

struct CastOptions {
  int width = 1024, height = 768;
  Traversal traversal = Traversal::path;
  bool level_of_detail = false;  ///< stop at voxels no larger than a pixel's cone (section 3.2.4)
  /// Stored values that a scalar volume shows as 0 and 1, its colour being (d, d, d, d) (section 4.1).
  ValueRange range{0, 255};
};

/// One ray through each pixel's centre. Opacity is per length: a cell of opacity a that is crossed over n
/// base voxels covers 1 - (1 - a)^n, so skipping changes nothing; a ray ends at 99.5 %. The pixels do not
/// depend on ctx.threads.
Result<Frame> cast(const DenseGrid& grid, const Camera& camera, const CastOptions& options, Context& ctx);
Result<Frame> cast(const SvmmGrid& grid, const Camera& camera, const CastOptions& options, Context& ctx);

}  // namespace voxkit::render
