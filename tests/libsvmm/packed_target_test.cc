// Layout packed with a target in place of a bound: what comes out, and that it is what the bound found gives.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "formats/volume/readers.h"
#include "libmetrics/volume_diff.h"
#include "libsvmm/packed/target.h"
#include "tests/libsvmm/packed_files.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;
using voxkit::test::Bytes;
using Kind = PackedTarget::Kind;

std::unique_ptr<VolumeSource> builtin(const char* name) {
  auto source = open_builtin(name);
  EXPECT_TRUE(source) << source.error().what;
  return std::move(*source);
}
double psnr(VolumeSource& source, const Written& file) {
  Context ctx = context();
  const auto decoded = open_source(open(file.bytes), 0);
  return diff_volumes(source, **decoded, std::nullopt, nullptr, ctx)->psnr_db;
}
double bits(VolumeSource& source, const Written& file) {
  return 8 * static_cast<double>(file.bytes.size()) /
         static_cast<double>(*checked_voxels(source.info().dims));
}
Written bounded(VolumeSource& source, double max_error) {
  return encode(source, {.max_error = max_error});
}

/// Waves and a little noise.
voxkit::test::MemorySource waves() {
  const VolumeInfo info = make_info({40, 33, 20}, VoxelFormat::float32);
  std::mt19937 random(8);
  std::vector<Voxel> voxels;
  for (int64_t i = 0; i < 40 * 33 * 20; ++i)
    voxels.push_back(Voxel::of(static_cast<float>(std::sin(static_cast<double>(i % 40) / 5) +
                                                  std::cos(static_cast<double>(i / 40) / 7) +
                                                  static_cast<double>(random() % 1000) / 5000)));
  return {info, bytes_of(voxels, info.format)};
}

TEST(PackedTarget, FloatsHaveTheDecibels) {
  auto source = waves();
  for (const double target : {35.0, 72.5}) {
    const Written file = encode(source, {.target = PackedTarget{Kind::psnr, target}});
    EXPECT_NEAR(psnr(source, file), target, 0.2);
    EXPECT_EQ(file.bytes, bounded(source, file.params.max_error).bytes);
  }
}

TEST(PackedTarget, IntegersHaveAtLeastTheDecibels) {
  auto source = builtin("membrane:48,40,17:1");
  for (const double target : {31.0, 50.0}) {
    const Written file = encode(*source, {.target = PackedTarget{Kind::psnr, target}});
    EXPECT_EQ(file.bytes, bounded(*source, file.params.max_error).bytes);
    EXPECT_GE(psnr(*source, file), target - 0.2);
    // The next bound has too few.
    EXPECT_LT(psnr(*source, bounded(*source, file.params.max_error + 1)), target + 0.2) << target;
  }
}

TEST(PackedTarget, FilesHaveTheBits) {
  auto floats = waves();
  const Written wave = encode(floats, {.target = PackedTarget{Kind::bits, 6}});
  EXPECT_NEAR(bits(floats, wave), 6, 0.12);
  for (const char* name : {"marschner-lobb:40", "noise:32:1"}) {
    auto source = builtin(name);
    constexpr double target = 3;
    const Written file = encode(*source, {.target = PackedTarget{Kind::bits, target}});
    EXPECT_EQ(file.bytes, bounded(*source, file.params.max_error).bytes);
    EXPECT_LE(bits(*source, file), 1.02 * target) << name;
    EXPECT_GT(bits(*source, bounded(*source, file.params.max_error - 1)), 0.98 * target) << name;
  }
}

TEST(PackedTarget, WhatCannotBeLossyIsNot) {
  auto source = builtin("membrane:24,24,24:1");
  EXPECT_EQ(encode(*source, {.target = PackedTarget{Kind::psnr, 90}}).params.max_error, 0);
  EXPECT_EQ(encode(*source, {.target = PackedTarget{Kind::bits, 12}}).params.max_error, 0);
  auto floats = waves();
  EXPECT_EQ(encode(floats, {.target = PackedTarget{Kind::bits, 40}}).params.max_error, 0);
  EXPECT_EQ(encode(floats, {.target = PackedTarget{Kind::psnr, 300}}).params.max_error, 0);
  // Fewer bits than the file's tables take: the smallest there is.
  const Written least = encode(*source, {.target = PackedTarget{Kind::bits, 0.01}});
  EXPECT_LT(least.bytes.size(), 2500u);
}

TEST(PackedTarget, OneThreadFindsTheSame) {
  auto source = waves();
  const PackedOptions options{.target = PackedTarget{Kind::psnr, 50}};
  EXPECT_EQ(encode(source, options, 1).bytes, encode(source, options, 3).bytes);
}

TEST(PackedTarget, WhatIsNotHeldIsRefused) {
  Context ctx = context();
  const auto refused = [&](const PackedOptions& options, const char* word, bool labels, bool filled) {
    VolumeInfo info = make_info({4, 4, 4}, VoxelFormat::density8);
    info.is_labels = labels;
    if (filled) info.fill = 0;
    voxkit::test::MemorySource source(info, Bytes(64));
    const auto done = encode_packed(
        source, options, [](auto) { return Status(); }, ctx);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, ErrorCode::usage);
    EXPECT_NE(done.error().what.find(word), std::string::npos) << done.error().what;
  };
  const PackedTarget decibels{Kind::psnr, 40};
  refused({.target = decibels}, "labels", true, false);
  refused({.target = decibels}, "fill", false, true);
  refused({.max_error = 1, .target = decibels}, "one of them", false, false);
  refused({.target = PackedTarget{Kind::bits, 0}}, "above 0", false, false);
  refused({.target = PackedTarget{Kind::psnr, NAN}}, "above 0", false, false);
}

/// Decibels of a bound on a volume that is predicted well, so that they fall slowly at last.
double decibels(double bound) {
  return 60 - 20 * std::log10(bound + 0.5) + 3 * std::log10(1 + bound / 40);
}

TEST(BoundSearch, FindsTheLargestWholeBound) {
  for (double target = 10; target < 70; target += 0.7) {
    BoundSearch search({Kind::psnr, target}, true, 1, 10000);
    int tries = 0;
    for (auto bound = search.next(1); bound; bound = search.next(1), ++tries)
      search.add(*bound, *bound == 0 ? INFINITY : decibels(*bound) + 1);  // samples are 1 dB off
    EXPECT_LE(tries, 4);
    double bound = search.best();
    const auto whole = [](double b) { return b == 0 ? INFINITY : decibels(b); };
    search.correct(bound, whole(bound));
    if (!search.near(whole(bound))) bound = search.best();
    EXPECT_GE(whole(bound), target - 0.2) << target;
    EXPECT_LT(whole(bound + 1), target + 0.2) << target;
  }
}

}  // namespace
}  // namespace voxkit::svmm
