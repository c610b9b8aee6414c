// Which bytes of a file a view needs, for readers that fetch ranges.
#pragma once

#include <cstdint>
#include <vector>

#include "libsvmm/packed/packed.h"

namespace voxkit::svmm {

/// Bytes of a file, half open.
struct NeededRange {
  static constexpr int index = -1;
  int level = index;  ///< whose pages they are; `index`: header, tables, parameters and models
  uint64_t begin = 0, end = 0;
};

/// What opening a file and decoding `box`, in voxels of level 0 and inside its dims, at `level` read of it,
/// in the order to fetch it in: index, then the coarsest level to `level`, each by ascending bytes. Whole
/// chunks, as checksums are of these; so all coarser levels of that box are there, too. `level` is one that
/// the file has. Bytes that are in no range may be anything.
std::vector<NeededRange> needed_ranges(const PackedVolume& volume, const Box& box, int level);

}  // namespace voxkit::svmm
