// Compressed surfaces put into one grid: cropped, moved, merged. Their structure is walked, not their space:
// in the order of the new grid, so nothing is sorted, and what is void or outside is not entered.
#pragma once

#include <memory>
#include <vector>

#include "libcolor/color.h"

namespace voxkit::color {

/// A surface, and where in a grid its first voxel lies, which may be outside.
struct Placed {
  std::shared_ptr<const Volume> volume;
  Index3 at{0};
};

/// The voxels of some surfaces in a grid, with the colours, and of attributes those that all of the surfaces
/// have. Where several have one, that of
/// the first one counts. What is outside of the grid is left out. Memory: 160 KiB a surface.
class Arrangement final : public SurfaceSource {
 public:
  /// `info`: of the grid; no side above 2^21, and the places of surfaces within 2^23 of it.
  Arrangement(std::vector<Placed> surfaces, VolumeInfo info);

  /// Can be called any number of times. Errors: ErrorCode::input where a surface is damaged, with its name;
  /// ErrorCode::limit; those of the sink.
  Status read(Context& ctx, const Sink& sink) override;

  /// What the last `read` came across.
  struct Census {
    uint64_t voxels = 0;
    uint64_t shared = 0;     ///< voxels that more surfaces than one have
    uint64_t differing = 0;  ///< those of them that have more colours, or other attributes, than one
    uint64_t cells = 0;      ///< of the grid that were entered
  };
  const Census& census() const { return census_; }

 private:
  std::vector<Placed> surfaces_;
  Census census_;
};

/// How many voxels of a surface a box holds; what is outside of the surface is void. Looks at its structure
/// only. Errors as above.
Result<uint64_t> voxels_in(const Volume& volume, const Box& box);

}  // namespace voxkit::color
