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

/// The voxels of a level, all or those in a box, any number of times; level 0 is the volume. With
/// CellColors::stored a colour that is stored is what the nodes say it is: Volume::check finds out whether
/// that is true. Errors of reading: ErrorCode::input where the volume is damaged; those of the sink. Const
/// functions are thread-safe.
class Level {
 public:
  explicit Level(std::shared_ptr<const Volume> volume, int level = 0, CellColors colors = CellColors::stored);

  const VolumeInfo& info() const { return info_; }
  const Volume& volume() const { return *volume_; }
  /// What its voxels have beside colours: as cells of the file have it (attribute_means.h).
  AttributeSet attributes() const { return volume_->params().attributes; }
  /// The voxels of the level that a box of the volume touches, and those of the volume that are in a box of
  /// the level.
  Box touched(const Box& box) const;
  Box voxels_of(const Box& box) const;

  /// How many there are in a box of the level.
  Result<uint64_t> count(const Box& box) const;
  /// All of them in Morton order, in runs.
  Status for_each_voxel(const SurfaceSource::Sink& sink, Context& ctx) const;
  /// Those in a box of the level. Takes as long as all voxels of the volume in it, unless its colours are
  /// stored.
  Status for_each_voxel(const Box& box, const SurfaceSource::Sink& sink) const;

 private:
  Status cells(const Box& box, const SurfaceSource::Sink& sink) const;

  std::shared_ptr<const Volume> volume_;
  int level_;
  bool stored_;  ///< the file has the colours of its cells
  VolumeInfo info_;
};

/// A level as a source of voxels, which can be read any number of times.
std::unique_ptr<SurfaceSource> surface_of(std::shared_ptr<const Volume> volume, int level = 0,
                                          CellColors colors = CellColors::stored);
/// The same as a source of boxes.
std::unique_ptr<VolumeSource> open_level(std::shared_ptr<const Volume> volume, int level, CellColors colors);

}  // namespace voxkit::color
