// Colours in layout packed: what comes back, at every level.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "formats/volume/open_volume.h"
#include "libsvmm/packed/packed.h"
#include "libsvmm/packed/packed_layout.h"
#include "tests/damage.h"
#include "tests/libsvmm/packed_attack.h"
#include "tests/libsvmm/packed_files.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;
using voxkit::test::Bytes;

/// Voxels of `n` bytes by coordinates: a shell of a gradient around void, with some noise, and a few voxels
/// of alpha 0, or as dark as may be.
Bytes shell(Index3 dims, int n, uint32_t seed) {
  std::mt19937 random(seed);
  Bytes out;
  for (int64_t z = 0; z < dims.z; ++z)
    for (int64_t y = 0; y < dims.y; ++y)
      for (int64_t x = 0; x < dims.x; ++x) {
        const auto r = static_cast<int64_t>(random() % 64);
        const int64_t d = std::abs(x + y + z - (dims.x + dims.y + dims.z) / 2);
        const bool solid = d < 4 || r == 0;
        const int64_t alpha = r == 1 ? 0 : r < 8 ? 32 * r : 255;
        const int64_t v[4] = {r == 2 ? 0 : 3 * x + r % 3, r == 2 ? 1 : 200 - 2 * y, r == 2 ? 0 : 5 * z,
                              alpha};
        for (int c = 0; c < n; ++c) out.push_back(static_cast<std::byte>(solid ? v[c] : 0));
      }
  return out;
}

const VoxelFormat colors[] = {VoxelFormat::rgba32, VoxelFormat::rgb24};
const Index3 shapes[] = {{1, 1, 1}, {17, 5, 33}, {16, 16, 8}, {1, 60, 2}};

TEST(PackedColors, EveryVoxelComesBack) {
  uint32_t seed = 0;
  for (const VoxelFormat format : colors)
    for (const Index3 dims : shapes)
      for (const int content : {0, 1, 2})
        for (const bool levels : {false, true}) {
          const int side = (content + (levels ? 1 : 0)) % 2 == 0 ? 8 : 16;
          ++seed;
          const VolumeInfo info = make_info(dims, format);
          const Bytes voxels =
              content == 0
                  ? shell(dims, voxel_bytes(format), seed)
                  : bytes_of(make_voxels(info, content == 1 ? Content::blobs : Content::constant, seed),
                             format);
          voxkit::test::MemorySource source(info, voxels);
          const Written file = encode(source, {.levels = levels, .page_side = side});
          const auto volume = open(file.bytes);
          ASSERT_TRUE(volume);
          EXPECT_EQ(decode(*volume), voxels) << name(format) << " seed " << seed;
          Context ctx = context();
          EXPECT_TRUE(volume->check(ctx));
          EXPECT_EQ(encode(source, {.levels = levels, .page_side = side}, 1).bytes, file.bytes);
        }
}

/// By the book: what 2^3 voxels of `n` bytes become.
Bytes mean_of(const Bytes& voxels, Index3 dims, Index3 at, int n) {
  std::array<double, 3> weighted{}, plain{};
  double weight = 0, alpha = 0, solid = 0, all = 0;
  for (int i = 0; i < 8; ++i) {
    const Index3 v = at * int64_t{2} + Index3(i & 1, i >> 1 & 1, i >> 2);
    if (v.x >= dims.x || v.y >= dims.y || v.z >= dims.z) continue;
    ++all;
    const auto first = static_cast<size_t>(((v.z * dims.y + v.y) * dims.x + v.x) * n);
    double c[4] = {0, 0, 0, 1}, sum = 0;
    for (int k = 0; k < n; ++k) sum += c[k] = std::to_integer<int>(voxels[first + static_cast<size_t>(k)]);
    if (sum == 0) continue;
    ++solid;
    for (size_t k = 0; k < 3; ++k) weighted[k] += c[3] * c[k], plain[k] += c[k];
    weight += c[3];
    if (n == 4) alpha += c[3];
  }
  Bytes out(static_cast<size_t>(n));
  if (solid == 0) return out;
  const auto& sums = weight > 0 ? weighted : plain;
  bool any = false;
  const auto set = [&](size_t k, double value) {
    out[k] = static_cast<std::byte>(std::floor(value + 0.5));
    any |= out[k] != std::byte{0};
  };
  for (size_t k = 0; k < 3; ++k) set(k, sums[k] / (weight > 0 ? weight : solid));
  if (n == 4) set(3, alpha / all);
  if (!any)
    out[alpha > 0 ? 3 : static_cast<size_t>(std::max_element(sums.begin(), sums.end()) - sums.begin())] =
        std::byte{1};
  return out;
}

TEST(PackedColors, LevelsAreMeansOfWhatIsSolid) {
  for (const VoxelFormat format : colors) {
    const int n = voxel_bytes(format);
    const VolumeInfo info = make_info({37, 18, 51}, format);
    Bytes exact = shell(info.dims, n, 9);
    voxkit::test::MemorySource source(info, exact);
    const auto volume = open(encode(source, {}).bytes);
    ASSERT_EQ(volume->params().levels, 3);
    for (int level = 1; level < 3; ++level) {
      const Index3 below = volume->levels()[static_cast<size_t>(level - 1)].dims, dims = level_dims(below, 1);
      Bytes next;
      for (int64_t i = 0; i < dims.x * dims.y * dims.z; ++i) {
        const Bytes mean = mean_of(exact, below, {i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y)}, n);
        next.insert(next.end(), mean.begin(), mean.end());
      }
      exact = next;
      const Bytes near = decode(*volume, level);
      ASSERT_EQ(near.size(), exact.size());
      for (size_t i = 0; i < exact.size(); ++i) {
        const int bound = n == 4 && i % 4 == 3 ? 0 : 2;
        ASSERT_LE(std::abs(std::to_integer<int>(near[i]) - std::to_integer<int>(exact[i])), bound) << i;
      }
    }
  }
}

TEST(PackedColors, NoVoxelIsFurtherThanTheBound) {
  for (const VoxelFormat format : colors)
    for (const double bound : {1.0, 1.8, 4.0, 20.0, 500.0}) {
      const int n = voxel_bytes(format);
      const VolumeInfo info = make_info({37, 18, 21}, format);
      const Bytes voxels = shell(info.dims, n, 3);
      voxkit::test::MemorySource source(info, voxels);
      const Written file = encode(source, {.max_error = bound});
      const Bytes near = decode(*open(file.bytes));
      for (size_t i = 0; i < voxels.size(); i += static_cast<size_t>(n)) {
        double squared = 0;
        bool is_void = true;
        for (size_t k = 0; k < static_cast<size_t>(n); ++k) {
          const int a = std::to_integer<int>(voxels[i + k]), b = std::to_integer<int>(near[i + k]);
          squared += (a - b) * (a - b);
          is_void &= a == 0;
          ASSERT_TRUE(k != 3 || a == b) << "alpha";
        }
        ASSERT_LE(std::sqrt(squared), bound);
        ASSERT_TRUE(!is_void || squared == 0);
      }
      EXPECT_TRUE(bound >= std::sqrt(3.0) || near == voxels);
    }
}

TEST(PackedColors, RegionsAndVoxelsTouchTheirPagesOnly) {
  const VolumeInfo info = make_info({64, 48, 40}, VoxelFormat::rgba32);
  const Bytes voxels = shell(info.dims, 4, 5);
  voxkit::test::MemorySource source(info, voxels);
  const auto volume = open(encode(source, {.levels = false}).bytes);
  const Box box{{13, 20, 17}, {37, 29, 35}};
  const Bytes part = decode(*volume, 0, box);
  EXPECT_LE(volume->pages_decoded(), 3u * 1 * 2);
  size_t at = 0;
  for (int64_t z = box.lo.z; z < box.hi.z; ++z)
    for (int64_t y = box.lo.y; y < box.hi.y; ++y)
      for (int64_t x = box.lo.x; x < box.hi.x; ++x, at += 4) {
        const auto from = voxels.begin() + ((z * 48 + y) * 64 + x) * 4;
        ASSERT_TRUE(std::equal(from, from + 4, part.begin() + static_cast<std::ptrdiff_t>(at)));
        const auto one = volume->sample({x, y, z}, 0);
        ASSERT_TRUE(one);
        ASSERT_TRUE(std::equal(from, from + 4, one->bytes.begin()));
      }
}

TEST(PackedColors, VoidTakesNoBytesAndIsKnown) {
  const VolumeInfo info = make_info({100, 90, 80}, VoxelFormat::rgba32);
  const Bytes voxels(720000 * 4);
  voxkit::test::MemorySource source(info, voxels);
  const auto volume = open(encode(source, {.levels = false}).bytes);
  EXPECT_EQ(volume->uniform(info.box(), 0), Voxel{});
  EXPECT_EQ(decode(*volume), voxels);
  EXPECT_EQ(volume->pages_decoded(), 0u);
}

/// Whether differences or R, G and B themselves take fewer bytes is found out; and whether all is opaque.
TEST(PackedColors, ChannelsAreChosen) {
  const VolumeInfo info = make_info({48, 48, 48}, VoxelFormat::rgba32);
  Bytes cube, greys;
  std::mt19937 random(1);
  for (int64_t z = 0; z < 48; ++z)
    for (int64_t y = 0; y < 48; ++y)
      for (int64_t x = 0; x < 48; ++x) {
        const auto noise = static_cast<int64_t>(random() % 64);
        for (const int64_t v : {int64_t{5} * x, 16 * (y % 2) + (noise & 3), int64_t{5} * z, int64_t{255}})
          cube.push_back(static_cast<std::byte>(v));
        for (const int64_t v : {noise + 10, noise, noise + 20, int64_t{128}})
          greys.push_back(static_cast<std::byte>(v));
      }
  voxkit::test::MemorySource cubes(info, cube), grey(info, greys);
  const auto of_cube = encode(cubes, {.levels = false}), of_grey = encode(grey, {.levels = false});
  EXPECT_FALSE(of_cube.params.channels.differences);
  EXPECT_TRUE(of_grey.params.channels.differences);
  EXPECT_TRUE(of_cube.params.opaque);
  EXPECT_FALSE(of_grey.params.opaque);
  EXPECT_TRUE(open(of_cube.bytes)->params().opaque);
  EXPECT_EQ(open(of_cube.bytes)->params().channels, of_cube.params.channels);
  EXPECT_LT(of_grey.bytes.size(), greys.size() / 4);
}

TEST(PackedColors, DamagedFilesAreRefusedOrRead) {
  std::mt19937 random(4);
  const int tries = std::getenv("VOXKIT_MUTATIONS") ? std::atoi(std::getenv("VOXKIT_MUTATIONS")) : 400;
  for (const VoxelFormat format : colors) {
    const VolumeInfo info = make_info({19, 18, 17}, format);
    voxkit::test::MemorySource source(info, shell(info.dims, voxel_bytes(format), 3));
    const Bytes file = encode(source, {}).bytes;
    ASSERT_EQ(attack_packed(file).fault, "");
    for (size_t length = 0; length < file.size(); length += 11)
      ASSERT_EQ(attack_packed(std::span(file).first(length)).fault, "") << length;
    for (int i = 0; i < tries; ++i) {
      Bytes bad = file;
      voxkit::test::damage(bad, 0, bad.size(), false, random);
      voxkit::test::repair(bad);
      ASSERT_EQ(attack_packed(bad).fault, "") << name(format) << " damage " << i;
    }
  }
}

}  // namespace
}  // namespace voxkit::svmm
