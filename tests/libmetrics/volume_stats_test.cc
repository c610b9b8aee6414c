#include "libmetrics/volume_stats.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <random>

#include "formats/copy.h"
#include "tests/memory_volume.h"

namespace voxkit {
namespace {

using test::bytes_of;
using test::color_info;
using test::FlatSource;
using test::ForwardSource;
using test::scalar_info;
using test::volume;

class VolumeStatsTest : public testing::Test {
 protected:
  VolumeStats stats(VolumeSource& source, const ValueRange& range = {}, int threads = 2) {
    Context ctx{.threads = threads, .memory = &memory_};
    auto result = volume_stats(source, range, ctx);
    EXPECT_TRUE(result) << result.error().what;
    return result ? *result : VolumeStats{};
  }
  MemoryBudget memory_{1 << 24};
};

/// By the book, from all samples, sorted.
struct Plain {
  std::vector<double> sorted;
  explicit Plain(std::vector<double> samples) : sorted(std::move(samples)) {
    std::sort(sorted.begin(), sorted.end());
  }
  double mean() const {
    long double sum = 0;
    for (const double v : sorted) sum += v;
    return static_cast<double>(sum / static_cast<long double>(sorted.size()));
  }
  double deviation() const {
    const double m = mean();
    long double sum = 0;
    for (const double v : sorted)
      sum += (static_cast<long double>(v) - m) * (static_cast<long double>(v) - m);
    return static_cast<double>(std::sqrt(sum / static_cast<long double>(sorted.size())));
  }
  double percentile(double share) const {
    const auto rank = static_cast<size_t>(std::ceil(share / 100 * static_cast<double>(sorted.size())));
    return sorted[std::max<size_t>(rank, 1) - 1];
  }
  std::map<double, uint64_t> counts() const {
    std::map<double, uint64_t> counts;
    for (const double v : sorted) ++counts[v];
    return counts;
  }
  double entropy() const {
    double bits = 0;
    for (const auto& [value, count] : counts()) {
      const double share = static_cast<double>(count) / static_cast<double>(sorted.size());
      bits -= share * std::log2(share);
    }
    return bits;
  }
};

void expect_equal(const SampleStats& s, const Plain& plain, double tolerance) {
  ASSERT_EQ(s.samples, plain.sorted.size());
  EXPECT_EQ(s.least, plain.sorted.front());
  EXPECT_EQ(s.greatest, plain.sorted.back());
  const double extent = s.greatest - s.least;
  EXPECT_NEAR(s.mean, plain.mean(), 1e-11 * extent);
  EXPECT_NEAR(s.deviation, plain.deviation(), 1e-11 * extent);
  for (size_t i = 0; i < s.percentiles.size(); ++i) {
    const double want = plain.percentile(SampleStats::shares[i]);
    EXPECT_GE(s.percentiles[i], want) << i;
    EXPECT_LE(s.percentiles[i], want + tolerance) << i;
  }
  if (s.different) {
    EXPECT_EQ(*s.different, plain.counts().size());
    EXPECT_NEAR(*s.entropy, plain.entropy(), 1e-9);
  }
  ASSERT_LE(s.histogram.size(), static_cast<size_t>(SampleStats::most_bins));
  EXPECT_EQ(std::accumulate(s.histogram.begin(), s.histogram.end(), uint64_t{0}), s.samples);
}

/// Each bin of whole numbers has those samples that are in it.
void expect_bins(const SampleStats& s, const Plain& plain) {
  std::vector<uint64_t> want(s.histogram.size());
  for (const double v : plain.sorted) ++want[static_cast<size_t>((v - s.least) / s.bin_width)];
  EXPECT_EQ(s.histogram, want);
  EXPECT_EQ(s.bin_width, std::floor(s.bin_width));
}

TEST_F(VolumeStatsTest, BytesAndWordsAreCountedExactly) {
  std::mt19937 random(1);
  std::vector<uint8_t> bytes(41 * 30 * 70);
  std::vector<uint16_t> words(bytes.size());
  for (size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<uint8_t>(random() % 100 * (random() % 3));
    words[i] = static_cast<uint16_t>(random() % 5 == 0 ? 0 : random());
  }
  const VolumeInfo of_bytes = scalar_info({41, 30, 70}, SampleType::u8);
  const VolumeStats s = stats(*volume(of_bytes, bytes));
  const Plain plain({bytes.begin(), bytes.end()});
  ASSERT_EQ(s.channels.size(), 1u);
  EXPECT_EQ(s.voxels, bytes.size());
  EXPECT_EQ(s.void_voxels, plain.counts().at(0));
  expect_equal(s.channels[0], plain, 0);
  expect_bins(s.channels[0], plain);

  VolumeInfo of_words = scalar_info({41, 30, 70}, SampleType::u16);
  const Plain wide({words.begin(), words.end()});
  expect_equal(stats(*volume(of_words, words)).channels[0], wide, 0);
  // Signed samples, of which one value is none; front to back, on any number of threads.
  of_words.sample_type = SampleType::i16;
  of_words.fill = words[7];
  std::vector<double> samples;
  for (const uint16_t w : words)
    if (w != words[7]) samples.push_back(of_words.sample(w));
  const Plain held(samples);
  for (const int threads : {1, 2, 7}) {
    ForwardSource source(of_words, bytes_of(words));
    const VolumeStats t = stats(source, {}, threads);
    EXPECT_EQ(t.fill, words.size() - samples.size());
    expect_equal(t.channels[0], held, 0);
    expect_bins(t.channels[0], held);
  }
}

TEST_F(VolumeStatsTest, FloatsToAPartOfTheirRange) {
  std::mt19937 random(2);
  for (const bool few : {false, true}) {
    std::vector<float> values(64 * 64 * 40);
    std::normal_distribution<float> normal(few ? 1000 : 1, few ? 30 : 0.25f);
    for (float& v : values) v = few ? std::round(normal(random)) : normal(random);
    values[5] = 0;
    values[6] = -0.0f;
    std::vector<double> finite(values.begin(), values.end());
    values.insert(values.end(), 64 * 64, std::numeric_limits<float>::quiet_NaN());
    values.insert(values.end(), 64 * 64, -std::numeric_limits<float>::infinity());
    const VolumeInfo info = scalar_info({64, 64, 42}, SampleType::f32);
    const Plain plain(finite);
    const ValueRange range{plain.sorted.front(), plain.sorted.back()};
    const VolumeStats s = stats(*volume(info, values), range), one = stats(*volume(info, values), range, 1);
    EXPECT_EQ(s.nan, 64u * 64);
    EXPECT_EQ(s.infinite, 64u * 64);
    EXPECT_EQ(s.void_voxels, 2u);
    EXPECT_EQ(s.channels[0].different.has_value(), few);
    expect_equal(s.channels[0], plain, few ? 0 : (range.hi - range.lo) / 65536 * 1.001);
    EXPECT_EQ(s.channels[0].mean, one.channels[0].mean);
    EXPECT_EQ(s.channels[0].deviation, one.channels[0].deviation);
    EXPECT_EQ(s.channels[0].histogram, one.channels[0].histogram);
  }
}

TEST_F(VolumeStatsTest, ChannelsOfColors) {
  std::mt19937 random(3);
  std::vector<uint8_t> bytes(20 * 9 * 33 * 4);
  for (uint8_t& b : bytes) b = static_cast<uint8_t>(random() % 4 * 85);
  const VolumeStats s = stats(*volume(color_info({20, 9, 33}, VoxelFormat::rgba32), bytes));
  ASSERT_EQ(s.channels.size(), 4u);
  uint64_t clear = 0;
  for (size_t c = 0; c < 4; ++c) {
    std::vector<double> samples;
    for (size_t i = c; i < bytes.size(); i += 4) samples.push_back(bytes[i]);
    const Plain plain(samples);
    expect_equal(s.channels[c], plain, 0);
    if (c == 3) clear = plain.counts().at(0);
  }
  EXPECT_EQ(s.void_voxels, clear);
}

TEST_F(VolumeStatsTest, WhatIsUniformIsCountedAndNotRead) {
  VolumeInfo info = scalar_info({1000, 2000, 3000}, SampleType::u8);
  FlatSource flat(info, Voxel::of(uint8_t{7}));
  const VolumeStats s = stats(flat);
  EXPECT_EQ(s.channels[0].samples, 6'000'000'000u);
  EXPECT_EQ(s.channels[0].mean, 7);
  EXPECT_EQ(s.channels[0].deviation, 0);
  EXPECT_EQ(*s.channels[0].entropy, 0);
  EXPECT_EQ(s.channels[0].histogram, std::vector<uint64_t>{6'000'000'000u});
  info = scalar_info(info.dims, SampleType::f32);
  FlatSource none(info, Voxel::of(std::numeric_limits<float>::quiet_NaN()));
  const VolumeStats n = stats(none);
  EXPECT_EQ(n.nan, 6'000'000'000u);
  EXPECT_EQ(n.channels[0].samples, 0u);
}

TEST_F(VolumeStatsTest, TheMemoryOfCountsIsCounted) {
  MemoryBudget little(100000);
  Context ctx{.threads = 2, .memory = &little};
  const VolumeInfo info = scalar_info({1, 1, 1}, SampleType::u16);
  const auto refused = volume_stats(*volume(info, std::vector<uint16_t>{1}), {}, ctx);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::limit);
}

}  // namespace
}  // namespace voxkit
