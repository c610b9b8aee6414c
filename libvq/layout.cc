#include "libvq/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace voxkit::vq {
namespace {

constexpr size_t params_bytes = 128;

bool is_whole(double v, double least, double most) {
  return v >= least && v <= most && v == std::floor(v);
}

}  // namespace

std::vector<std::byte> pack_params(const Params& params, uint64_t common) {
  std::vector<std::byte> bytes(params_bytes);
  bytes[0] = static_cast<std::byte>(params.codebook);
  bytes[1] = static_cast<std::byte>(params.mapping);
  bytes[2] = static_cast<std::byte>(params.bits);
  bytes[3] = static_cast<std::byte>(!params.seeding ? 0 : *params.seeding == Seeding::furthest ? 1 : 2);
  store_le(&bytes[4], params.iterations);
  store_le(&bytes[8], params.codewords);
  store_le(&bytes[16], common);
  store_le(&bytes[24], params.base);
  store_le(&bytes[32], params.step);
  store_le(&bytes[40], params.max_error);
  store_le(&bytes[48], params.unique_bricks);
  store_le(&bytes[56], params.offset_bytes);
  store_le(&bytes[64], params.codebook_bytes);
  store_le(&bytes[72], static_cast<uint32_t>(params.offset_bits));
  store_le(&bytes[76], params.special ? uint32_t{*params.special} + 1 : 0);
  return bytes;
}

Result<ParamsAndView> unpack_params(std::span<const std::byte> bytes, const VolumeInfo& info,
                                    const std::string& file) {
  const auto bad = [&](size_t at, const std::string& what) {
    return bad_input(file, fmt::format("chunk VQPM, byte {}: {}", at, what));
  };
  if (bytes.size() != params_bytes) return bad(bytes.size(), "ends here: expected 128 bytes");
  if (is_color(info.format))
    return bad_input(
        file, fmt::format("chunk VOLI, byte 24: voxel format {}: expected a scalar one", name(info.format)));
  const auto field = [&](size_t at) { return std::to_integer<int>(bytes[at]); };
  const auto number = [&](size_t at) { return load_le<uint64_t>(&bytes[at]); };
  if (field(0) < 1 || field(0) > 2) return bad(0, fmt::format("unknown codebook {}", field(0)));
  if (field(1) < 1 || field(1) > 2) return bad(1, fmt::format("unknown mapping {}", field(1)));
  if (field(2) < 1 || field(2) > 16)
    return bad(2, fmt::format("codes of {} bits: expected 1 to 16", field(2)));
  ParamsAndView out;
  Params& p = out.params;
  p.codebook = static_cast<Codebook>(field(0));
  p.mapping = static_cast<Mapping>(field(1));
  p.bits = field(2);
  if (field(3) == 1 || field(3) == 2) p.seeding = field(3) == 1 ? Seeding::furthest : Seeding::d2;
  p.iterations = load_le<uint32_t>(&bytes[4]);
  p.codewords = number(8);
  const uint64_t common = number(16);
  p.base = load_le<double>(&bytes[24]);
  p.step = load_le<double>(&bytes[32]);
  p.max_error = load_le<double>(&bytes[40]);
  p.unique_bricks = number(48);
  p.offset_bytes = number(56);
  p.codebook_bytes = number(64);
  p.offset_bits = static_cast<int>(std::min<uint32_t>(load_le<uint32_t>(&bytes[72]), widest_entry));
  if (const auto special = load_le<uint32_t>(&bytes[76]); special > 0) {
    if (special > 1u << p.bits || (info.format != VoxelFormat::float32 && !info.fill))
      return bad(76, fmt::format("code {} for no value: expected one of {} bits, and a fill value",
                                 special - 1, p.bits));
    p.special = static_cast<uint16_t>(special - 1);
  }
  if (p.codebook == Codebook::packed && p.mapping == Mapping::direct)
    return bad(1, "a packed codebook mapped directly: expected mapping 2 (indirect)");
  const uint64_t bricks = product(bricks_of(info.dims));
  if (p.codewords < 1 || p.codewords > bricks)
    return bad(8, fmt::format("{} codewords for {} bricks: expected 1 to as many", p.codewords, bricks));
  if (info.format == VoxelFormat::float32) {
    if (!std::isfinite(p.base)) return bad(24, fmt::format("base {}: expected a finite number", p.base));
    if (!(p.step > 0) || !std::isfinite(p.step))
      return bad(32, fmt::format("step {}: expected a finite number above 0", p.step));
  } else {
    if (!is_whole(p.base, -65535, 131070))
      return bad(24, fmt::format("base {}: expected a whole number from -65535 to 131070", p.base));
    if (!is_whole(p.step, 1, 131071))
      return bad(32, fmt::format("step {}: expected a whole number from 1 to 131071", p.step));
  }

  View& view = out.view;
  const Index3 brick_grid = bricks_of(info.dims), block_grid = blocks_of(info.dims);
  for (int i = 0; i < 3; ++i) {
    view.bricks[i] = static_cast<uint32_t>(brick_grid[i]);
    view.blocks[i] = static_cast<uint32_t>(block_grid[i]);
  }
  view.codebook = p.codebook;
  view.mapping = p.mapping;
  view.bits = p.bits;
  view.range_bytes = range_bytes(p.bits);
  view.packed_bytes = packed_bytes(p.bits);
  view.packed_chunk_log2 = packed_chunk_log2(p.bits);
  view.codewords = p.codewords;
  view.common = common;
  view.base = p.base;
  view.step = p.step;
  return out;
}

uint64_t chunk_count(uint32_t kind, const View& view) {
  if (kind == offsets_kind)
    return divide_up(uint64_t{view.blocks[0]} * view.blocks[1] * view.blocks[2],
                     uint64_t{1} << block_chunk_log2);
  if (kind == addresses_kind)
    return view.codebook == Codebook::rbuc && view.mapping == Mapping::indirect
               ? divide_up(view.codewords, uint64_t{1} << (group_log2 + group_chunk_log2))
               : 0;
  return view.codebook == Codebook::packed ? divide_up(view.codewords, uint64_t{1} << view.packed_chunk_log2)
                                           : 0;
}

ChunkSize chunk_size(uint32_t kind, uint64_t part, const View& view) {
  if (kind == offsets_kind) {
    const uint64_t blocks = uint64_t{view.blocks[0]} * view.blocks[1] * view.blocks[2];
    const uint64_t here = std::min(blocks - (part << block_chunk_log2), uint64_t{1} << block_chunk_log2);
    const uint64_t headers = (here + 1) * block_header;
    return {headers, headers + here * (widest_entry * block_bricks / 8)};
  }
  if (kind == addresses_kind) {
    const uint64_t groups = divide_up(view.codewords, group_bricks) - (part << group_chunk_log2);
    const uint64_t bytes = std::min(groups, uint64_t{1} << group_chunk_log2) * group_bytes;
    return {bytes, bytes};
  }
  if (view.codebook == Codebook::packed) {
    const uint64_t bricks = view.codewords - (part << view.packed_chunk_log2);
    const uint64_t bytes =
        std::min(bricks, uint64_t{1} << view.packed_chunk_log2) * static_cast<uint64_t>(view.packed_bytes);
    return {bytes, bytes};
  }
  return {1, uint64_t{1} << address_chunk_log2};
}

Voxel voxel_of(uint16_t code, VoxelFormat format, double base, double step) {
  const double value = base + step * code;
  switch (format) {
    case VoxelFormat::float32:
      return Voxel::of(static_cast<float>(value));
    case VoxelFormat::density16:
      return Voxel::of(static_cast<uint16_t>(std::clamp(value, 0.0, 65535.0)));
    case VoxelFormat::bitmap:
      return Voxel::of(static_cast<uint8_t>(std::clamp(value, 0.0, 1.0)));
    default:
      return Voxel::of(static_cast<uint8_t>(std::clamp(value, 0.0, 255.0)));
  }
}

}  // namespace voxkit::vq
