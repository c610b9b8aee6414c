// The chunks of a VQ file, each kind in one piece: how a device wants them.
#pragma once

#include <span>
#include <vector>

#include "librender/device/warp_bricks.h"
#include "libvq/store.h"

namespace voxkit::render {

/// The chunks of a VQ file in one piece of memory each kind, with vq::read_slack bytes behind each chunk.
struct FlatVqPools {
  struct Section {
    const std::byte* bytes;
    const uint64_t* starts;  ///< of the chunks, and the end
    uint64_t parts;
    VOX_HD_HOT vq::Bytes operator()(uint64_t part) const {
      if (part >= parts) return {};
      return {bytes + starts[part], starts[part + 1] - starts[part] - vq::read_slack};
    }
  };
  Section offset_chunks, address_chunks, codebook_chunks;
  VOX_HD_HOT vq::Bytes offsets(uint64_t part) const { return offset_chunks(part); }
  VOX_HD_HOT vq::Bytes addresses(uint64_t part) const { return address_chunks(part); }
  VOX_HD_HOT vq::Bytes codebook(uint64_t part) const { return codebook_chunks(part); }
};

/// Copies every chunk, verified: `allocate(bytes) -> Result<std::byte*>` gives memory that is aligned for
/// anything, `copy(to, span) -> Status` fills it piece by piece. Errors: theirs, and ErrorCode::input.
template <class Allocate, class Copy>
Result<FlatVqPools> flatten(const vq::Volume& volume, const Allocate& allocate, const Copy& copy) {
  const auto section = [&](const vq::Store::Section& from) -> Result<FlatVqPools::Section> {
    std::vector<uint64_t> starts = {0};
    for (const uint64_t size : from.sizes) starts.push_back(starts.back() + size + vq::read_slack);
    VOX_TRY(std::byte* const bytes, allocate(starts.back() + vq::read_slack));
    for (size_t part = 0; part < from.chunks.size(); ++part) {
      VOX_TRY(const auto chunk, volume.container().chunk(from.chunks[part]));
      VOX_CHECK(copy(bytes + starts[part], chunk));
    }
    const auto table = std::as_bytes(std::span(starts));
    VOX_TRY(std::byte* const copied, allocate(table.size()));
    VOX_CHECK(copy(copied, table));
    return FlatVqPools::Section{bytes, reinterpret_cast<const uint64_t*>(copied), from.chunks.size()};
  };
  FlatVqPools pools{};
  VOX_TRY(pools.offset_chunks, section(volume.store().offsets));
  VOX_TRY(pools.address_chunks, section(volume.store().addresses));
  VOX_TRY(pools.codebook_chunks, section(volume.store().codebook));
  return pools;
}
/// What the codes of a volume stand for, for a device.
inline CodeValues code_values(const vq::Volume& volume) {
  const VoxelFormat format = volume.info().format;
  return {volume.params().base, volume.params().step,
          format == VoxelFormat::density16 ? 65535.0
          : format == VoxelFormat::bitmap  ? 1.0
                                           : 255.0,
          format == VoxelFormat::float32};
}

}  // namespace voxkit::render
