// Where the blocks of an opened volume are: chunks of the container, found by number, verified when first
// touched.
#pragma once

#include <vector>

#include "libsvmm/layout.h"

namespace voxkit::svmm {

struct Volume::Store {
  struct LevelStore {
    std::vector<size_t> chunks;  ///< indices into the container's table
    int chunk_log2 = 0;          ///< blocks to a chunk
    Index3 size{0};              ///< voxels of a block
  };
  std::vector<LevelStore> levels;

  /// The bytes of a block; ErrorCode::input if there is no such block or its chunk is damaged.
  Result<const std::byte*> block(const Volume& volume, size_t level, uint64_t number) const;
};

}  // namespace voxkit::svmm
