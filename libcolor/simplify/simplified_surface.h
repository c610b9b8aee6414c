// A surface made of fewer voxels, within a distance.
#pragma once

#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// The voxels of `source`, simplified: each of them has one that is left within `distance`, 0 to
/// most_simplify, and each that is left one of them (a Hausdorff distance, in voxels, between their centres).
/// Where the surface has no gaps it stays as it is; gaps become wider by a voxel on each side at most.
/// Colours are means in linear light of those that are nearest. Cubes of 64^3 voxels are simplified by
/// themselves, on ctx.threads threads. Memory: some 2 MiB a thread, and 16 for each that has all its voxels.
class SimplifiedSurface final : public SurfaceSource {
 public:
  /// `source` must outlive it. `exact` is handed all that comes from it, first.
  SimplifiedSurface(SurfaceSource& source, double distance, Sink exact = {});

  /// Errors: ErrorCode::limit; those of the source and of the sinks.
  Status read(Context& ctx, const Sink& sink) override;

 private:
  SurfaceSource& source_;
  int squared_;
  Sink exact_;
};

}  // namespace voxkit::color
