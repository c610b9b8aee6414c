// How the voxels of a base-level block are stored (thesis section 2.1.1, last paragraph; FORMAT.md,
// section 2.5).
#pragma once

#include <span>
#include <vector>

#include "libsvmm/layout.h"

namespace voxkit::svmm {

/// Bytes of a base-level block of `voxels` voxels and width w.
uint64_t base_block_bytes(uint64_t voxels, int w, VoxelFormat f, Base base, Layout layout);

/// Appends one block. `voxels` holds its voxels in block order (see subblock_index), voxel_bytes(f) each,
/// zero outside the volume. `size` is the block's extent: w in each direction, or the whole level.
void encode_base_block(const std::byte* voxels, Index3 size, VoxelFormat f, Base base, Layout layout,
                       std::vector<std::byte>& out);

/// Writes the voxels of one block, in block order. `parent` is its equivalent voxel in the level above.
void decode_base_block(const std::byte* block, Index3 size, VoxelFormat f, Base base, Layout layout,
                       const Voxel& parent, std::byte* voxels);

}  // namespace voxkit::svmm
