#include "libsvmm/base_block.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "libsvmm/base_voxel.h"

#define STB_DXT_IMPLEMENTATION
#define STB_DXT_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_dxt.h>
#pragma GCC diagnostic pop

namespace voxkit::svmm {
namespace {

uint8_t u8(std::byte b) {
  return std::to_integer<uint8_t>(b);
}

/// A voxel that is not void: some alpha, or for voxels without alpha any value but zero.
bool occupied(const std::byte* v, VoxelFormat f) {
  if (f == VoxelFormat::rgba32) return v[3] != std::byte{0};
  if (f == VoxelFormat::float32) return load_le<float>(v) != 0;
  return std::any_of(v, v + voxel_bytes(f), [](std::byte b) { return b != std::byte{0}; });
}

/// The rounded mean of the occupied voxels of a subblock: colour without alpha, or the scalar.
void shared_mean(const std::byte* voxels, VoxelFormat f, unsigned occupancy, std::byte* out) {
  const int count = std::popcount(occupancy), stride = voxel_bytes(f);
  if (count == 0) {
    std::memset(out, 0, static_cast<size_t>(shared_bytes(f)));
    return;
  }
  if (f == VoxelFormat::float32) {
    double sum = 0;
    for (int i = 0; i < 8; ++i)
      if (occupancy >> i & 1u) sum += static_cast<double>(load_le<float>(voxels + i * stride));
    store_le(out, static_cast<float>(sum / count));
  } else if (f == VoxelFormat::density16) {
    int sum = 0;
    for (int i = 0; i < 8; ++i)
      if (occupancy >> i & 1u) sum += load_le<uint16_t>(voxels + i * stride);
    store_le(out, static_cast<uint16_t>((2 * sum + count) / (2 * count)));
  } else {
    for (int c = 0; c < shared_bytes(f); ++c) {
      int sum = 0;
      for (int i = 0; i < 8; ++i)
        if (occupancy >> i & 1u) sum += u8(voxels[i * stride + c]);
      out[c] = static_cast<std::byte>((2 * sum + count) / (2 * count));
    }
  }
}

/// Rec. 709 luma, rounded, of 8-bit components; the weights add up to 2^16.
int luma(const std::byte* rgb) {
  return (13933 * u8(rgb[0]) + 46871 * u8(rgb[1]) + 4732 * u8(rgb[2]) + 32768) >> 16;
}

using Palette = std::array<Bc1Color, 4>;

Palette bc1_palette(unsigned c0, unsigned c1) {
  return {bc1_color(c0, c1, 0), bc1_color(c0, c1, 1), bc1_color(c0, c1, 2), bc1_color(c0, c1, 3)};
}

/// `rgba`: 16 pixels, alpha 0 = void.
void encode_bc1(std::array<uint8_t, 64> rgba, std::byte* out) {
  std::array<int, 3> sum{};
  int count = 0;
  for (size_t i = 0; i < 16; ++i)
    if (rgba[4 * i + 3] != 0) {
      ++count;
      for (size_t k = 0; k < 3; ++k) sum[k] += rgba[4 * i + k];
    }
  if (count == 0) {  // all void: equal end points, every index 3
    std::memset(out, 0, 4);
    std::memset(out + 4, 0xff, 4);
    return;
  }
  std::array<bool, 16> is_void{};
  for (size_t i = 0; i < 16; ++i)  // void pixels must not pull at the end points
    if (rgba[4 * i + 3] == 0) {
      is_void[i] = true;
      for (size_t k = 0; k < 3; ++k) rgba[4 * i + k] = static_cast<uint8_t>(sum[k] / count);
    }
  for (size_t i = 0; i < 16; ++i) rgba[4 * i + 3] = 255;
  std::array<unsigned char, 8> block{};
  stb_compress_dxt_block(block.data(), rgba.data(), 0, STB_DXT_HIGHQUAL);
  unsigned c0 = block[0] | unsigned{block[1]} << 8, c1 = block[2] | unsigned{block[3]} << 8;
  if (count < 16 || c0 <= c1) {  // three colours and void; also where both end points are equal
    if (c0 > c1) std::swap(c0, c1);
    const Palette palette = bc1_palette(c0, c1);
    uint32_t indices = 0;
    for (size_t i = 0; i < 16; ++i) {
      uint32_t best = 3;
      int best_distance = 1 << 30;
      for (uint32_t j = 0; j < 3 && !is_void[i]; ++j) {
        int distance = 0;
        for (size_t k = 0; k < 3; ++k) {
          const int d = palette[j].rgb[k] - rgba[4 * i + k];
          distance += d * d;
        }
        if (distance < best_distance) best_distance = distance, best = j;
      }
      indices |= best << (2 * i);
    }
    store_le(out, static_cast<uint16_t>(c0));
    store_le(out + 2, static_cast<uint16_t>(c1));
    store_le(out + 4, indices);
    return;
  }
  std::memcpy(out, block.data(), 8);
}

/// Calls visit(tile, pixel, voxel index in block order) for every pixel of the 4x4 tiles of each slice, in
/// stored order.
template <class Visit>
void for_each_tile_pixel(Index3 size, Visit visit) {
  int64_t tile = 0;
  for (int64_t z = 0; z < size.z; ++z)
    for (int64_t y = 0; y < size.y; y += 4)
      for (int64_t x = 0; x < size.x; x += 4, ++tile)
        for (int i = 0; i < 16; ++i) visit(tile, i, voxel_index({x + i % 4, y + i / 4, z}, size));
}

bool color_from_parent(Index3 size) {
  return size == Index3(2);
}

}  // namespace

uint64_t base_block_bytes(uint64_t voxels, int w, VoxelFormat f, Base base, Layout layout) {
  const uint64_t subblocks = voxels / 8;
  const unsigned shared = w == 2 ? 0 : static_cast<unsigned>(shared_bytes(f));
  switch (base) {
    case Base::raw:
      if (f == VoxelFormat::bitmap) return subblocks;
      return voxels * static_cast<unsigned>(layout == Layout::thesis ? word_bytes(f) : voxel_bytes(f));
    case Base::bitmap:
      return f == VoxelFormat::bitmap ? subblocks : subblocks * (shared + 1);
    case Base::alpha:
      return subblocks * (shared + 8);
    case Base::gray:
      return voxels;
    case Base::bc1:
      return voxels / 2;
  }
  return 0;
}

void encode_base_block(const std::byte* voxels, Index3 size, VoxelFormat f, Base base, Layout layout,
                       std::vector<std::byte>& out) {
  const int64_t count = size.x * size.y * size.z;
  const int stride = voxel_bytes(f);
  const size_t start = out.size();
  if (base == Base::raw && layout == Layout::plain && f != VoxelFormat::bitmap) {
    out.insert(out.end(), voxels, voxels + count * stride);
    return;
  }
  const int w = color_from_parent(size) ? 2 : 4;  // only "2 or more" matters here
  out.resize(start + base_block_bytes(static_cast<uint64_t>(count), w, f, base, layout));
  std::byte* p = &out[start];
  if (base == Base::raw && f != VoxelFormat::bitmap) {
    for (int64_t i = 0; i < count; ++i) {
      Voxel v;
      std::memcpy(v.bytes.data(), voxels + i * stride, static_cast<size_t>(stride));
      store_word(p + i * word_bytes(f), f, thesis_word(v, f, {}, 0));
    }
  } else if (base == Base::gray) {
    for (int64_t i = 0; i < count; ++i)
      p[i] = static_cast<std::byte>(occupied(voxels + i * stride, f) ? std::max(1, luma(voxels + i * stride))
                                                                     : 0);
  } else if (base == Base::bc1) {
    std::array<uint8_t, 64> rgba{};
    for_each_tile_pixel(size, [&](int64_t tile, int i, int64_t voxel) {
      const std::byte* v = voxels + voxel * stride;
      for (int k = 0; k < 3; ++k) rgba[static_cast<size_t>(4 * i + k)] = u8(v[k]);
      rgba[static_cast<size_t>(4 * i + 3)] = occupied(v, f) ? 255 : 0;
      if (i == 15) encode_bc1(rgba, p + tile * 8);
    });
  } else {  // bitmap and alpha: a subblock at a time
    for (int64_t s = 0; s < count / 8; ++s) {
      const std::byte* v = voxels + s * 8 * stride;
      unsigned occupancy = 0;
      for (int i = 0; i < 8; ++i) occupancy |= static_cast<unsigned>(occupied(v + i * stride, f)) << i;
      if (!color_from_parent(size) && f != VoxelFormat::bitmap) {
        shared_mean(v, f, occupancy, p);
        p += shared_bytes(f);
      }
      if (base == Base::alpha)
        for (int i = 0; i < 8; ++i) *p++ = v[i * stride + 3];
      else
        *p++ = static_cast<std::byte>(occupancy);
    }
  }
}

void decode_base_block(const std::byte* block, Index3 size, VoxelFormat f, Base base, Layout layout,
                       const Voxel& parent, std::byte* voxels) {
  const int64_t count = size.x * size.y * size.z;
  const int stride = voxel_bytes(f);
  const auto set_alpha = [&](std::byte* v, int alpha) {
    if (f == VoxelFormat::rgba32) v[3] = static_cast<std::byte>(alpha);
  };
  if (f == VoxelFormat::bitmap) {
    for (int64_t i = 0; i < count; ++i) voxels[i] = block[i / 8] >> (i % 8) & std::byte{1};
  } else if (base == Base::raw && layout == Layout::plain) {
    std::memcpy(voxels, block, static_cast<size_t>(count * stride));
  } else if (base == Base::raw) {
    for (int64_t i = 0; i < count; ++i) {
      const Voxel v = thesis_value(load_word(block + i * word_bytes(f), f), f);
      std::memcpy(voxels + i * stride, v.bytes.data(), static_cast<size_t>(stride));
    }
  } else if (base == Base::gray) {
    for (int64_t i = 0; i < count; ++i) {
      std::byte* v = voxels + i * stride;
      std::fill(v, v + 3, block[i]);
      set_alpha(v, block[i] != std::byte{0} ? 255 : 0);
    }
  } else if (base == Base::bc1) {
    Palette palette{};
    bool three = false;
    uint32_t indices = 0;
    for_each_tile_pixel(size, [&](int64_t tile, int i, int64_t voxel) {
      if (i == 0) {
        const unsigned c0 = load_le<uint16_t>(block + tile * 8), c1 = load_le<uint16_t>(block + tile * 8 + 2);
        palette = bc1_palette(c0, c1);
        three = c0 <= c1;
        indices = load_le<uint32_t>(block + tile * 8 + 4);
      }
      const uint32_t index = indices >> (2 * i) & 3;
      std::byte* v = voxels + voxel * stride;
      for (int k = 0; k < 3; ++k) v[k] = static_cast<std::byte>(palette[index].rgb[k]);
      set_alpha(v, three && index == 3 ? 0 : 255);
    });
  } else {
    for (int64_t s = 0; s < count / 8; ++s) {
      const std::byte* shared = parent.bytes.data();
      if (!color_from_parent(size)) shared = block, block += shared_bytes(f);
      for (int i = 0; i < 8; ++i) {
        std::byte* v = voxels + (s * 8 + i) * stride;
        const int alpha = base == Base::alpha ? u8(block[i]) : (u8(*block) >> i & 1) * 255;
        std::memcpy(v, shared, static_cast<size_t>(shared_bytes(f)));
        if (alpha == 0) std::memset(v, 0, static_cast<size_t>(stride));
        set_alpha(v, alpha);
      }
      block += base == Base::alpha ? 8 : 1;
    }
  }
}

}  // namespace voxkit::svmm
