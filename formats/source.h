// Where voxels come from and where they go. An encoder never sees a whole volume.
#pragma once

#include <memory>
#include <optional>

#include "formats/result.h"
#include "formats/volume.h"

namespace voxkit {

/// A volume that is read box by box.
class VolumeSource {
 public:
  virtual ~VolumeSource() = default;

  const VolumeInfo& info() const { return info_; }

  /// True where the voxels can only be had front to back (gzip, pipes). Then `read` must be asked, from one
  /// thread, for boxes of full width and height whose z ranges ascend without overlap; gaps are skipped.
  virtual bool forward_only() const { return false; }

  /// Writes the voxels of `box` (inside info().box()) to `out`. Any boxes, in any order, from any number of
  /// threads, unless forward_only(). On an error the contents of `out` are unspecified.
  virtual Status read(const Box& box, VoxelSpan out) = 0;

  /// The value that every voxel of `box` has, where that is known *without reading voxels*; nothing where it
  /// is not known. A source that knows (tiles, recursion, a compressed tree) saves its callers the reading.
  virtual std::optional<Voxel> uniform(const Box& box) const {
    (void)box;
    return std::nullopt;
  }

  /// Hints that change no result: the slices z0 .. z1 are about to be read; they will not be read again soon.
  /// A source in a mapped file asks for its pages and gives them back, which keeps the process small whatever
  /// the size of the file.
  virtual void expect(int64_t z0, int64_t z1) const { (void)z0, (void)z1; }
  virtual void release(int64_t z0, int64_t z1) const { (void)z0, (void)z1; }

  /// What is said of the voxels from outside (VolumeInfo::is_labels, fill). No voxel changes.
  void set_labels() { info_.is_labels = true; }
  void set_fill(double stored) { info_.fill = stored; }

 protected:
  VolumeInfo info_;
};

/// A volume that is written slab by slab: full width and height, z ascending from 0 without gaps.
class VolumeSink {
 public:
  virtual ~VolumeSink() = default;
  /// Appends the slices `z0 .. z1` (half open; z0 is where the last call ended).
  virtual Status write(int64_t z0, int64_t z1, ConstVoxelSpan voxels) = 0;
  /// After the last slab: completes the file. Without it the output never appears.
  virtual Status finish() = 0;
};

}  // namespace voxkit
