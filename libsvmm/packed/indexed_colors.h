// Volumes of few colours, such as voxel art and colored segmentations: each voxel is a number in a table of
// colors, which are names to the pages.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "formats/context.h"
#include "formats/source.h"

namespace voxkit::svmm {

/// Void is number 0, color i number i + 1.
inline constexpr size_t most_indexed_colors = 255;

/// The colors of solid voxels, in ascending order of their bytes; nothing where there are more than
/// `most_indexed_colors`, which is known as soon as these are found. Memory: a slab. Errors: those of
/// `source`.
Result<std::optional<std::vector<Voxel>>> few_colors(VolumeSource& source, Context& ctx);

/// The numbers of a source's colors as labels of 8 bits, whose fill value is void. `source` must outlive it.
std::unique_ptr<VolumeSource> numbers_of(VolumeSource& source, const std::vector<Voxel>& colors);

}  // namespace voxkit::svmm
