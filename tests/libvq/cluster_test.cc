// Volumes with fewer bricks than they had: each place has the nearest of those that are left.
#include <gtest/gtest.h>

#include <limits>

#include "formats/full_scale.h"
#include "libmetrics/volume_diff.h"
#include "tests/libvq/attack.h"
#include "tests/libvq/volumes.h"

namespace voxkit::vq {
namespace {

using namespace voxkit::vq::test;

Options make_options(uint64_t codewords, uint64_t reduce = 0, Seeding seeding = Seeding::furthest) {
  Options options;
  options.codewords = codewords;
  options.reduce = reduce;
  options.seeding = seeding;
  return options;
}

uint64_t squared_distance(const Brick& a, const Brick& b) {
  uint64_t sum = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const int64_t d = int64_t{a[i]} - b[i];
    sum += static_cast<uint64_t>(d * d);
  }
  return sum;
}

/// All bricks of a volume, by place, in stored values.
std::vector<Brick> bricks_of(const Volume& volume) {
  std::vector<Brick> out;
  const Index3 size = volume.bricks();
  for (int64_t z = 0; z < size.z; ++z)
    for (int64_t y = 0; y < size.y; ++y)
      for (int64_t x = 0; x < size.x; ++x) {
        const auto id = volume.brick_id({x, y, z});
        EXPECT_TRUE(id);
        EXPECT_TRUE(volume.decode_brick(*id, out.emplace_back()));
        for (uint16_t& code : out.back())
          code = static_cast<uint16_t>(volume.params().base + volume.params().step * code);
      }
  return out;
}

TEST(VqCluster, EveryPlaceHasTheNearestBrick) {
  for (const int bits : {8, 12, 16})
    for (const Content content : {Content::scan, Content::noise, Content::blobs})
      for (const Seeding seeding : {Seeding::furthest, Seeding::d2})
        for (const Codebook codebook : {Codebook::rbuc, Codebook::packed}) {
          const VolumeInfo info = integer_info({41, 30, 22}, bits);
          const auto voxels = make_voxels(info, content, bits, 7);
          const Encoded whole = encode_to_memory(info, voxels);
          Options options = make_options(0, 5, seeding);
          options.codebook = codebook;
          const Encoded encoded = encode_to_memory(info, voxels, options);
          const Params& p = encoded.report.params;
          EXPECT_EQ(p.unique_bricks, whole.report.params.codewords);
          EXPECT_LE(p.codewords, std::max<uint64_t>(1, p.unique_bricks / 5));
          EXPECT_GE(p.codewords, std::max<uint64_t>(1, p.unique_bricks / 6));
          EXPECT_EQ(p.seeding, seeding);
          EXPECT_EQ(p.max_error, -1);
          EXPECT_LT(encoded.bytes.size(), whole.bytes.size());
          const Answer answer = attack(encoded.bytes);
          EXPECT_EQ(answer.fault, "");
          EXPECT_TRUE(answer.checked);

          const auto before = bricks_of(*whole.open()), after = bricks_of(*encoded.open());
          std::vector<Brick> centres = after;
          std::sort(centres.begin(), centres.end());
          centres.erase(std::unique(centres.begin(), centres.end()), centres.end());
          EXPECT_EQ(centres.size(), p.codewords);
          for (size_t i = 0; i < before.size(); i += 3) {
            const uint64_t distance = squared_distance(before[i], after[i]);
            for (const Brick& centre : centres) ASSERT_LE(distance, squared_distance(before[i], centre));
          }
        }
}

TEST(VqCluster, AsManyBricksAsThereAreIsLossless) {
  const VolumeInfo info = integer_info({30, 30, 30}, 8);
  const auto voxels = make_voxels(info, Content::scan, 8, 2);
  const Encoded whole = encode_to_memory(info, voxels);
  const uint64_t unique = whole.report.params.unique_bricks;
  for (const Options& options : {make_options(unique), make_options(unique + 1), make_options(0, 1)}) {
    const Encoded encoded = encode_to_memory(info, voxels, options);
    EXPECT_EQ(encoded.bytes, whole.bytes);
    EXPECT_EQ(encoded.report.params.seeding, std::nullopt);
    EXPECT_EQ(encoded.report.params.iterations, 0u);
  }
  const Encoded fewer = encode_to_memory(info, voxels, make_options(unique - 1));
  EXPECT_EQ(fewer.report.params.codewords, unique - 1);
  // One brick at least.
  EXPECT_EQ(encode_to_memory(info, voxels, make_options(0, 1000000)).report.params.codewords, 1u);
}

TEST(VqCluster, BytesDependOnNothingButTheVolume) {
  const VolumeInfo info = integer_info({70, 40, 35}, 12);
  const auto voxels = make_voxels(info, Content::scan, 12, 8);
  const Options options = make_options(100);
  const auto expected = encode_to_memory(info, voxels, options, 1).bytes;
  for (const int threads : {2, 5})
    EXPECT_EQ(encode_to_memory(info, voxels, options, threads).bytes, expected);
  voxkit::test::ForwardSource forward(info, voxels);
  EXPECT_EQ(encode_to_memory(forward, options).bytes, expected);
}

/// What is told on the way: the PSNR so far, which does not fall, and in the end is that of the file.
TEST(VqCluster, TheProgressIsThatOfTheFile) {
  for (const SampleType type : {SampleType::u8, SampleType::i16, SampleType::f32}) {
    const VolumeInfo info = voxkit::test::scalar_info({48, 40, 32}, type);  // whole bricks
    const auto voxels = make_voxels(info, Content::scan, type == SampleType::u8 ? 8 : 12, 3);
    Options options = make_options(0, 8);
    options.range = {-3, 4095 * 0.25 - 3};
    bool begun = false;
    std::vector<double> told;
    options.clustering = [&] { begun = true; };
    options.clustered = [&](uint32_t iteration, double psnr_db) {
      EXPECT_TRUE(begun);
      EXPECT_EQ(iteration, told.size());
      told.push_back(psnr_db);
    };
    const Encoded encoded = encode_to_memory(info, voxels, options);
    ASSERT_EQ(told.size(), encoded.report.params.iterations + 1u);
    ASSERT_GT(told.size(), 2u);
    EXPECT_TRUE(std::is_sorted(told.begin(), told.end()));

    voxkit::test::MemorySource original(info, voxels);
    const auto decoded = open_source(encoded.open());
    Context ctx = context();
    const auto diff = diff_volumes(original, *decoded, std::nullopt, nullptr, ctx);
    ASSERT_TRUE(diff);
    // Floats were quantised before, which is little beside this.
    EXPECT_NEAR(told.back(), diff->psnr_db, type == SampleType::f32 ? 0.01 : 1e-6);
    EXPECT_GT(diff->psnr_db, 15);
  }
}

TEST(VqCluster, IterationsAreLimited) {
  const VolumeInfo info = integer_info({60, 40, 32}, 8);
  const auto voxels = make_voxels(info, Content::scan, 8, 3);
  Options options = make_options(50);
  const uint32_t all = encode_to_memory(info, voxels, options).report.params.iterations;
  ASSERT_GT(all, 2u);
  options.max_iterations = 2;
  EXPECT_EQ(encode_to_memory(info, voxels, options).report.params.iterations, 2u);
}

TEST(VqCluster, WhatIsRefused) {
  const VolumeInfo info = integer_info({4, 4, 4}, 8);
  for (int which = 1; which < 8; ++which) {
    Options options;
    if (which & 1) options.codewords = 4;
    if (which & 2) options.reduce = 2;
    if (which & 4) options.max_error = 1;
    const Status status = validate(options, info);
    const bool one = which == 1 || which == 2 || which == 4;
    EXPECT_EQ(status.has_value(), one);
    if (!one) {
      EXPECT_EQ(status.error().code, ErrorCode::usage);
    }
  }
}

TEST(VqCluster, MemoryIsBounded) {
  const VolumeInfo info = integer_info({100, 100, 60}, 8);
  const auto voxels = make_voxels(info, Content::noise, 8, 1);
  int refused = 0, done = 0;
  for (uint64_t limit = 1 << 20; limit <= uint64_t{1} << 26; limit += limit / 2) {
    voxkit::test::MemorySource source(info, voxels);
    Context ctx = context(2, limit);
    Options options = make_options(0, 100);
    options.max_iterations = 1;
    const auto report = encode(
        source, options, [](auto) { return Status{}; }, ctx);
    if (report) {
      ++done;
    } else {
      EXPECT_EQ(report.error().code, ErrorCode::limit);
      ++refused;
    }
    EXPECT_TRUE(ctx.memory->reserve(limit, "all of it"));
  }
  EXPECT_GT(refused, 2);
  EXPECT_GT(done, 1);
}

}  // namespace
}  // namespace voxkit::vq
