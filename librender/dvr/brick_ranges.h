// What values the bricks of a volume have, and which of them a transfer function leaves unseen.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "librender/cast/grid.h"
#include "librender/dvr/transfer.h"
#include "libsvmm/packed/packed.h"
#include "libsvmm/packed/page_ranges.h"
#include "libsvmm/svmm.h"
#include "libvq/vq.h"

namespace voxkit::render {

/// A brick is 4^3 voxels, (4i .. 4i + 3, ...). Samples whose cell of eight voxels begins in a brick see also
/// the voxels one further on.
inline constexpr int dvr_brick_log2 = 2, dvr_brick = 1 << dvr_brick_log2;

/// The least and the greatest value that samples in each brick can have. NaN and infinities count as nothing:
/// all samples beside one are void.
class BrickRanges {
 public:
  struct Range {
    float lo, hi;  ///< lo > hi: nothing but NaN and infinities
  };
  /// One pass over all voxels.
  static Result<BrickRanges> of(const DenseGrid& grid, Context& ctx);
  static Result<BrickRanges> of(const svmm::Volume& volume, Context& ctx);
  /// Of scalars, of the finest level that is there. Decodes all of it, unless the file says which values its
  /// pages have: then ranges are of whole pages.
  static Result<BrickRanges> of(const svmm::PackedVolume& volume, Context& ctx);
  /// Of the same volume, exact where a brick may be shown: decodes the pages of such bricks. As they are, if
  /// they are not of whole pages.
  Result<BrickRanges> finer(const svmm::PackedVolume& volume, const TransferFunction& transfer,
                            Context& ctx) const;
  /// From the records of the bricks, without decoding any. So a range is that of the brick and all of its
  /// neighbours that samples may reach.
  static Result<BrickRanges> of(const vq::Volume& volume, Context& ctx);

  Index3 bricks() const { return bricks_; }
  const Range& operator()(int64_t x, int64_t y, int64_t z) const {
    return ranges_[(z * bricks_.y + y) * bricks_.x + x];
  }
  /// Of all voxels; 0..0 where there are none but NaN and infinities.
  ValueRange all() const;

 private:
  static Result<BrickRanges> create(const VolumeInfo& info, Context& ctx);
  template <class Read>
  Status measure(const VolumeInfo& info, int64_t layers, const Read& read, Context& ctx);
  /// From pages to the bricks in them, with the voxels one further on.
  void spread_pages(std::span<const svmm::PageRanges::Range> pages, int64_t side, Index3 dims);
  /// From bricks alone to bricks and those next to them.
  Status spread(Context& ctx);

  Index3 bricks_{0};
  std::shared_ptr<Buffer> memory_;
  Range* ranges_ = nullptr;
  std::optional<ValueRange> all_;  ///< where ranges are of whole pages
};

/// For each brick, how far it is to the next one that can be seen: 0 where it can be seen itself, else all
/// bricks less than that many bricks away, in any direction, cannot. At most 255.
class BrickSkips {
 public:
  static Result<BrickSkips> create(const BrickRanges& ranges, const TransferFunction& transfer, Context& ctx);
  /// Of brick (0, 0, 0); there are bricks around the volume, too, one deep, which cannot be seen. At least 3
  /// bytes are behind the last.
  const uint8_t* distances() const { return reinterpret_cast<const uint8_t*>(memory_->data()) + first_; }
  /// All of the map.
  std::span<const uint8_t> bytes() const {
    return {reinterpret_cast<const uint8_t*>(memory_->data()), static_cast<size_t>(size_)};
  }
  /// From brick to brick along y, and along z.
  int64_t row() const { return row_; }
  int64_t slice() const { return slice_; }
  /// How many can be seen.
  int64_t visible() const { return visible_; }

 private:
  std::shared_ptr<Buffer> memory_;
  int64_t first_ = 0, row_ = 0, slice_ = 0, visible_ = 0, size_ = 0;
};

}  // namespace voxkit::render
