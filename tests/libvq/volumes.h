// Volumes and bricks for the tests, and an encoder into memory.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "formats/container.h"
#include "libvq/vq.h"
#include "tests/memory_volume.h"

namespace voxkit::vq::test {

enum class Content {
  noise,     ///< every value as likely as any other
  scan,      ///< smooth shapes with a little noise, void around them
  levels,    ///< few values, far apart
  constant,  ///< one value
  blobs,     ///< equal bricks, with seams of noise between
};
inline constexpr Content all_contents[] = {Content::noise, Content::scan, Content::levels, Content::constant,
                                           Content::blobs};

/// A voxel of the content, of up to 16 bits.
inline uint16_t make_value(Content content, Index3 v, int bits, uint32_t random, uint32_t seed) {
  const auto top = static_cast<int64_t>((1u << bits) - 1);
  switch (content) {
    case Content::noise:
      return static_cast<uint16_t>(random & static_cast<uint32_t>(top));
    case Content::scan: {
      const double wave =
          std::sin(0.21 * static_cast<double>(v.x) + seed) * std::cos(0.13 * static_cast<double>(v.y)) +
          0.3 * std::sin(0.37 * static_cast<double>(v.z));
      const auto value = static_cast<int64_t>(wave * 0.6 * static_cast<double>(top)) +
                         static_cast<int64_t>(random % (2 + static_cast<uint32_t>(top) / 40));
      return static_cast<uint16_t>(wave < 0.1 ? 0 : std::clamp<int64_t>(value, 0, top));
    }
    case Content::levels:
      return static_cast<uint16_t>(static_cast<int64_t>((v.x / 3 + v.y / 2 + random % 3) % 3) * top / 2);
    case Content::constant:
      return static_cast<uint16_t>(seed * 7 % static_cast<uint32_t>(top + 1));
    case Content::blobs:
      return static_cast<uint16_t>(v.x % 32 == 0
                                       ? random & static_cast<uint32_t>(top)
                                       : static_cast<uint32_t>(v.x / 32) % 2 *
                                             (static_cast<uint32_t>(v.y % 4) & static_cast<uint32_t>(top)));
  }
  return 0;
}

/// The voxels of a volume of values of up to `bits` bits: DENSITY8 of up to 8, DENSITY16, BITMAP of 1;
/// FLOAT32 has the values times 0.25, less 3.
inline std::vector<std::byte> make_voxels(const VolumeInfo& info, Content content, int bits, uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<std::byte> bytes;
  for (int64_t z = 0; z < info.dims.z; ++z)
    for (int64_t y = 0; y < info.dims.y; ++y)
      for (int64_t x = 0; x < info.dims.x; ++x) {
        const uint16_t value =
            make_value(content, {x, y, z}, bits, static_cast<uint32_t>(random()) >> 8, seed);
        const Voxel voxel = info.format == VoxelFormat::float32
                                ? Voxel::of(static_cast<float>(value) * 0.25f - 3)
                                : Voxel::of(value);
        bytes.insert(bytes.end(), voxel.bytes.begin(), voxel.bytes.begin() + voxel_bytes(info.format));
      }
  return bytes;
}

/// Unsigned integers of up to `bits` bits: DENSITY8 where that holds them.
inline VolumeInfo integer_info(Index3 dims, int bits) {
  return voxkit::test::scalar_info(dims, bits <= 8 ? SampleType::u8 : SampleType::u16);
}

inline Context context(int threads = 2, uint64_t memory = uint64_t{1} << 32) {
  static std::vector<std::unique_ptr<MemoryBudget>> budgets;  // each test has one of its own
  Context ctx;
  ctx.threads = threads;
  ctx.memory = budgets.emplace_back(std::make_unique<MemoryBudget>(memory)).get();
  return ctx;
}

struct Encoded {
  std::vector<std::byte> bytes;
  Report report;
  std::shared_ptr<const Volume> open() const {
    const auto copy = std::make_shared<std::vector<std::byte>>(bytes);
    auto container = Container::open(*copy, "test", copy);
    EXPECT_TRUE(container) << container.error().what;
    auto volume = Volume::open(*container);
    EXPECT_TRUE(volume) << volume.error().what;
    return *volume;
  }
};

inline Encoded encode_to_memory(VolumeSource& source, const Options& options = {}, int threads = 2) {
  Encoded out;
  Context ctx = context(threads);
  auto report = encode(
      source, options,
      [&](std::span<const std::byte> b) {
        out.bytes.insert(out.bytes.end(), b.begin(), b.end());
        return Status{};
      },
      ctx);
  EXPECT_TRUE(report) << report.error().what;
  if (report) out.report = *report;
  EXPECT_TRUE(ctx.memory->reserve(ctx.memory->limit(), "all of it")) << "reserved memory was not given back";
  return out;
}
inline Encoded encode_to_memory(const VolumeInfo& info, const std::vector<std::byte>& voxels,
                                const Options& options = {}, int threads = 2) {
  voxkit::test::MemorySource source(info, voxels);
  return encode_to_memory(source, options, threads);
}

inline std::vector<std::byte> decode_box(const Volume& volume, const Box& box) {
  const VoxelFormat format = volume.info().format;
  std::vector<std::byte> voxels(static_cast<size_t>(box.voxels() * voxel_bytes(format)));
  const auto status = volume.decode(box, packed(voxels.data(), box.size(), format));
  EXPECT_TRUE(status) << status.error().what;
  return voxels;
}
inline std::vector<std::byte> decode_all(const Volume& volume) {
  return decode_box(volume, volume.info().box());
}

}  // namespace voxkit::vq::test
