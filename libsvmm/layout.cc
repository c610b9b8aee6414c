#include "libsvmm/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "libsvmm/base_block.h"

namespace voxkit::svmm {
namespace {

constexpr size_t params_bytes = 64, level_bytes = 64;

bool reaches_root(Index3 dims, const Params& params) {
  const int64_t least = std::min({dims.x, dims.y, dims.z}), greatest = std::max({dims.x, dims.y, dims.z});
  return (params.layout == Layout::thesis ? least : greatest) <= params.rootwidth || greatest <= 2;
}

Index3 round_up_to_even(Index3 v) {
  return {(v.x + 1) & ~1, (v.y + 1) & ~1, (v.z + 1) & ~1};
}

int blockwidth(const Params& params, size_t level) {
  if (!params.blockwidths.empty()) return params.blockwidths[std::min(level, params.blockwidths.size() - 1)];
  return static_cast<int>(std::min<uint64_t>(uint64_t{2} << std::min<size_t>(level, 20), max_blockwidth));
}

}  // namespace

double delta_of_quality(double quality, VoxelFormat format, Layout layout) {
  const double delta = (100 - quality) / 100;
  return layout == Layout::thesis ? delta : std::sqrt(static_cast<double>(attributes(format))) * delta;
}

Status validate(const Params& params, const VolumeInfo& info) {
  const auto f = info.format;
  for (int w : params.blockwidths)
    if (w < 2 || w > max_blockwidth || !std::has_single_bit(static_cast<unsigned>(w)))
      return bad_usage(
          fmt::format("--blockwidth {}: expected a power of two from 2 to {}", w, max_blockwidth));
  if (params.rootwidth < 1)
    return bad_usage(fmt::format("--rootwidth {}: expected at least 1", params.rootwidth));
  if (!(params.delta >= 0) || !std::isfinite(params.delta))
    return bad_usage(fmt::format("--delta {}: expected a number from 0", params.delta));
  if (!(params.full_scale > 0) || !std::isfinite(params.full_scale))
    return bad_usage(fmt::format("full scale {}: expected a number above 0", params.full_scale));
  if (params.layout == Layout::thesis && !is_color(f) && f != VoxelFormat::density8)
    return bad_usage(fmt::format(
        "--layout thesis: {} has no published layout: expected RGBA32, RGB24 or DENSITY8", type_name(info)));
  if (params.base == Base::alpha && f != VoxelFormat::rgba32)
    return bad_usage(fmt::format("--base alpha: {} has no alpha: expected RGBA32", type_name(info)));
  if ((params.base == Base::gray || params.base == Base::bc1) && !is_color(f))
    return bad_usage(fmt::format("--base {}: {} has no colour: expected RGBA32 or RGB24",
                                 params.base == Base::gray ? "gray" : "bc1", type_name(info)));
  if ((info.is_labels || info.labels) &&
      (params.delta > 0 || params.base != Base::raw || params.layout != Layout::plain))
    return bad_usage(
        info.is_labels
            ? "labels have no values between them: expected --quality 100, with --layout plain and "
              "--base raw, or --layout packed"
            : "values that are 65536 and more apart are held by a table, which has no steps: expected "
              "--quality 100, with --layout plain and --base raw, or --layout packed");
  if (params.base == Base::bc1 && blockwidth(params, 0) < 4)
    return bad_usage(
        "--base bc1: tiles of 4x4 voxels need a base blockwidth of 4 or more: use --blockwidth 4, say");
  return {};
}

uint64_t structural_block_bytes(uint64_t voxels, VoxelFormat f, Layout layout) {
  return layout == Layout::thesis
             ? voxels * static_cast<unsigned>(word_bytes(f))
             : voxels * static_cast<unsigned>(value_bytes(f)) + voxels / 8 * sizeof(uint64_t);
}

int blocks_per_chunk_log2(uint64_t block_bytes) {
  int log2 = 0;
  while (block_bytes <= (uint64_t{1} << 20) >> (log2 + 1)) ++log2;
  return log2;
}

std::vector<Level> plan_levels(const VolumeInfo& info, const Params& params) {
  std::vector<Level> levels;
  Index3 dims = round_up_to_even(info.dims);
  uint64_t mip_factor = 1;
  while (!reaches_root(dims, params)) {
    const int w = blockwidth(params, levels.size());
    const uint64_t voxels = static_cast<uint64_t>(w) * static_cast<uint64_t>(w) * static_cast<uint64_t>(w);
    const uint64_t bytes = levels.empty()
                               ? base_block_bytes(voxels, w, info.format, params.base, params.layout)
                               : structural_block_bytes(voxels, info.format, params.layout);
    levels.push_back({static_cast<uint32_t>(w), mip_factor, dims, 0, bytes, 0});
    dims = round_up_to_even((dims + Index3(w - 1)) / Index3(w));
    mip_factor *= static_cast<uint64_t>(w);
  }
  const uint64_t voxels =
      static_cast<uint64_t>(dims.x) * static_cast<uint64_t>(dims.y) * static_cast<uint64_t>(dims.z);
  uint64_t bytes = ~uint64_t{0};  // what a root past 2^60 voxels may take: no file holds it, no memory either
  if (voxels <= uint64_t{1} << 60)
    bytes = levels.empty() ? base_block_bytes(voxels, 0, info.format, Base::raw, params.layout)
                           : structural_block_bytes(voxels, info.format, params.layout);
  levels.push_back({0, mip_factor, dims, 1, bytes, 0});
  return levels;
}

uint64_t thesis_bytes(std::span<const Level> levels) {
  uint64_t bytes = 64 + 24 * levels.size();
  for (const Level& level : levels) bytes += level.blocks * level.block_bytes;
  return bytes;
}

std::vector<std::byte> pack_params(const Params& params, std::span<const Level> levels) {
  std::vector<std::byte> bytes(params_bytes + levels.size() * level_bytes);
  bytes[0] = static_cast<std::byte>(params.layout);
  bytes[1] = static_cast<std::byte>(params.base);
  bytes[2] = static_cast<std::byte>(params.bound);
  bytes[3] = static_cast<std::byte>(params.alpha_weight);
  store_le(&bytes[4], static_cast<uint32_t>(levels.size()));
  store_le(&bytes[8], static_cast<uint64_t>(params.rootwidth));
  store_le(&bytes[16], params.quality);
  store_le(&bytes[24], params.delta);
  store_le(&bytes[32], params.full_scale);
  for (size_t k = 0; k < levels.size(); ++k) {
    std::byte* p = &bytes[params_bytes + k * level_bytes];
    const Level& level = levels[k];
    store_le(p, level.blockwidth);
    store_le(p + 4, static_cast<uint32_t>(blocks_per_chunk_log2(level.block_bytes)));
    store_le(p + 8, level.mip_factor);
    for (int i = 0; i < 3; ++i) store_le(p + 16 + 8 * i, static_cast<uint64_t>(level.dims[i]));
    store_le(p + 40, level.blocks);
    store_le(p + 48, level.block_bytes);
    store_le(p + 56, level.terminal_voxels);
  }
  return bytes;
}

Result<ParamsAndLevels> unpack_params(std::span<const std::byte> bytes, const VolumeInfo& info,
                                      const std::string& file) {
  auto bad = [&](size_t at, const std::string& what) {
    return bad_input(file, fmt::format("chunk SVMP, byte {}: {}", at, what));
  };
  if (bytes.size() < params_bytes) return bad(bytes.size(), "ends here: expected 64 bytes or more");
  ParamsAndLevels out;
  Params& params = out.params;
  const auto field = [&](size_t at) { return std::to_integer<int>(bytes[at]); };
  if (field(0) < 1 || field(0) > 2) return bad(0, fmt::format("unknown layout {}", field(0)));
  if (field(1) < 1 || field(1) > 5) return bad(1, fmt::format("unknown base {}", field(1)));
  if (field(2) < 1 || field(2) > 2) return bad(2, fmt::format("unknown bound {}", field(2)));
  if (field(3) > 1) return bad(3, fmt::format("alpha weight {}: expected 0 or 1", field(3)));
  params.layout = static_cast<Layout>(field(0));
  params.base = static_cast<Base>(field(1));
  params.bound = static_cast<Bound>(field(2));
  params.alpha_weight = field(3) == 1;
  const auto count = load_le<uint32_t>(&bytes[4]);
  if (count < 1 || count > uint32_t{max_levels} || bytes.size() != params_bytes + count * level_bytes)
    return bad(4, fmt::format("{} levels in a chunk of {} bytes: expected 64 bytes and 64 a level", count,
                              bytes.size()));
  if (count == 1 && params.base != Base::raw)
    return bad(1, fmt::format("base {} in a volume of one level: expected 1 (raw)", field(1)));
  params.rootwidth =
      static_cast<int64_t>(std::min<uint64_t>(load_le<uint64_t>(&bytes[8]), uint64_t{1} << 62));
  params.quality = load_le<double>(&bytes[16]);
  params.delta = load_le<double>(&bytes[24]);
  params.full_scale = load_le<double>(&bytes[32]);
  if (!(params.delta >= 0) || !std::isfinite(params.delta))
    return bad(24, fmt::format("delta {}: expected 0 or more", params.delta));
  if (!(params.full_scale > 0) || !std::isfinite(params.full_scale))
    return bad(32, fmt::format("full scale {}: expected more than 0", params.full_scale));
  for (uint32_t k = 0; k < count; ++k) {
    const std::byte* p = &bytes[params_bytes + k * level_bytes];
    Level level;
    level.blockwidth = load_le<uint32_t>(p);
    level.mip_factor = load_le<uint64_t>(p + 8);
    for (int i = 0; i < 3; ++i) level.dims[i] = static_cast<int64_t>(load_le<uint64_t>(p + 16 + 8 * i));
    level.blocks = load_le<uint64_t>(p + 40);
    level.block_bytes = load_le<uint64_t>(p + 48);
    level.terminal_voxels = load_le<uint64_t>(p + 56);
    if (k + 1 < count) {
      if (level.blockwidth > static_cast<uint32_t>(max_blockwidth))
        return bad(params_bytes + k * level_bytes,
                   fmt::format("blockwidth {} of level {}", level.blockwidth, k));
      params.blockwidths.push_back(static_cast<int>(level.blockwidth));
    }
    out.levels.push_back(level);
  }
  // The widths determine everything else; what the file says must be that.
  if (auto valid = validate(params, info); !valid) return bad(0, valid.error().what);
  const auto expected = plan_levels(info, params);
  if (expected.size() != count) return bad(4, fmt::format("{} levels: expected {}", count, expected.size()));
  for (uint32_t k = 0; k < count; ++k) {
    const Level &a = out.levels[k], &b = expected[k];
    if (a.blockwidth != b.blockwidth || a.mip_factor != b.mip_factor || a.dims != b.dims ||
        a.block_bytes != b.block_bytes ||
        load_le<uint32_t>(&bytes[params_bytes + k * level_bytes + 4]) !=
            static_cast<uint32_t>(blocks_per_chunk_log2(b.block_bytes)) ||
        (k + 1 == count && a.blocks != 1))
      return bad(params_bytes + k * level_bytes,
                 fmt::format("level {} does not follow from the dimensions and block widths", k));
  }
  return out;
}

}  // namespace voxkit::svmm
