// Levels of detail of a compressed surface: level k has a voxel for each cube of 2^k voxels a side that has
// any.
#pragma once

#include <memory>

#include "libcolor/color.h"

namespace voxkit::color {

/// Which colours the voxels of a level above 0 have.
enum class CellColors {
  stored,  ///< those that the file has for them, with Colors::all; else their means
  means,   ///< the means of their voxels' colours in linear light, rounded once
};

/// How many levels there are: of the last one all sides are 1.
int level_count(const VolumeInfo& info);
/// The volume at a level below that: a side that is no multiple of 2^level is rounded up.
VolumeInfo level_info(const VolumeInfo& info, int level);

/// How many voxels a level has.
Result<uint64_t> level_voxels(const Volume& volume, int level);

/// The voxels of a level, which can be read any number of times; level 0 is the volume. Errors of reading:
/// ErrorCode::input where the volume is damaged; those of the sink. With CellColors::stored a colour that is
/// stored is what the nodes say it is: Volume::check finds out whether that is true.
std::unique_ptr<SurfaceSource> surface_of(std::shared_ptr<const Volume> volume, int level = 0,
                                          CellColors colors = CellColors::stored);
/// The same as a source of boxes. A box of means takes as long as all voxels in it.
std::unique_ptr<VolumeSource> open_level(std::shared_ptr<const Volume> volume, int level, CellColors colors);

}  // namespace voxkit::color
