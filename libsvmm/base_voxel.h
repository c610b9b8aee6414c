// One voxel of a base-level block (thesis section 2.1.1, last paragraph; FORMAT.md, section 2.5).
#pragma once

#include "libsvmm/layout.h"

namespace voxkit::svmm {

/// Bytes of the value that the voxels of a subblock share.
constexpr int shared_bytes(VoxelFormat f) {
  return is_color(f) ? 3 : voxel_bytes(f);
}

/// S3TC (BC1, "DXT1"): 4x4 pixels in 8 bytes: two RGB565 end points and sixteen 2-bit indices. If the first
/// end point is greater as a number there are four opaque colours; else three, and index 3 is void.
struct Bc1Color {
  int rgb[3];
};
VOX_HD inline Bc1Color expand_565(unsigned c) {
  const int r = static_cast<int>(c >> 11 & 31), g = static_cast<int>(c >> 5 & 63),
            b = static_cast<int>(c & 31);
  return {{r << 3 | r >> 2, g << 2 | g >> 4, b << 3 | b >> 2}};
}
VOX_HD inline Bc1Color bc1_color(unsigned c0, unsigned c1, unsigned index) {
  const Bc1Color a = expand_565(c0), b = expand_565(c1);
  if (index < 2) return index == 0 ? a : b;
  Bc1Color mixed{};
  for (int k = 0; k < 3; ++k)
    mixed.rgb[k] = c0 > c1      ? (index == 2 ? 2 * a.rgb[k] + b.rgb[k] : a.rgb[k] + 2 * b.rgb[k]) / 3
                   : index == 2 ? (a.rgb[k] + b.rgb[k]) / 2
                                : 0;
  return mixed;
}

/// The voxel at `v` of one block of `size` voxels, as decode_base_block would write it. `parent` is the
/// block's equivalent voxel in the level above.
VOX_HD inline Voxel decode_base_voxel(const std::byte* block, Index3 size, Index3 v, VoxelFormat f, Base base,
                                      Layout layout, const Voxel& parent) {
  const int64_t index = voxel_index(v, size), subblock = index / 8;
  const int i = static_cast<int>(index % 8);
  const auto u8 = [](std::byte b) { return static_cast<int>(b); };
  const auto color = [f](int r, int g, int b, int alpha) {
    const int a = f == VoxelFormat::rgba32 ? alpha : 0;
    return Voxel::of(static_cast<uint32_t>(r | g << 8 | b << 16) | static_cast<uint32_t>(a) << 24);
  };
  const auto copy = [](const std::byte* p, int bytes) {
    uint32_t value = 0;
    for (int k = 0; k < bytes; ++k) value |= static_cast<uint32_t>(p[k]) << (8 * k);
    return value;
  };
  if (f == VoxelFormat::bitmap) return Voxel::of(static_cast<uint32_t>(u8(block[subblock]) >> i & 1));
  if (base == Base::raw && layout == Layout::plain) {
    const std::byte* p = block + index * voxel_bytes(f);
    return Voxel::of(voxel_bytes(f) == 4 ? load_le<uint32_t>(p) : copy(p, voxel_bytes(f)));
  }
  if (base == Base::raw) return thesis_value(load_word(block + index * word_bytes(f), f), f);
  if (base == Base::gray) {
    const int l = u8(block[index]);
    return l != 0 ? color(l, l, l, 255) : Voxel{};
  }
  if (base == Base::bc1) {
    const std::byte* p = block + ((v.z * (size.y / 4) + v.y / 4) * (size.x / 4) + v.x / 4) * 8;
    const unsigned c0 = load_le<uint16_t>(p), c1 = load_le<uint16_t>(p + 2);
    const unsigned pixel = load_le<uint32_t>(p + 4) >> (2 * (v.y % 4 * 4 + v.x % 4)) & 3;
    if (c0 <= c1 && pixel == 3) return {};
    const Bc1Color c = bc1_color(c0, c1, pixel);
    return color(c.rgb[0], c.rgb[1], c.rgb[2], 255);
  }
  // bitmap and alpha: of a block of 2^3 the colour is its parent's
  const int shared = size == Index3(2) ? 0 : shared_bytes(f);
  const std::byte* here = block + subblock * (shared + (base == Base::alpha ? 8 : 1));
  const int alpha = base == Base::alpha ? u8(here[shared + i]) : (u8(here[shared]) >> i & 1) * 255;
  if (alpha == 0) return {};
  const uint32_t value = copy(shared ? here : parent.bytes.data(), shared_bytes(f));
  return Voxel::of(f == VoxelFormat::rgba32 ? value | static_cast<uint32_t>(alpha) << 24 : value);
}

}  // namespace voxkit::svmm
