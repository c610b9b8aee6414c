// What a ray sees of a volume: `locate(voxel) -> {value, cell}`, the cell being the largest box known to hold
// one value.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "formats/context.h"
#include "formats/copy.h"
#include "formats/source.h"
#include "libsvmm/svmm.h"

namespace voxkit::render {

/// A box of voxels of one value, in base voxels, cut to the volume.
struct Cell {
  Voxel value;
  int64_t lo[3], hi[3];
};

/// A volume in memory; every cell is one voxel.
class DenseGrid {
 public:
  /// Reads all of `source`; the memory is reserved in ctx.memory for as long as the grid lives.
  static Result<std::shared_ptr<const DenseGrid>> read(VolumeSource& source, Context& ctx);

  const VolumeInfo& info() const { return info_; }
  /// Nothing is remembered from one voxel to the next.
  class Cursor {
   public:
    explicit Cursor(const DenseGrid& grid) : grid_(&grid) {}
    /// `finest`: edge in voxels below which detail is not wanted; a dense volume has no coarser detail.
    void locate(const int64_t (&v)[3], double finest, Cell& cell) {
      (void)finest;
      const int64_t index = (v[2] * grid_->info_.dims.y + v[1]) * grid_->info_.dims.x + v[0];
      std::memcpy(cell.value.bytes.data(), grid_->voxels_ + index * grid_->bytes_,
                  static_cast<size_t>(grid_->bytes_));
      for (int a = 0; a < 3; ++a) cell.lo[a] = v[a], cell.hi[a] = v[a] + 1;
    }
    static uint64_t blocks() { return 0; }
    static Status status() { return {}; }

   private:
    const DenseGrid* grid_;
  };

 private:
  VolumeInfo info_;
  std::unique_ptr<Buffer> buffer_;
  const std::byte* voxels_ = nullptr;
  int bytes_ = 0;
};

/// A compressed volume. Cells are terminal voxels; with a level of detail, also coarser ones.
class SvmmGrid {
 public:
  explicit SvmmGrid(std::shared_ptr<const svmm::Volume> volume) : volume_(std::move(volume)) {}
  const VolumeInfo& info() const { return volume_->info(); }

  /// Finds cells. Restart: every search begins at the root (section 3.2.2, for GPUs). Otherwise the path of
  /// blocks from the root is kept, and a search begins at the smallest block that holds the voxel.
  template <bool Restart>
  class Cursor {
   public:
    explicit Cursor(const SvmmGrid& grid) : path_(*grid.volume_) {}
    void locate(const int64_t (&v)[3], double finest, Cell& cell) {
      if (Restart) path_.restart();
      path_.locate({v[0], v[1], v[2]}, finest);
      cell.value = path_.value();
      const Box& box = path_.cell();
      for (int a = 0; a < 3; ++a) cell.lo[a] = box.lo[a], cell.hi[a] = box.hi[a];
    }
    /// Blocks entered so far.
    uint64_t blocks() const { return path_.blocks_entered(); }
    /// What was wrong with the file, if anything was.
    const Status& status() const { return path_.status(); }

   private:
    svmm::Path path_;
  };

 private:
  std::shared_ptr<const svmm::Volume> volume_;
};

}  // namespace voxkit::render
