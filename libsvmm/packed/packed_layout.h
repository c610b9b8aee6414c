// The chunks of layout packed (FORMAT.md, section 2.6): parameters, models, and parts, which hold runs of
// pages behind their lengths.
#pragma once

#include <algorithm>
#include <glm/common.hpp>
#include <span>
#include <string>
#include <vector>

#include "formats/container.h"
#include "libpage/page.h"
#include "libsvmm/packed/packed.h"

namespace voxkit::svmm {

inline constexpr uint32_t packed_kind = chunk_kind("PAKP");
/// Index: level; it is the model of coarser levels, too, up to the next that has one.
inline constexpr uint32_t model_kind = chunk_kind("MODL");
/// Of scalars: which values the pages of level 0 have (page_ranges.h).
inline constexpr uint32_t ranges_kind = chunk_kind("RNGE");
inline constexpr uint32_t pages_kind = chunk_kind("PAGE");  ///< index: level; part: run of pages
/// Of colours: the masks of pages and their model, as those two. MODL has a part for each channel.
inline constexpr uint32_t mask_kind = chunk_kind("MASK");
inline constexpr uint32_t mask_model_kind = chunk_kind("MMOD");
/// Of indexed colours: these.
inline constexpr uint32_t color_table_kind = chunk_kind("CTAB");

inline Index3 level_dims(Index3 dims, int level) {
  const int64_t factor = int64_t{1} << level;
  return (dims + (factor - 1)) / factor;
}
/// Levels of a volume, down to one that fits into a page.
int level_count(Index3 dims, int page_side);

/// The pages of a level, in raster order, x fastest.
struct PageGrid {
  PageGrid() = default;
  PageGrid(Index3 level_dims, int page_side)
      : dims(level_dims),
        side(page_side),
        count((level_dims + int64_t{page_side - 1}) / int64_t{page_side}) {}
  Index3 dims{0};
  int64_t side = 16;
  Index3 count{0};
  uint64_t pages() const { return static_cast<uint64_t>(count.x * count.y * count.z); }
  uint64_t number(Index3 page) const {
    return static_cast<uint64_t>((page.z * count.y + page.y) * count.x + page.x);
  }
  Index3 index(uint64_t number) const {
    const auto n = static_cast<int64_t>(number);
    return {n % count.x, n / count.x % count.y, n / (count.x * count.y)};
  }
  Box box(uint64_t number) const {
    const Index3 lo = index(number) * side;
    return {lo, glm::min(lo + side, dims)};
  }
  page::Extent extent(uint64_t number) const {
    const Index3 size = box(number).size();
    return {static_cast<int>(size.x), static_cast<int>(size.y), static_cast<int>(size.z)};
  }
  /// Pages of a part: 2^19 voxels.
  uint64_t pages_a_part() const { return (uint64_t{1} << 19) / static_cast<uint64_t>(side * side * side); }
  uint64_t parts() const { return (pages() + pages_a_part() - 1) / pages_a_part(); }
  uint64_t pages_of(uint64_t part) const { return std::min(pages_a_part(), pages() - part * pages_a_part()); }
};

/// Pages that a model is fitted to.
inline constexpr uint64_t most_sampled_pages = 512;
/// Numbers of `most` of so many pages, spread over them and not on a grid of rows, whose content would be
/// alike; all of them where there are no more.
std::vector<uint64_t> spread_pages(uint64_t pages, uint64_t most);
/// Runs of pages [first, last) that are in one row, none very long.
std::vector<std::pair<uint64_t, uint64_t>> runs_of(const PageGrid& grid, uint64_t first, uint64_t last);

/// Where the parents of page `child` lie in their page, which is number `above.number(child / 2)` of the
/// level above; without samples.
template <class T>
page::Parent<T> placed(Index3 child, const PageGrid& above) {
  const Index3 at = child % int64_t{2} * (above.side / 2);
  return {{},
          above.extent(above.number(child / int64_t{2})),
          static_cast<int>(at.x),
          static_cast<int>(at.y),
          static_cast<int>(at.z)};
}

std::vector<std::byte> pack_params(const PackedParams& params);
/// Errors: ErrorCode::input, naming `file`.
Result<PackedParams> unpack_packed_params(std::span<const std::byte> bytes, const VolumeInfo& info,
                                          const std::string& file);

/// A part: a byte that says how many bits a length has, the lengths of its pages, each in so many bits,
/// lowest first, zero bits up to a whole byte, and the pages.
std::vector<std::byte> pack_part(std::span<const std::vector<std::byte>> pages);

/// The pages of a part, by their lengths. Safe on any bytes.
class PartView {
 public:
  PartView(std::span<const std::byte> bytes, uint64_t pages);
  /// Whether the lengths are there, and add up to the bytes behind them.
  bool valid() const;
  /// Of a valid one.
  std::span<const std::byte> page(uint64_t number) const;

 private:
  uint64_t length(uint64_t number) const;
  std::span<const std::byte> bytes_;
  uint64_t pages_;
  uint32_t bits_ = 0;
  uint64_t head_ = 0;  ///< bytes before the pages
};

}  // namespace voxkit::svmm
