// The next coarser level: each voxel stands for 2^3.
#pragma once

#include "formats/context.h"
#include "formats/source.h"

namespace voxkit::svmm {

/// Whether a mean of stored values stands for nothing: of labels, bits, and integers that a table holds.
inline bool has_no_means(const VolumeInfo& info) {
  return info.is_labels || info.labels || info.format == VoxelFormat::bitmap;
}

/// The level above that of `source`, in a temporary file. Of integers the mean of the up to 8 voxels inside
/// the volume that are not the fill value, halves rounded up; of floats that of those that are numbers,
/// summed as doubles; of values that have no means the one that most of those that are not the fill value
/// have, of several such the least. Of colours the mean of solid ones, weighted by their alpha, with the mean
/// alpha of all; where that would be void, and not all are, the least that is not. Where all are the fill
/// value, or no numbers, so is the mean. `visit`, if given, sees every slice of the source once, in any
/// order, on several threads. Memory: a slab of at least two slices. Errors: those of the source;
/// ErrorCode::output.
Result<std::unique_ptr<VolumeSource>> halved(VolumeSource& source,
                                             const std::function<void(ConstVoxelSpan, Index3)>& visit,
                                             Context& ctx);

}  // namespace voxkit::svmm
