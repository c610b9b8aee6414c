#include "librender/device/vq_flat_pools.h"

namespace voxkit::render {

Result<FlatChunks> upload_chunks(const vq::Volume& volume, const Backend& backend, Context& ctx) {
  FlatChunks flat;
  const auto section = [&](const vq::Store::Section& from) -> Result<FlatVqPools::Section> {
    std::vector<uint64_t> starts = {0};
    for (const uint64_t size : from.sizes) starts.push_back(starts.back() + size + vq::read_slack);
    VOX_TRY(auto bytes, backend.allocate<std::byte>(starts.back() + vq::read_slack, "chunks of bricks", ctx));
    for (size_t part = 0; part < from.chunks.size(); ++part) {
      VOX_TRY(const auto chunk, volume.container().chunk(from.chunks[part]));
      VOX_CHECK(backend.fill(bytes, starts[part], chunk));
    }
    VOX_TRY(auto table, backend.upload(std::span<const uint64_t>(starts), "a table of chunks", ctx));
    const FlatVqPools::Section to{bytes.data(), table.data(), from.chunks.size()};
    flat.chunks.push_back(std::move(bytes));
    flat.starts.push_back(std::move(table));
    return to;
  };
  VOX_TRY(flat.pools.offset_chunks, section(volume.store().offsets));
  VOX_TRY(flat.pools.address_chunks, section(volume.store().addresses));
  VOX_TRY(flat.pools.codebook_chunks, section(volume.store().codebook));
  return flat;
}

CodeValues code_values(const vq::Volume& volume) {
  const VoxelFormat format = volume.info().format;
  return {volume.params().base, volume.params().step,
          format == VoxelFormat::density16 ? 65535.0
          : format == VoxelFormat::bitmap  ? 1.0
                                           : 255.0,
          format == VoxelFormat::float32};
}

}  // namespace voxkit::render
