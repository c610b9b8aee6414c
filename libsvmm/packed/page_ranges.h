// Which values the pages of level 0 have, about, without decoding them (FORMAT.md, section 2.6).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "formats/volume.h"
#include "libsvmm/packed/packed.h"

namespace voxkit::svmm {

/// Codes that stand for finite numbers, from the least to the greatest; least > greatest: none.
struct CodeRange {
  uint32_t least = 1, greatest = 0;
  bool empty() const { return least > greatest; }
  void add(const CodeRange& other);
};

/// Of the codes of a page. Codes: unsigned integers of 8, 16 or 32 bits.
template <class T>
CodeRange finite_range(std::span<const T> codes, const ValueMap& map);

/// The chunk, from the ranges of those pages that are not of one value, in order.
std::vector<std::byte> pack_ranges(std::span<const CodeRange> coded);

/// Values of pages of scalars: finite ones; lo > hi: there is none.
struct PageRanges {
  struct Range {
    float lo, hi;
  };
  ValueRange all{1, 0};      ///< exactly
  std::vector<Range> pages;  ///< of each at least what it has
};

/// The finite values of a box of scalars; lo > hi: none.
PageRanges::Range range_of(ConstVoxelSpan voxels, Index3 size, VoxelFormat format);
PageRanges::Range merged(const PageRanges::Range& a, const PageRanges::Range& b);

/// Of a file of scalars whose level 0 is there; nothing where it does not say. Touches the lengths of all
/// pages, and decodes none. Errors: ErrorCode::input.
Result<std::optional<PageRanges>> page_ranges(const PackedVolume& volume);

}  // namespace voxkit::svmm
