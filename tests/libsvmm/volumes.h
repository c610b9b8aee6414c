// Volumes for the tests, and an encoder into memory.
#pragma once

#include <gtest/gtest.h>

#include <random>

#include "formats/container.h"
#include "libsvmm/svmm.h"
#include "tests/memory_volume.h"

namespace voxkit::svmm::test {

inline constexpr VoxelFormat all_formats[] = {VoxelFormat::rgba32,   VoxelFormat::rgb24,
                                              VoxelFormat::density8, VoxelFormat::density16,
                                              VoxelFormat::float32,  VoxelFormat::bitmap};

inline VolumeInfo make_info(Index3 dims, VoxelFormat f) {
  VolumeInfo info;
  info.dims = dims;
  info.format = f;
  info.sample_type = f == VoxelFormat::density16 ? SampleType::u16
                     : f == VoxelFormat::float32 ? SampleType::f32
                     : f == VoxelFormat::bitmap  ? SampleType::bit
                                                 : SampleType::u8;
  return info;
}

enum class Content { noise, smooth, blobs, constant, specials };

/// Deterministic test content. blobs: large uniform regions with noisy seams; specials: NaN, infinities, -0
/// among few values.
inline std::vector<Voxel> make_voxels(const VolumeInfo& info, Content content, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<Voxel> voxels;
  const auto random_voxel = [&](uint32_t bits) {
    switch (info.format) {
      case VoxelFormat::rgba32:
        return Voxel::of(bits);
      case VoxelFormat::rgb24:
        return Voxel::of(bits & 0xffffffu);
      case VoxelFormat::density8:
        return Voxel::of(static_cast<uint8_t>(bits));
      case VoxelFormat::density16:
        return Voxel::of(static_cast<uint16_t>(bits));
      case VoxelFormat::float32:
        return Voxel::of(static_cast<float>(bits % 1000) / 999.0f);
      case VoxelFormat::bitmap:
        return Voxel::of(static_cast<uint8_t>(bits & 1));
    }
    return Voxel{};
  };
  const uint32_t base = static_cast<uint32_t>(random());
  for (int64_t z = 0; z < info.dims.z; ++z)
    for (int64_t y = 0; y < info.dims.y; ++y)
      for (int64_t x = 0; x < info.dims.x; ++x) {
        const uint32_t r = static_cast<uint32_t>(random());
        const auto ramp = static_cast<uint32_t>(2 * x + 3 * y + z) & 0xffu;
        switch (content) {
          case Content::noise:
            voxels.push_back(random_voxel(r));
            break;
          case Content::smooth:
            voxels.push_back(info.format == VoxelFormat::bitmap
                                 ? random_voxel(ramp >> 5)
                                 : random_voxel(ramp * 0x01010101u + (r & 0x01010101u)));
            break;
          case Content::blobs:
            voxels.push_back(random_voxel((x / 9 + y / 7 + z / 5) % 3 == 0 ? 0u : r % 50 == 0 ? r : base));
            break;
          case Content::constant:
            voxels.push_back(random_voxel(base));
            break;
          case Content::specials:
            if (info.format == VoxelFormat::float32) {
              const float values[] = {0.0f, -0.0f, 1.0f, NAN, INFINITY, -INFINITY, 1e-42f, 3e38f};
              voxels.push_back(Voxel::of((x / 4 + y / 4) % 2 ? values[0] : values[r % 8]));
            } else {
              voxels.push_back(random_voxel(r % 3 ? 0u : ~0u));
            }
        }
      }
  return voxels;
}

inline std::vector<std::byte> bytes_of(const std::vector<Voxel>& voxels, VoxelFormat f) {
  std::vector<std::byte> bytes;
  for (const Voxel& v : voxels) bytes.insert(bytes.end(), v.bytes.begin(), v.bytes.begin() + voxel_bytes(f));
  return bytes;
}

inline Context context(int threads = 2) {
  static MemoryBudget budget(uint64_t{1} << 32);
  Context ctx;
  ctx.threads = threads;
  ctx.memory = &budget;
  return ctx;
}

struct Encoded {
  std::vector<std::byte> bytes;
  std::vector<Level> levels;
  std::shared_ptr<const Volume> open() const {
    const auto copy = std::make_shared<std::vector<std::byte>>(bytes);
    auto container = Container::open(*copy, "test", copy);
    EXPECT_TRUE(container) << container.error().what;
    auto volume = Volume::open(*container);
    EXPECT_TRUE(volume) << volume.error().what;
    return *volume;
  }
};

inline Encoded encode_to_memory(VolumeSource& source, const Params& params, int threads = 2) {
  Encoded out;
  Context ctx = context(threads);
  auto levels = encode(
      source, params,
      [&](std::span<const std::byte> b) {
        out.bytes.insert(out.bytes.end(), b.begin(), b.end());
        return Status{};
      },
      ctx);
  EXPECT_TRUE(levels) << levels.error().what;
  if (levels) out.levels = *levels;
  return out;
}

inline Params make_params(VoxelFormat f, double quality, std::vector<int> widths, int64_t rootwidth,
                          Layout layout = Layout::plain, Bound bound = Bound::global,
                          bool alpha_weight = true) {
  Params params;
  params.layout = layout;
  params.bound = bound;
  params.alpha_weight = alpha_weight;
  params.blockwidths = std::move(widths);
  params.rootwidth = rootwidth;
  params.quality = quality;
  params.delta = delta_of_quality(quality, f, layout);
  params.full_scale = f == VoxelFormat::density16                             ? 65535
                      : f == VoxelFormat::float32 || f == VoxelFormat::bitmap ? 1
                                                                              : 255;
  return params;
}

inline std::vector<std::byte> decode_all(const Volume& volume, int level = 0) {
  const Index3 dims = volume.dims_at(level);
  std::vector<std::byte> voxels(
      static_cast<size_t>(dims.x * dims.y * dims.z * voxel_bytes(volume.info().format)));
  const auto status =
      volume.decode({Index3(0), dims}, level, packed(voxels.data(), dims, volume.info().format));
  EXPECT_TRUE(status) << status.error().what;
  return voxels;
}

}  // namespace voxkit::svmm::test
