// What a ray sees of a volume: `locate(voxel) -> {value, cell}`, the cell being the largest aligned cube
// around the voxel that is known to hold one value.
#pragma once

#include <memory>

#include "formats/context.h"
#include "formats/copy.h"
#include "formats/source.h"
#include "librender/cast/ray.h"
#include "libsvmm/walk.h"

namespace voxkit::render {

/// Which way a grid is searched. path: keeps the path of blocks from the root. restart: searches from the
/// root at every step (section 3.2.2, for GPUs).
enum class Search { path, restart };

/// A value and its cell: the aligned cube of edge 2^log2_edge around the voxel.
struct Cell {
  Voxel value;
  int log2_edge;
  VOX_HD_HOT bool leave(GridRay& ray) const { return ray.leave(log2_edge); }
};

/// The voxels of an uncompressed volume, on the host or a device.
struct DenseView {
  static constexpr int read_slack = 4;  ///< bytes behind the last voxel that may be read
  const std::byte* voxels;
  int64_t width, height;  ///< in voxels
  int bytes;              ///< of a voxel

  VOX_HD_HOT Voxel at(int64_t x, int64_t y, int64_t z) const {
    const std::byte* p = voxels + ((z * height + y) * width + x) * bytes;
    switch (bytes) {
      case 4:
        return Voxel::of(load_le<uint32_t>(p));
      case 2:
        return Voxel::of(load_le<uint16_t>(p));
      case 1:
        return Voxel::of(load_le<uint8_t>(p));
      default:
        return Voxel::of(static_cast<uint32_t>(p[0]) | static_cast<uint32_t>(p[1]) << 8 |
                         static_cast<uint32_t>(p[2]) << 16);
    }
  }
  /// Nothing is remembered from one voxel to the next; every cell is one voxel.
  struct Cursor {
    const DenseView& view;
    VOX_HD_HOT Cell locate(uint32_t x, uint32_t y, uint32_t z, int finest) {
      (void)finest;
      bytes_ += static_cast<uint32_t>(view.bytes);
      return {view.at(x, y, z), 0};
    }
    VOX_HD_HOT static uint32_t blocks() { return 0; }
    VOX_HD_HOT uint32_t bytes() const { return bytes_; }
    uint32_t bytes_ = 0;
  };
  VOX_HD_HOT Cursor cursor() const { return {*this}; }
};

/// A compressed volume, on the host or a device. Cells are terminal voxels; with a level of detail, also
/// coarser ones.
template <class Pools, Search search>
struct SvmmView {
  const svmm::View* view;
  const Pools* pools;

  class Cursor {
   public:
    VOX_HD_HOT explicit Cursor(const SvmmView& volume) : walk_(*volume.view, *volume.pools) {}
    /// `finest`: cells of edge 2^finest are fine enough; -1: all detail.
    VOX_HD_HOT Cell locate(uint32_t x, uint32_t y, uint32_t z, int finest) {
      const auto found = walk_.locate(x, y, z, finest);
      return {found.value, found.log2_edge};
    }
    /// Blocks entered, and bytes of links and values looked at, so far.
    VOX_HD_HOT uint32_t blocks() const { return walk_.blocks_entered(); }
    VOX_HD_HOT uint32_t bytes() const { return walk_.bytes_read(); }

   private:
    svmm::Walk<Pools, search == Search::path> walk_;
  };
  VOX_HD_HOT Cursor cursor() const { return Cursor(*this); }
};

/// A volume in memory.
class DenseGrid {
 public:
  /// Reads all of `source`; the memory is reserved in ctx.memory for as long as the grid lives.
  static Result<std::shared_ptr<const DenseGrid>> read(VolumeSource& source, Context& ctx);

  const VolumeInfo& info() const { return info_; }
  DenseView view() const { return {buffer_->data(), info_.dims.x, info_.dims.y, voxel_bytes(info_.format)}; }

 private:
  VolumeInfo info_;
  std::unique_ptr<Buffer> buffer_;
};

class LearnedVoid;

/// A compressed volume, drawn from its file.
class SvmmGrid {
 public:
  explicit SvmmGrid(std::shared_ptr<const svmm::Volume> volume);
  const VolumeInfo& info() const { return volume_->info(); }
  const svmm::Volume& volume() const { return *volume_; }
  const LearnedVoid& learned() const { return *learned_; }

 private:
  std::shared_ptr<const svmm::Volume> volume_;
  std::shared_ptr<const LearnedVoid> learned_;
};

}  // namespace voxkit::render
