// Layout packed: what comes back, at every level, from whole files and damaged ones.
#include "libsvmm/packed/packed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "formats/volume/open_volume.h"
#include "libsvmm/packed/packed_layout.h"
#include "tests/damage.h"
#include "tests/libsvmm/packed_attack.h"
#include "tests/libsvmm/packed_files.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;

const VoxelFormat scalars[] = {VoxelFormat::density8, VoxelFormat::density16, VoxelFormat::float32,
                               VoxelFormat::bitmap};
const Index3 shapes[] = {{1, 1, 1}, {17, 5, 33}, {16, 16, 16}, {40, 30, 20}, {1, 100, 2}};

TEST(Packed, EveryVoxelComesBack) {
  uint32_t seed = 0;
  for (const VoxelFormat format : scalars)
    for (const Index3 dims : shapes)
      for (const Content content : {Content::blobs, Content::noise})
        for (const int side : {8, 16})
          for (const bool levels : {false, true}) {
            const VolumeInfo info = make_info(dims, format);
            const Bytes voxels = bytes_of(make_voxels(info, content, ++seed), format);
            voxkit::test::MemorySource source(info, voxels);
            const Written file = encode(source, {.max_error = 0, .levels = levels, .page_side = side});
            const auto volume = open(file.bytes);
            ASSERT_TRUE(volume);
            EXPECT_EQ(decode(*volume), voxels) << name(format) << " seed " << seed;
            Context ctx = context();
            EXPECT_TRUE(volume->check(ctx));
            EXPECT_EQ(volume->params().levels, levels ? level_count(dims, side) : 1);
            const Written alone = encode(source, {.max_error = 0, .levels = levels, .page_side = side}, 1);
            EXPECT_EQ(alone.bytes, file.bytes);
          }
}

/// The value that a voxel of the next level stands for, by the book.
double mean_at(const std::vector<double>& values, Index3 dims, Index3 at, bool floats) {
  double sum = 0;
  int count = 0;
  for (int i = 0; i < 8; ++i) {
    const Index3 v = at * int64_t{2} + Index3(i & 1, i >> 1 & 1, i >> 2);
    if (v.x >= dims.x || v.y >= dims.y || v.z >= dims.z) continue;
    sum += values[static_cast<size_t>((v.z * dims.y + v.y) * dims.x + v.x)], ++count;
  }
  return floats ? static_cast<double>(static_cast<float>(sum / count)) : std::floor(sum / count + 0.5);
}
/// Those of a level of `dims`.
std::vector<double> means_of(const std::vector<double>& values, Index3 dims, VoxelFormat format) {
  const Index3 half = level_dims(dims, 1);
  std::vector<double> means;
  for (int64_t n = 0; n < half.x * half.y * half.z; ++n)
    means.push_back(mean_at(values, dims, {n % half.x, n / half.x % half.y, n / (half.x * half.y)},
                            format == VoxelFormat::float32));
  return means;
}

/// Those of 8 bits may be off by 2.
TEST(Packed, LevelsAreMeans) {
  for (const VoxelFormat format : {VoxelFormat::density8, VoxelFormat::density16, VoxelFormat::float32}) {
    const VolumeInfo info = make_info({37, 18, 51}, format);
    voxkit::test::MemorySource source(info, bytes_of(make_voxels(info, Content::noise, 7), format));
    const auto volume = open(encode(source, {}).bytes);
    ASSERT_TRUE(volume);
    std::vector<double> means = numbers(decode(*volume), format);
    for (int level = 1; level < volume->params().levels; ++level) {
      means = means_of(means, volume->levels()[static_cast<size_t>(level - 1)].dims, format);
      const auto coarser = numbers(decode(*volume, level), format);
      for (size_t i = 0; i < coarser.size(); ++i)
        ASSERT_LE(std::abs(coarser[i] - means[i]), format == VoxelFormat::density8 ? 2 : 0)
            << "level " << level;
    }
  }
}

/// Closed loop: what a level is predicted from is what the decoder has of the next one.
TEST(Packed, LevelsAreWithinTheBoundOfTheirMeans) {
  for (const VoxelFormat format : {VoxelFormat::density8, VoxelFormat::density16, VoxelFormat::float32})
    for (const double bound : {1.0, 5.0, 40.0}) {
      const VolumeInfo info = make_info({37, 70, 51}, format);
      const Bytes voxels = bytes_of(make_voxels(info, Content::blobs, 7), format);
      voxkit::test::MemorySource source(info, voxels);
      const auto volume = open(encode(source, {.max_error = bound}).bytes);
      ASSERT_TRUE(volume);
      std::vector<double> means = numbers(voxels, format);
      for (int level = 0; level < volume->params().levels; ++level) {
        if (level > 0) means = means_of(means, volume->levels()[static_cast<size_t>(level - 1)].dims, format);
        const double promised = level > 0 && format == VoxelFormat::density8 ? std::max(bound, 2.0) : bound;
        const auto near = numbers(decode(*volume, level), format);
        for (size_t i = 0; i < means.size(); ++i)
          ASSERT_LE(std::abs(means[i] - near[i]), promised * 1.000001) << "level " << level;
      }
    }
}

TEST(Packed, LevelsAreNoFinerThanTheVolume) {
  const VolumeInfo info = make_info({40, 41, 42}, VoxelFormat::density16);
  std::vector<Voxel> made = make_voxels(info, Content::noise, 4);
  for (Voxel& voxel : made)
    voxel = Voxel::of(static_cast<uint16_t>(1000 + voxel.as<uint16_t>() % 33 * 125 / 2));
  const Bytes voxels = bytes_of(made, info.format);
  voxkit::test::MemorySource source(info, voxels);
  const auto volume = open(encode(source, {}).bytes);
  ASSERT_TRUE(volume);
  EXPECT_EQ(decode(*volume), voxels);
  const auto finest = numbers(voxels, info.format), coarser = numbers(decode(*volume, 1), info.format);
  const Index3 dims = volume->levels()[1].dims;
  for (size_t i = 0; i < coarser.size(); ++i) {
    const auto n = static_cast<int64_t>(i);
    const Index3 at(n % dims.x, n / dims.x % dims.y, n / (dims.x * dims.y));
    ASSERT_LE(std::abs(coarser[i] - mean_at(finest, info.dims, at, false)), 32.0);
    ASSERT_NE(std::find(finest.begin(), finest.end(), coarser[i]), finest.end());
  }
}

TEST(Packed, LevelsOfManyFloatsAreWithinA512thOfMeans) {
  const VolumeInfo info = make_info({40, 33, 36}, VoxelFormat::float32);
  Bytes voxels(raw_bytes(info));
  const auto put = [&](size_t i, float value) { std::memcpy(&voxels[4 * i], &value, 4); };
  const auto coarser_of = [&](const Bytes& bytes) {
    voxkit::test::MemorySource source(info, bytes);
    const auto volume = open(encode(source, {}).bytes);
    EXPECT_EQ(decode(*volume), bytes);
    return numbers(decode(*volume, 1), info.format);
  };
  // Values in the order of a hash, each four times, and of both signs: what a palette of 11880 is good for.
  for (size_t i = 0; i < voxels.size() / 4; ++i)
    put(i, static_cast<float>(std::sin(static_cast<double>(i / 4 * 2654435761u % 11880)) * 1e-3));
  const auto means = means_of(numbers(voxels, info.format), info.dims, info.format);
  auto near = coarser_of(voxels);
  double worst = 0;
  for (size_t i = 0; i < means.size(); ++i)
    worst = std::max(worst, std::abs(near[i] - means[i]) / std::abs(means[i]));
  EXPECT_LE(worst, 1.0 / 512);
  EXPECT_GT(worst, 1e-6);
  // Where there are infinities or NaN, means are exact.
  put(5, std::numeric_limits<float>::infinity());
  near = coarser_of(voxels);
  const auto exact = means_of(numbers(voxels, info.format), info.dims, info.format);
  EXPECT_EQ(near, exact);
}

TEST(Packed, LevelsOfLabelsAndTablesAreTheCommonest) {
  for (const bool table : {false, true}) {
    VolumeInfo info = make_info({3, 2, 2}, VoxelFormat::density8);
    info.dims = {18, 2, 2};
    info.is_labels = !table;
    if (table)
      info.labels = std::make_shared<const std::vector<int64_t>>(
          std::vector<int64_t>{-9, 0, 5, 1000, 70000, 80000, 90000, 100000, 200000, 300000});
    Bytes voxels(72, std::byte{9});
    // Of the first cube three 5, three 7 and two 9: the least of the commonest.
    const size_t cube[] = {0, 1, 18, 19, 36, 37, 54, 55};
    const int labels[] = {7, 5, 9, 7, 5, 9, 7, 5};
    for (size_t i = 0; i < 8; ++i) voxels[cube[i]] = static_cast<std::byte>(labels[i]);
    voxkit::test::MemorySource source(info, voxels);
    const auto volume = open(encode(source, {}).bytes);
    ASSERT_EQ(volume->params().levels, 2);
    const Bytes coarser = decode(*volume, 1);
    EXPECT_EQ(coarser[0], std::byte{5});
    EXPECT_EQ(coarser[1], std::byte{9});
  }
}

TEST(Packed, NoVoxelIsFurtherThanTheBound) {
  uint32_t seed = 50;
  for (const VoxelFormat format : {VoxelFormat::density8, VoxelFormat::density16, VoxelFormat::float32})
    for (const Content content : {Content::blobs, Content::noise})
      for (const double bound : {0.3, 1.0, 4.0, 17.5, 300.0}) {
        const VolumeInfo info = make_info({37, 18, 21}, format);
        const Bytes voxels = bytes_of(make_voxels(info, content, ++seed), format);
        voxkit::test::MemorySource source(info, voxels);
        const Written file = encode(source, {.max_error = bound});
        const auto volume = open(file.bytes);
        ASSERT_TRUE(volume);
        const auto before = numbers(voxels, format), after = numbers(decode(*volume), format);
        double worst = 0;
        for (size_t i = 0; i < before.size(); ++i) worst = std::max(worst, std::abs(before[i] - after[i]));
        EXPECT_LE(worst, bound) << name(format);
        EXPECT_LE(file.bytes.size(), encode(source, {}).bytes.size()) << name(format) << " " << bound;
      }
}

TEST(Packed, FloatsThatAreNoNumbersComeBack) {
  VolumeInfo info = make_info({20, 9, 7}, VoxelFormat::float32);
  auto made = make_voxels(info, Content::blobs, 3);
  constexpr float infinity = std::numeric_limits<float>::infinity();
  const float special[] = {NAN, infinity, -infinity, -0.0f, 1e-45f, 3e38f, -3e38f};
  for (size_t i = 0; i < std::size(special); ++i) made[i * 31] = Voxel::of(special[i]);
  const Bytes voxels = bytes_of(made, info.format);
  voxkit::test::MemorySource source(info, voxels);
  EXPECT_EQ(decode(*open(encode(source, {}).bytes)), voxels);
  const auto lossy = open(encode(source, {.max_error = 1e35}).bytes);
  const auto before = numbers(voxels, info.format), after = numbers(decode(*lossy), info.format);
  for (size_t i = 0; i < before.size(); ++i) {
    if (std::isfinite(before[i]))
      EXPECT_LE(std::abs(before[i] - after[i]), 1e35);
    else
      EXPECT_TRUE(std::isnan(before[i]) ? std::isnan(after[i]) : before[i] == after[i]);
  }
}

TEST(Packed, ABoxTouchesItsPagesOnly) {
  const VolumeInfo info = make_info({100, 90, 80}, VoxelFormat::density8);
  const auto made = make_voxels(info, Content::noise, 5);
  const Bytes voxels = bytes_of(made, info.format);
  voxkit::test::MemorySource source(info, voxels);
  const auto volume = open(encode(source, {}).bytes);
  const Box box{{15, 16, 31}, {33, 32, 33}};
  const Bytes part = decode(*volume, 0, box);
  // They and those of coarser levels that they are predicted from: 2 x 1 x 2, 1 x 1 x 1, and the last.
  EXPECT_EQ(volume->pages_decoded(), 6u + 4 + 1 + 1);
  for (int64_t z = box.lo.z, i = 0; z < box.hi.z; ++z)
    for (int64_t y = box.lo.y; y < box.hi.y; ++y)
      for (int64_t x = box.lo.x; x < box.hi.x; ++x, ++i) {
        const std::byte expected = voxels[static_cast<size_t>((z * 90 + y) * 100 + x)];
        ASSERT_EQ(part[static_cast<size_t>(i)], expected);
        const auto one = volume->sample({x, y, z});
        ASSERT_TRUE(one);
        ASSERT_EQ(one->bytes[0], expected);
      }
  EXPECT_EQ(volume->pages_decoded(), 18u);  // each of them once more, then they were kept
  const auto alone = open(encode(source, {.levels = false}).bytes);
  EXPECT_EQ(decode(*alone, 0, box), part);
  EXPECT_EQ(alone->pages_decoded(), 6u);
}

TEST(Packed, CoarserPagesAreDecodedOnce) {
  const VolumeInfo info = make_info({200, 70, 130}, VoxelFormat::density16);
  voxkit::test::MemorySource source(info, bytes_of(make_voxels(info, Content::blobs, 8), info.format));
  const auto volume = open(encode(source, {}).bytes);
  uint64_t pages = 0;
  for (const PackedLevel& level : volume->levels())
    pages += static_cast<uint64_t>(level.pages.x * level.pages.y * level.pages.z);
  decode(*volume);
  EXPECT_EQ(volume->pages_decoded(), pages);
}

TEST(Packed, OneValueTakesNoBytesAndIsKnown) {
  const VolumeInfo info = make_info({100, 90, 80}, VoxelFormat::density16);
  voxkit::test::FlatSource flat(info, Voxel::of(uint16_t{777}));
  // The survey reads it; pages do not.
  const Bytes voxels = bytes_of(std::vector<Voxel>(720000, Voxel::of(uint16_t{777})), info.format);
  voxkit::test::MemorySource source(info, voxels);
  const auto volume = open(encode(source, {.levels = false}).bytes);
  EXPECT_EQ(volume->uniform(info.box(), 0), Voxel::of(uint16_t{777}));
  EXPECT_EQ(volume->pages_decoded(), 0u);
  EXPECT_EQ(decode(*volume), voxels);
  EXPECT_LT(volume->container().file_bytes(), 1500u);
}

TEST(Packed, WhatIsNotHeldIsRefused) {
  Context ctx = context();
  const auto refused = [&](VoxelFormat format, PackedOptions options, const char* word, bool labels = false) {
    VolumeInfo info = make_info({4, 4, 4}, format);
    info.is_labels = labels;
    voxkit::test::MemorySource source(info, bytes_of(make_voxels(info, Content::noise, 1), format));
    const auto done = encode_packed(
        source, options, [](auto) { return Status(); }, ctx);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, ErrorCode::usage);
    EXPECT_NE(done.error().what.find(word), std::string::npos) << done.error().what;
  };
  refused(VoxelFormat::rgba32, {.max_error = -1}, "finite");
  refused(VoxelFormat::density8, {.page_side = 12}, "8 or 16");
  refused(VoxelFormat::density8, {.max_error = NAN}, "finite");
  refused(VoxelFormat::density16, {.max_error = 0x1p31 - 1}, "2^31 - 1");
  refused(VoxelFormat::density8, {.max_error = 1}, "labels", true);
}

TEST(Packed, DamagedFilesAreRefusedOrRead) {
  std::mt19937 random(4);
  const int tries = std::getenv("VOXKIT_MUTATIONS") ? std::atoi(std::getenv("VOXKIT_MUTATIONS")) : 400;
  for (const VoxelFormat format : scalars)
    for (const double bound : {0.0, 2.0}) {
      if (format == VoxelFormat::bitmap && bound > 0) continue;
      const VolumeInfo info = make_info({19, 18, 17}, format);
      voxkit::test::MemorySource source(info, bytes_of(make_voxels(info, Content::blobs, 3), format));
      const Bytes file = encode(source, {.max_error = bound}).bytes;
      ASSERT_EQ(attack_packed(file).fault, "");
      for (size_t length = 0; length < file.size(); length += 7)
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
