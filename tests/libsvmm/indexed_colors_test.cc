// Volumes of few colours: what comes back, what coarser levels have, and tables that are none.
#include "libsvmm/packed/indexed_colors.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <random>

#include "libsvmm/packed/packed_layout.h"
#include "tests/libsvmm/packed_files.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;

constexpr Index3 dims(35, 20, 19);

/// Blocks of up to `count` colors with void between them.
Bytes blocks(VoxelFormat format, int count) {
  std::mt19937 random(3);
  std::vector<std::array<std::byte, 4>> colors(static_cast<size_t>(count));
  for (auto& color : colors) {
    for (std::byte& byte : color) byte = static_cast<std::byte>(random() % 255 + 1);
    color[3] = std::byte{255};
  }
  const auto n = static_cast<size_t>(voxel_bytes(format));
  Bytes out;
  for (int64_t z = 0; z < dims.z; ++z)
    for (int64_t y = 0; y < dims.y; ++y)
      for (int64_t x = 0; x < dims.x; ++x) {
        const int64_t block = x / 3 + y / 4 * 7 + z / 5 * 11;
        const auto& color = colors[static_cast<size_t>(block % count)];
        const bool solid = block % 3 != 0;
        for (size_t c = 0; c < n; ++c) out.push_back(solid ? color[c] : std::byte{0});
      }
  return out;
}
Bytes file_of(VoxelFormat format, const Bytes& voxels, const PackedOptions& options = {}) {
  voxkit::test::MemorySource source(make_info(dims, format), voxels);
  return encode(source, options).bytes;
}

TEST(IndexedColors, ComeBackWithLevelsOfTheSameColors) {
  for (const VoxelFormat format : {VoxelFormat::rgba32, VoxelFormat::rgb24})
    for (const int side : {8, 16})
      for (const double bound : {0.0, 40.0}) {
        const Bytes voxels = blocks(format, 40);
        const auto volume = open(file_of(format, voxels, {.max_error = bound, .page_side = side}));
        ASSERT_EQ(volume->params().map.kind, CodeKind::indexed);
        EXPECT_EQ(volume->params().max_error, 0);
        EXPECT_EQ(volume->params().opaque, format == VoxelFormat::rgba32);
        EXPECT_EQ(decode(*volume), voxels);
        const Box part{{5, 3, 7}, {20, 18, 18}};
        Bytes expected;
        const auto n = static_cast<size_t>(voxel_bytes(format));
        for (int64_t z = part.lo.z; z < part.hi.z; ++z)
          for (int64_t y = part.lo.y; y < part.hi.y; ++y) {
            const auto row =
                voxels.begin() + static_cast<int64_t>(n) * ((z * dims.y + y) * dims.x + part.lo.x);
            expected.insert(expected.end(), row, row + static_cast<int64_t>(n) * part.size().x);
          }
        EXPECT_EQ(decode(*volume, 0, part), expected);
        // Each voxel of a coarser level has the commonest color of what is solid below.
        const auto bits = [&](const Bytes& bytes, size_t i) {
          uint32_t value = 0;
          std::memcpy(&value, &bytes[i * n], n);
          return value;
        };
        Bytes finer = voxels;
        Index3 finer_dims = dims;
        for (int level = 1; level < volume->params().levels; ++level) {
          const Bytes here = decode(*volume, level);
          const Index3 size = volume->levels()[static_cast<size_t>(level)].dims;
          for (int64_t i = 0; i < size.x * size.y * size.z; ++i) {
            const Index3 at(i % size.x, i / size.x % size.y, i / (size.x * size.y));
            std::map<uint32_t, int> counts;
            for (int k = 0; k < 8; ++k) {
              const Index3 v = at * int64_t{2} + Index3(k & 1, k >> 1 & 1, k >> 2);
              if (v.x >= finer_dims.x || v.y >= finer_dims.y || v.z >= finer_dims.z) continue;
              const uint32_t color =
                  bits(finer, static_cast<size_t>((v.z * finer_dims.y + v.y) * finer_dims.x + v.x));
              if (color != 0) ++counts[color];
            }
            uint32_t most = 0;
            for (const auto& [color, count] : counts)
              if (most == 0 || count > counts[most]) most = color;
            ASSERT_EQ(bits(here, static_cast<size_t>(i)), most) << "level " << level;
          }
          finer = here;
          finer_dims = size;
        }
        Context ctx = context();
        EXPECT_TRUE(volume->check(ctx));
        const Index3 voxel(17, 9, 11);
        EXPECT_EQ(volume->sample(voxel)->as<uint32_t>(),
                  bits(voxels, static_cast<size_t>((voxel.z * dims.y + voxel.y) * dims.x + voxel.x)));
      }
}

TEST(IndexedColors, MasksAreOfWhatIsSolid) {
  const Bytes voxels = blocks(VoxelFormat::rgba32, 40);
  for (const int side : {8, 16}) {
    const auto volume = open(file_of(VoxelFormat::rgba32, voxels, {.page_side = side}));
    Context ctx = context();
    std::vector<char> solid(voxels.size() / 4);
    std::mutex mutex;
    ASSERT_TRUE(volume->visit_masks(
        [&](Index3 lo, const page::Mask& mask) -> Status {
          const std::lock_guard lock(mutex);
          for (int z = 0; z < 16; ++z)
            for (int y = 0; y < 16; ++y)
              for (int x = 0; x < 16; ++x)
                if (mask.solid(x, y, z))
                  solid.at(static_cast<size_t>(((lo.z + z) * dims.y + lo.y + y) * dims.x + lo.x + x)) = 1;
          return {};
        },
        ctx));
    for (size_t i = 0; i < solid.size(); ++i)
      ASSERT_EQ(solid[i] != 0, voxels[4 * i + 3] != std::byte{0}) << i;
  }
}

TEST(IndexedColors, AreNoneWhereThereAreMoreOrChannelsAreSmaller) {
  Bytes many;
  for (int64_t i = 0; i < dims.x * dims.y * dims.z; ++i)
    many.insert(many.end(), {static_cast<std::byte>(1 + i % 16), static_cast<std::byte>(i / 16 % 16),
                             static_cast<std::byte>(9)});
  EXPECT_EQ(open(file_of(VoxelFormat::rgb24, many))->params().map.kind, CodeKind::colors);
  many[0] = many[3];
  for (size_t i = 0; i < many.size(); i += 3)
    if (many[i] == std::byte{16}) many[i] = std::byte{15};
  EXPECT_EQ(open(file_of(VoxelFormat::rgb24, many))->params().map.kind, CodeKind::indexed);
  // Two ramps with little noise, each in a channel of its own.
  std::mt19937 random(4);
  const Index3 size(64, 56, 40);
  Bytes ramp;
  for (int64_t i = 0; i < size.x * size.y * size.z; ++i) {
    const int64_t x = i % size.x, y = i / size.x % size.y;
    const auto noise = [&] { return static_cast<int64_t>(random() % 2); };
    ramp.insert(ramp.end(), {static_cast<std::byte>(1 + x / 5 + noise()), std::byte{7},
                             static_cast<std::byte>(1 + y / 4 + noise())});
  }
  voxkit::test::MemorySource source(make_info(size, VoxelFormat::rgb24), ramp);
  const auto volume = open(encode(source, {.levels = false}).bytes);
  EXPECT_EQ(volume->params().map.kind, CodeKind::colors);
  EXPECT_EQ(decode(*volume), ramp);
}

TEST(IndexedColors, TablesThatAreNoneAreRefused) {
  const Bytes good = file_of(VoxelFormat::rgba32, blocks(VoxelFormat::rgba32, 40));
  size_t at = 0;
  for (const ChunkEntry& entry : open(good)->container().table())
    if (entry.kind == color_table_kind) at = entry.offset;
  ASSERT_NE(at, 0u);
  const auto refused = [&](const Bytes& file, const char* what) {
    const auto bytes = std::make_shared<const Bytes>(file);
    auto container = Container::open(*bytes, "packed", bytes);
    ASSERT_TRUE(container);
    const auto volume = PackedVolume::open(*container, memory());
    ASSERT_FALSE(volume) << what;
    EXPECT_EQ(volume.error().code, ErrorCode::input);
    EXPECT_NE(volume.error().what.find("CTAB"), std::string::npos) << volume.error().what;
  };
  Bytes bad = good;
  std::fill_n(bad.begin() + static_cast<ptrdiff_t>(at), 4, std::byte{0});
  voxkit::test::repair(bad);
  refused(bad, "void");
  bad = good;
  std::copy_n(good.begin() + static_cast<ptrdiff_t>(at), 4, bad.begin() + static_cast<ptrdiff_t>(at) + 4);
  voxkit::test::repair(bad);
  refused(bad, "twice");
}

}  // namespace
}  // namespace voxkit::svmm
