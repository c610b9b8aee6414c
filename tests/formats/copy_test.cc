#include "formats/copy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/memory_volume.h"

namespace voxkit {
namespace {

using test::color_info;
using test::FlatSource;
using test::ForwardSource;
using test::MemorySink;
using test::MemorySource;
using test::scalar_info;

std::vector<std::byte> random_bytes(size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::byte> bytes(count);
  for (std::byte& b : bytes) b = static_cast<std::byte>(random());
  return bytes;
}

/// Knows that every aligned cube of `side` voxels with a zero at its corner is zero.
class SparseSource : public MemorySource {
 public:
  using MemorySource::MemorySource;
  std::optional<Voxel> uniform(const Box& box) const override {
    for (int64_t z = box.lo.z; z < box.hi.z; ++z)
      for (int64_t y = box.lo.y; y < box.hi.y; ++y)
        for (int64_t x = box.lo.x; x < box.hi.x; ++x)
          if (voxels_[static_cast<size_t>((z * info_.dims.y + y) * info_.dims.x + x)] != std::byte{0})
            return {};
    return Voxel{};
  }
};

TEST(Slabs, CoverTheBoxInOrder) {
  for (const uint64_t target : {1u, 700u, 5000u, 100000u, 10000000u})
    for (const int64_t z0 : {0, 5, 31, 32, 40}) {
      const Box box{{3, 2, z0}, {20, 21, z0 + 77}};
      const Slabs slabs(box, 4, target);
      int64_t z = z0;
      for (int64_t i = 0; i < slabs.count(); ++i) {
        const Box slab = slabs.slab(i);
        ASSERT_EQ(slab.lo, Index3(3, 2, z));
        ASSERT_GT(slab.hi.z, z);
        z = slab.hi.z;
        const uint64_t bytes = static_cast<uint64_t>(slab.voxels()) * 4;
        ASSERT_LE(bytes, slabs.bytes());
        ASSERT_LE(bytes, std::max<uint64_t>(target, 17 * 19 * 4));
        if (z < box.hi.z && target >= 17 * 19 * 4 * 32) {
          ASSERT_EQ(z % 32, 0);
        }
      }
      ASSERT_EQ(z, box.hi.z);
    }
}

TEST(Slabs, HugeVolumesDoNotOverflow) {
  const Slabs slabs({{0, 0, 0}, {max_side, max_side, 1}}, 4, 1 << 25);
  EXPECT_EQ(slabs.count(), 1);
  EXPECT_EQ(slabs.bytes(), std::numeric_limits<uint64_t>::max());
  MemoryBudget memory(1000);
  Context ctx{.threads = 1, .memory = &memory};
  const auto buffer = Buffer::allocate(slabs.bytes(), "a slab", ctx);
  ASSERT_FALSE(buffer);
  EXPECT_EQ(buffer.error().code, ErrorCode::limit);
}

TEST(CopyVolume, EveryFormatThreadsAndKind) {
  MemoryBudget memory(uint64_t{1} << 19);  // 64 KiB slabs
  for (const Index3 dims : {Index3(1, 1, 1), Index3(13, 7, 101), Index3(600, 70, 40)})
    for (const VoxelFormat format : {VoxelFormat::density8, VoxelFormat::rgb24, VoxelFormat::rgba32})
      for (const int threads : {1, 3})
        for (const bool forward : {false, true}) {
          const VolumeInfo info = color_info(dims, format);
          const auto voxels = random_bytes(static_cast<size_t>(info.box().voxels() * voxel_bytes(format)), 7);
          Context ctx{.threads = threads, .memory = &memory};
          double done = 0;
          ctx.progress = [&](double fraction) {
            EXPECT_GE(fraction, done);
            done = fraction;
          };
          MemorySink sink(dims, format);
          MemorySource any(info, voxels);
          ForwardSource front(info, voxels);
          const Status status =
              copy_volume(forward ? static_cast<VolumeSource&>(front) : any, info.box(), sink, ctx);
          ASSERT_TRUE(status) << status.error().what;
          ASSERT_TRUE(sink.finish());
          ASSERT_EQ(sink.voxels, voxels);
          ASSERT_EQ(done, 1);
          // Nothing stays reserved.
          ASSERT_TRUE(memory.reserve(memory.limit(), "all"));
          memory.release(memory.limit());
        }
}

TEST(CopyVolume, PartOfAVolume) {
  MemoryBudget memory(1 << 20);
  Context ctx{.threads = 2, .memory = &memory};
  const VolumeInfo info = scalar_info({50, 40, 60}, SampleType::u16);
  const auto voxels = random_bytes(50 * 40 * 60 * 2, 1);
  MemorySource source(info, voxels);
  const Box box{{3, 5, 7}, {44, 39, 58}};
  MemorySink sink(box.size(), info.format);
  ASSERT_TRUE(copy_volume(source, box, sink, ctx));
  size_t at = 0;
  for (int64_t z = box.lo.z; z < box.hi.z; ++z)
    for (int64_t y = box.lo.y; y < box.hi.y; ++y)
      for (int64_t x = box.lo.x; x < box.hi.x; ++x)
        for (size_t b = 0; b < 2; ++b)
          ASSERT_EQ(sink.voxels[at++], voxels[static_cast<size_t>((z * 40 + y) * 50 + x) * 2 + b]);
}

TEST(CopyVolume, UniformBoxesAreNotRead) {
  MemoryBudget memory(1 << 24);
  Context ctx{.threads = 2, .memory = &memory};
  MemorySink flat_sink({100, 100, 100}, VoxelFormat::rgba32);
  FlatSource flat(color_info({100, 100, 100}, VoxelFormat::rgba32), Voxel::of(uint32_t{0x01020304}));
  ASSERT_TRUE(copy_volume(flat, flat.info().box(), flat_sink, ctx));
  ASSERT_EQ(flat_sink.voxels.size(), 4000000u);
  EXPECT_EQ(flat_sink.voxels.back(), std::byte{1});

  // A diagonal of cubes in a void.
  const Index3 dims(200, 150, 130);
  std::vector<std::byte> voxels(static_cast<size_t>(dims.x * dims.y * dims.z));
  for (int64_t i = 3; i < 130; ++i) voxels[static_cast<size_t>((i * dims.y + i) * dims.x + i)] = std::byte{9};
  SparseSource sparse(scalar_info(dims, SampleType::u8), voxels);
  MemorySink sink(dims, VoxelFormat::density8);
  ASSERT_TRUE(copy_volume(sparse, sparse.info().box(), sink, ctx));
  EXPECT_EQ(sink.voxels, voxels);
  EXPECT_LT(sparse.voxels_read, dims.x * dims.y * dims.z / 10);
  EXPECT_GT(sparse.voxels_read, 0);
}

TEST(CopyVolume, ErrorsOfEitherSideStopIt) {
  MemoryBudget memory(1 << 16);
  Context ctx{.threads = 2, .memory = &memory};
  MemorySource source(scalar_info({64, 64, 64}, SampleType::u8), std::vector<std::byte>(64 * 64 * 64));
  MemorySink small({64, 64, 10}, VoxelFormat::density8);
  EXPECT_FALSE(copy_volume(source, source.info().box(), small, ctx));
  EXPECT_FALSE(small.finished);
  MemorySink sink({64, 64, 100}, VoxelFormat::density8);
  EXPECT_FALSE(copy_volume(source, {{0, 0, 0}, {64, 64, 100}}, sink, ctx));
}

TEST(CopyVolume, StaysWithinTheLimit) {
  MemoryBudget memory(4000);
  Context ctx{.threads = 1, .memory = &memory};
  MemorySource source(scalar_info({64, 64, 2}, SampleType::u8), std::vector<std::byte>(64 * 64 * 2));
  MemorySink sink({64, 64, 2}, VoxelFormat::density8);
  const Status status = copy_volume(source, source.info().box(), sink, ctx);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::limit);
  EXPECT_NE(status.error().what.find("--max-memory"), std::string::npos);
}

TEST(MeasureRange, MatchesAPlainLoop) {
  MemoryBudget memory(1 << 20);
  const Index3 dims(130, 70, 45);
  std::mt19937 random(3);
  std::vector<uint16_t> values(static_cast<size_t>(dims.x * dims.y * dims.z));
  for (uint16_t& v : values) v = static_cast<uint16_t>(1000 + random() % 5000);
  const auto [lo, hi] = std::minmax_element(values.begin(), values.end());
  const ValueRange expected{double(*lo), double(*hi)};
  for (const int threads : {1, 4}) {
    Context ctx{.threads = threads, .memory = &memory};
    MemorySource source(scalar_info(dims, SampleType::i16), test::bytes_of(values));
    ForwardSource forward(scalar_info(dims, SampleType::i16), test::bytes_of(values));
    EXPECT_EQ(measure_range(source, ctx).value(), expected);
    EXPECT_EQ(measure_range(forward, ctx).value(), expected);
  }
}

TEST(MeasureRange, FloatsAndFlat) {
  MemoryBudget memory(1 << 20);
  Context ctx{.threads = 2, .memory = &memory};
  const float nan = std::nanf(""), inf = std::numeric_limits<float>::infinity();
  const VolumeInfo info = scalar_info({5, 1, 1}, SampleType::f32);
  EXPECT_EQ(measure_range(*test::volume<float>(info, {nan, -2, inf, 3, -inf}), ctx).value(),
            (ValueRange{-2, 3}));
  EXPECT_EQ(measure_range(*test::volume<float>(info, {nan, nan, inf, nan, -inf}), ctx).value(),
            (ValueRange{0, 0}));
  FlatSource flat(scalar_info({1000000, 1000000, 1000}, SampleType::f32), Voxel::of(7.5f));
  EXPECT_EQ(measure_range(flat, ctx).value(), (ValueRange{7.5, 7.5}));
  FlatSource color(color_info({2, 2, 2}, VoxelFormat::rgb24), Voxel{});
  EXPECT_FALSE(measure_range(color, ctx));
}

}  // namespace
}  // namespace voxkit
