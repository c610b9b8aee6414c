#include "libcolor/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "formats/little_endian.h"
#include "libcolor/palette/palette.h"
#include "libcolor/part_codecs.h"
#include "libcolor/textures/astc.h"
#include "libcolor/textures/texture.h"

namespace voxkit::color {
namespace {

constexpr size_t params_bytes = 128;

}  // namespace

int height_of(Index3 dims) {
  const auto longest = static_cast<uint64_t>(std::max({dims.x, dims.y, dims.z}));
  return std::max(leaf_height, static_cast<int>(std::bit_width(longest - 1)));
}

std::vector<std::byte> pack_params(const Params& p) {
  std::vector<std::byte> bytes(params_bytes);
  bytes[0] = static_cast<std::byte>(p.codec);
  bytes[1] = static_cast<std::byte>(p.colors);
  bytes[2] = static_cast<std::byte>(p.counts);
  bytes[3] = static_cast<std::byte>(p.endpoints);
  bytes[4] = static_cast<std::byte>(p.height);
  bytes[5] = static_cast<std::byte>(p.weight_bits);
  bytes[6] = static_cast<std::byte>(p.curve);
  if (makes_textures(p.codec) || makes_images(p.codec)) bytes[7] = static_cast<std::byte>(p.image_curve);
  if (p.codec == ColorCodec::astc) {
    bytes[88] = static_cast<std::byte>(p.block_size.width);
    bytes[89] = static_cast<std::byte>(p.block_size.height);
  }
  bytes[90] = static_cast<std::byte>(p.space);
  bytes[91] = static_cast<std::byte>(p.geometry);
  for (size_t i = 0; i < attribute_kinds.size(); ++i)
    if (p.attributes.has(static_cast<Attribute>(i))) bytes[92] |= static_cast<std::byte>(1 << i);
  store_le(&bytes[8], p.leaf_voxels);
  store_le(&bytes[16], p.color_count);
  store_le(&bytes[24], p.root);
  store_le(&bytes[28], p.palette_colors);
  store_le(&bytes[32], p.threshold);
  store_le(&bytes[40], p.grmse);
  store_le(&bytes[48], p.dag_nodes);
  store_le(&bytes[56], p.dag_bytes);
  store_le(&bytes[64], p.color_bytes);
  store_le(&bytes[72], p.macro_blocks);
  store_le(&bytes[80], p.blocks);
  store_le(&bytes[96], p.simplify);
  store_le(&bytes[104], p.hausdorff);
  return bytes;
}

Result<Params> unpack_params(std::span<const std::byte> bytes, const VolumeInfo& info,
                             const std::string& file) {
  const auto bad = [&](size_t at, const std::string& what) {
    return bad_input(file, fmt::format("chunk DAGP, byte {}: {}", at, what));
  };
  if (bytes.size() != params_bytes) return bad(bytes.size(), "ends here: expected 128 bytes");
  if (info.format != VoxelFormat::rgba32)
    return bad_input(file,
                     fmt::format("chunk VOLI, byte 24: voxel format {}: expected RGBA32", name(info.format)));
  const auto field = [&](size_t at) { return std::to_integer<int>(bytes[at]); };
  const auto number = [&](size_t at) { return load_le<uint64_t>(&bytes[at]); };
  const auto is_one_of = [&](size_t at, int most, const char* what) -> Status {
    if (field(at) >= 1 && field(at) <= most) return {};
    return bad(at, fmt::format("unknown {} {}", what, field(at)));
  };
  VOX_CHECK(is_one_of(0, most_codec_number(), "color codec"));
  VOX_CHECK(is_one_of(1, 2, "choice of colors"));
  VOX_CHECK(is_one_of(2, 2, "place of counts"));
  VOX_CHECK(is_one_of(3, 2, "kind of endpoints"));
  VOX_CHECK(is_one_of(6, 2, "curve"));
  Params p;
  p.codec = static_cast<ColorCodec>(field(0));
  p.colors = static_cast<Colors>(field(1));
  p.counts = static_cast<Counts>(field(2));
  p.endpoints = static_cast<Endpoints>(field(3));
  p.curve = static_cast<Curve>(field(6));
  if (makes_textures(p.codec) || makes_images(p.codec)) {
    VOX_CHECK(is_one_of(7, 2, "curve of images"));
    p.image_curve = static_cast<ImageCurve>(field(7));
    if (const Status support = texture_support(p.codec); !support)
      return bad_input(file, support.error().what);
  }
  if (p.codec == ColorCodec::astc) {
    p.block_size = {std::to_integer<uint32_t>(bytes[88]), std::to_integer<uint32_t>(bytes[89])};
    const auto sizes = astc_block_sizes();
    if (std::find(sizes.begin(), sizes.end(), p.block_size) == sizes.end())
      return bad(
          88, fmt::format("blocks of {} x {}: not a size of ASTC", p.block_size.width, p.block_size.height));
  }
  if (p.codec == ColorCodec::predicted && (p.colors != Colors::leaf || p.curve != Curve::morton))
    return bad(0, "predicted colors of nodes, or along a Hilbert curve");
  p.space = field(90) == 1 ? ErrorSpace::lab : ErrorSpace::rgb;
  p.geometry = static_cast<Geometry>(field(91));
  if (p.geometry > Geometry::octree) return bad(91, fmt::format("unknown geometry {}", field(91)));
  if (p.geometry == Geometry::ssvdag && p.counts == Counts::pointer)
    return bad(2, "counts beside pointers, which nodes with symmetry have not");
  if (p.geometry == Geometry::octree && load_le<uint32_t>(&bytes[24]) != 0)
    return bad(24, "a root, which an octree has not");
  for (size_t i = 0; i < attribute_kinds.size(); ++i)
    if ((field(92) >> i & 1) != 0) p.attributes.add(static_cast<Attribute>(i));
  p.height = field(4);
  p.weight_bits = field(5);
  p.leaf_voxels = number(8);
  p.color_count = number(16);
  p.root = load_le<uint32_t>(&bytes[24]);
  p.threshold = load_le<double>(&bytes[32]);
  p.grmse = load_le<double>(&bytes[40]);
  p.dag_nodes = number(48);
  p.dag_bytes = number(56);
  p.color_bytes = number(64);
  p.macro_blocks = number(72);
  p.blocks = number(80);
  p.simplify = load_le<double>(&bytes[96]);
  p.hausdorff = load_le<double>(&bytes[104]);
  if (p.codec == ColorCodec::palette) {
    p.palette_colors = load_le<uint32_t>(&bytes[28]);
    if (p.palette_colors > most_palette_colors || (p.palette_colors == 0) != (p.color_count == 0))
      return bad(28,
                 fmt::format("a palette of {} colors: expected 1 to {}, or none where there are no colors",
                             p.palette_colors, most_palette_colors));
  }
  const int expected = height_of(info.dims);
  if (expected > most_levels)
    return bad_input(file, fmt::format("chunk VOLI, byte 0: a side above {}", 1 << most_levels));
  if (p.height != expected) return bad(4, fmt::format("height {}: expected {}", p.height, expected));
  const uint64_t voxels = *checked_voxels(info.dims);
  if (p.leaf_voxels > voxels)
    return bad(8, fmt::format("{} voxels: expected at most {}", p.leaf_voxels, voxels));
  // A voxel has at most one node of each height above it.
  const uint64_t most =
      p.colors == Colors::leaf ? p.leaf_voxels : p.leaf_voxels * static_cast<uint64_t>(p.height + 1);
  if (p.color_count < p.leaf_voxels || p.color_count > most)
    return bad(16, fmt::format("{} colors of {} voxels: expected {} to {}", p.color_count, p.leaf_voxels,
                               p.leaf_voxels, most));
  return p;
}

}  // namespace voxkit::color
