// The blocks of a compressed volume, each level in one piece: how a device wants them.
#pragma once

#include "libsvmm/walk.h"

namespace voxkit::render {

/// Copies every level's blocks: `allocate(bytes) -> Result<std::byte*>` gives the memory of a level,
/// `copy(to, span) -> Status` fills it piece by piece, each verified. Errors: theirs, and ErrorCode::input.
template <class Allocate, class Copy>
Result<svmm::FlatPools> flatten(const svmm::Volume& volume, const Allocate& allocate, const Copy& copy) {
  svmm::FlatPools pools{};
  const auto& levels = volume.store().levels;
  for (size_t k = 0; k < levels.size(); ++k) {
    const svmm::Store::LevelStore& level = levels[k];
    VOX_TRY(std::byte* const bytes, allocate(level.blocks * level.block_bytes));
    std::byte* to = bytes;
    for (const size_t chunk : level.chunks) {
      VOX_TRY(const auto piece, volume.container().chunk(chunk));
      VOX_CHECK(copy(to, piece));
      to += piece.size();
    }
    pools.levels[k] = {bytes, level.blocks, level.block_bytes};
  }
  return pools;
}

}  // namespace voxkit::render
