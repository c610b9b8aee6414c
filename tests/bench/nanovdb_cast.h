// The peer: NanoVDB grids and the first active voxel on a ray, by NanoVDB's own code.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "formats/context.h"
#include "formats/source.h"
#include "librender/camera.h"

namespace voxkit::bench {

/// A NanoVDB grid of RGBA8 values: every voxel of alpha > 0 is active, and leaves of one value are tiles.
class NanovdbGrid {
 public:
  /// Reads an RGBA volume slab by slab. Memory: a slab of 8 slices, and twice the grid.
  static Result<std::shared_ptr<const NanovdbGrid>> build(VolumeSource& source, Context& ctx);
  virtual ~NanovdbGrid() = default;
  const VolumeInfo& info() const { return info_; }
  virtual const void* data() const = 0;  ///< a nanovdb::NanoGrid<nanovdb::Rgba8>
  virtual uint64_t bytes() const = 0;

 protected:
  VolumeInfo info_;
};

/// What a ray found: as much as a Pixel of librender holds.
struct Hit {
  float color[4] = {};
  float distance = 0;               ///< from the eye, world units
  int32_t voxel[3] = {-1, -1, -1};  ///< -1: nothing
};

/// How the first active voxel is found.
enum class March {
  first_active,  ///< nanovdb::firstActive as it is shipped; it looks a whole voxel ahead at every step
  careful,       ///< the same HDDA, looking ahead by a thousandth of a voxel and only between nodes
};

struct Cast {
  render::Camera camera;
  int width = 0, height = 0;
  March march = March::first_active;
  bool doubles = false;  ///< nanovdb::Ray<double>, otherwise Ray<float>
};

/// One ray through each pixel's centre, in the tiles and on the threads that librender uses. Returns the
/// seconds taken; `hits` has width * height elements.
using CastFunction = Result<double>(const NanovdbGrid& grid, const Cast& cast, std::vector<Hit>& hits,
                                    Context& ctx);
/// The same source, compiled with the project's flags and with those for this very machine.
[[gnu::visibility("default")]] CastFunction cast_as_built;
[[gnu::visibility("default")]] CastFunction cast_native;

}  // namespace voxkit::bench
