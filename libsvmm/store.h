// Where the blocks of an opened volume are: chunks of the container, found by number, verified when first
// touched.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "libsvmm/layout.h"

namespace voxkit::svmm {

/// A level, as a walk needs it.
struct LevelView {
  int shift = 0;               ///< log2 of the mip factor
  uint32_t within = 0;         ///< mask of a coordinate within its block
  int64_t row = 0, slice = 0;  ///< subblocks to a row and to a slice of a block
  Index3 size{0};              ///< voxels of a block
  uint32_t lookup_bytes = 0;   ///< that finding one voxel looks at: its link and value
};
/// What a walk needs to know of a volume, without pointers.
struct View {
  LevelView levels[max_levels];
  int root = 0;
  int log2_side = 0;  ///< of the least cube of a power of two that holds the volume
  /// By b: the lowest level whose blocks are at least 2^b base voxels wide, the root at most.
  uint8_t level_of_bits[34] = {};
  VoxelFormat format = VoxelFormat::rgba32;
  Layout layout = Layout::plain;
  Base base = Base::raw;
  int value_bytes = 0;
};

struct Store {
  struct LevelStore {
    uint64_t blocks = 0, block_bytes = 0;
    int chunk_log2 = 0;          ///< blocks to a chunk
    Index3 size{0};              ///< voxels of a block
    std::vector<size_t> chunks;  ///< indices into the container's table
    /// The bytes of each chunk once they have been verified.
    std::unique_ptr<std::atomic<const std::byte*>[]> found;
  };
  std::vector<LevelStore> levels;
  View view;

  /// The bytes of a block; ErrorCode::input if there is no such block or its chunk is damaged. Thread-safe.
  Result<const std::byte*> block(const Volume& volume, size_t level, uint64_t number) const;
  /// The same for walks, which go on: null, and an error is kept for `status`.
  [[gnu::cold]] const std::byte* block_or_null(const Volume& volume, int level, uint64_t number) const;
  /// The first error that a walk met.
  Status status() const;

 private:
  mutable std::mutex mutex_;
  mutable Status status_;
};

}  // namespace voxkit::svmm
