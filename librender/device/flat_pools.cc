#include "librender/device/flat_pools.h"

namespace voxkit::render {

Result<FlatBlocks> upload_blocks(const svmm::Volume& volume, const Backend& backend, Context& ctx) {
  FlatBlocks flat;
  const auto& levels = volume.store().levels;
  for (size_t k = 0; k < levels.size(); ++k) {
    const svmm::Store::LevelStore& level = levels[k];
    VOX_TRY(auto blocks,
            backend.allocate<std::byte>(level.blocks * level.block_bytes, "a level of blocks", ctx));
    uint64_t at = 0;
    for (const size_t chunk : level.chunks) {
      VOX_TRY(const auto piece, volume.container().chunk(chunk));
      VOX_CHECK(backend.fill(blocks, at, piece));
      at += piece.size();
    }
    flat.pools.levels[k] = {blocks.data(), level.blocks, level.block_bytes};
    flat.levels.push_back(std::move(blocks));
  }
  return flat;
}

}  // namespace voxkit::render
