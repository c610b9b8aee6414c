// The chunks of a VQ file (FORMAT.md, section 3): kinds, the parameters, the view that follows from them.
#pragma once

#include <span>
#include <vector>

#include "libvq/view.h"

namespace voxkit::vq {

inline constexpr uint32_t params_kind = chunk_kind("VQPM");
inline constexpr uint32_t offsets_kind = chunk_kind("OFFS");
inline constexpr uint32_t addresses_kind = chunk_kind("ADDR");
inline constexpr uint32_t codebook_kind = chunk_kind("CODE");

/// Bricks, and blocks of bricks, along each axis.
inline Index3 bricks_of(Index3 dims) {
  return (dims + Index3(brick_edge - 1)) / Index3(brick_edge);
}
inline Index3 blocks_of(Index3 dims) {
  constexpr int edge = brick_edge * block_edge;
  return (dims + Index3(edge - 1)) / Index3(edge);
}
/// a ÷ b, rounded up.
constexpr uint64_t divide_up(uint64_t a, uint64_t b) {
  return a / b + (a % b != 0);
}
inline uint64_t product(Index3 v) {
  return static_cast<uint64_t>(v.x) * static_cast<uint64_t>(v.y) * static_cast<uint64_t>(v.z);
}

/// The chunk 'VQPM'; `common` is View::common.
std::vector<std::byte> pack_params(const Params& params, uint64_t common);
struct ParamsAndView {
  Params params;
  View view;
};
/// Its contents, each field as FORMAT.md allows it for this volume.
Result<ParamsAndView> unpack_params(std::span<const std::byte> bytes, const VolumeInfo& info,
                                    const std::string& file);

/// The bytes that a chunk must have. `least` and `most` differ where the contents decide.
struct ChunkSize {
  uint64_t least, most;
};
/// How many chunks of the kind there are; of the codebook with variable length, 0: as many as are there.
uint64_t chunk_count(uint32_t kind, const View& view);
ChunkSize chunk_size(uint32_t kind, uint64_t part, const View& view);

/// The voxel that a code stands for: base + step * code, of integers within what the format can hold.
Voxel voxel_of(uint16_t code, VoxelFormat format, double base, double step);

}  // namespace voxkit::vq
