// Centres and assignment are those of the plain algorithms, on every machine and any number of threads.
#include "libvq/kmeans.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "tests/libvq/kmeans_bricks.h"
#include "tests/libvq/kmeans_reference.h"

namespace voxkit::vq {
namespace {

using test::all_kinds;
using test::Kind;
using test::make_bricks;

Result<Clustering> run(std::span<const Brick> bricks, std::span<const uint64_t> weights,
                       const KMeansOptions& options, int threads = 1) {
  MemoryBudget budget;
  Context ctx;
  ctx.memory = &budget;
  ctx.threads = threads;
  return kmeans(bricks, weights, options, ctx);
}

reference::Clusters by_the_book(std::span<const Brick> bricks, std::span<const uint64_t> weights,
                                const KMeansOptions& options) {
  reference::Clusters c = options.seeding == Seeding::furthest
                              ? reference::furthest_first(bricks, options.codewords)
                              : reference::d2(bricks, weights, options.codewords);
  reference::k_means(c, bricks, weights, options.max_iterations);
  return c;
}

reference::Wide error_of(const reference::Clusters& c, std::span<const uint64_t> weights) {
  reference::Wide sum = 0;
  for (size_t i = 0; i < weights.size(); ++i) sum += reference::Wide{c.distance[i]} * weights[i];
  return sum;
}

/// Everything that does not matter, and what must be equal.
void expect_equal(std::span<const Brick> bricks, std::span<const uint64_t> weights, KMeansOptions options,
                  const std::string& what) {
  const reference::Clusters expected = by_the_book(bricks, weights, options);
  for (const bool native : {true, false})
    for (const int threads : {1, 3}) {
      if (!native && threads == 3) continue;
      options.native = native;
      const Result<Clustering> got = run(bricks, weights, options, threads);
      ASSERT_TRUE(got) << what << got.error().what;
      ASSERT_EQ(got->centres, expected.centres) << what << " native " << native << " threads " << threads;
      ASSERT_EQ(got->assignment, expected.centre) << what << " native " << native << " threads " << threads;
      EXPECT_EQ(got->iterations, expected.iterations) << what;
      EXPECT_TRUE(got->error == error_of(expected, weights)) << what;
    }
}

std::vector<uint64_t> make_weights(size_t count, uint64_t most, uint32_t seed) {
  std::mt19937_64 random(seed);
  std::vector<uint64_t> weights(count);
  for (uint64_t& w : weights) w = 1 + random() % most;
  return weights;
}

class KMeansByTheBook : public testing::TestWithParam<std::tuple<Kind, int, Seeding>> {};

TEST_P(KMeansByTheBook, SameCentresAndAssignment) {
  const auto [kind, bits, seeding] = GetParam();
  uint32_t seed = 1;
  for (const size_t count : {2u, 33u, 150u, 420u})
    for (const uint32_t k : {1u, 2u, 9u, 64u, 200u}) {
      if (k >= count) continue;
      ++seed;
      const std::vector<Brick> bricks = make_bricks(kind, count, bits, seed);
      const uint64_t most = seed % 3 == 0 ? 1 : seed % 3 == 1 ? 9 : uint64_t{1} << 32;
      expect_equal(bricks, make_weights(count, most, seed), {.codewords = k, .seeding = seeding},
                   "count " + std::to_string(count) + " k " + std::to_string(k));
    }
}
INSTANTIATE_TEST_SUITE_P(Bricks, KMeansByTheBook,
                         testing::Combine(testing::ValuesIn(all_kinds), testing::Values(1, 8, 12, 16),
                                          testing::Values(Seeding::furthest, Seeding::d2)));

TEST(KMeans, LargerAsByTheBook) {
  // Several rounds of seeding, several blocks of queries and a tree of several levels.
  const std::vector<Brick> bricks = make_bricks(Kind::clusters, 6000, 12, 5);
  const std::vector<uint64_t> weights = make_weights(bricks.size(), 3, 5);
  for (const Seeding seeding : {Seeding::furthest, Seeding::d2})
    expect_equal(bricks, weights, {.codewords = 2500, .seeding = seeding, .max_iterations = 2}, "");
}

TEST(KMeans, ManyBricksAtTheSameDistance) {
  // More than are looked at together, so that which ones are must not matter.
  std::vector<Brick> bricks(30000);
  for (size_t i = 0; i < bricks.size(); ++i)
    for (size_t bit = 0; bit < 15; ++bit) {
      const auto v = static_cast<uint16_t>((i * 7919 % 32768) >> bit & 1);
      for (size_t copy = 0; copy < 4; ++copy) bricks[i][4 * bit + copy] = v;
    }
  const std::vector<uint64_t> weights(bricks.size(), 1);
  expect_equal(bricks, weights, {.codewords = 50, .max_iterations = 1}, "");
}

TEST(KMeans, EmptyClustersAreFilled) {
  // If the centres are 1000, 2000 and 4460, then 3200 is nearest to 2000, and 2600 is the mean of these two.
  // But the means of the others come near to them, and take both.
  uint32_t filled = 0;
  for (uint32_t seed = 0; seed < 500; ++seed) {
    std::mt19937 random(seed);
    const uint64_t heavy = 6 + random() % 3;
    std::vector<std::pair<uint16_t, uint64_t>> points{{1000, 1}, {1490, heavy}, {2000, 1},
                                                      {3200, 1}, {3250, heavy}, {4460, 1}};
    for (size_t i = points.size(); i > 1; --i) std::swap(points[i - 1], points[random() % i]);
    std::vector<Brick> bricks(points.size(), Brick{});
    std::vector<uint64_t> weights;
    for (size_t i = 0; i < points.size(); ++i) {
      bricks[i][0] = points[i].first;
      weights.push_back(points[i].second);
    }
    for (const uint32_t limit : {1u, ~0u}) {
      const KMeansOptions options{.codewords = 3, .seeding = Seeding::d2, .max_iterations = limit};
      filled += by_the_book(bricks, weights, options).filled;
      expect_equal(bricks, weights, options, "seed " + std::to_string(seed));
    }
  }
  EXPECT_GT(filled, 5u);
}

TEST(KMeans, ItStopsWhereNothingIsNearerAndCentresAreMeans) {
  for (const int bits : {8, 12, 16}) {
    const std::vector<Brick> bricks = make_bricks(Kind::ramps, 3000, bits, 8);
    const std::vector<uint64_t> weights = make_weights(bricks.size(), 5, 8);
    const Result<Clustering> got = run(bricks, weights, {.codewords = 190}, 2);
    ASSERT_TRUE(got);
    ASSERT_EQ(got->centres.size(), 190u);
    EXPECT_GT(got->iterations, 1u);
    std::vector<std::array<uint64_t, brick_voxels>> sums(190);
    std::vector<uint64_t> weight(190);
    for (size_t i = 0; i < bricks.size(); ++i) {
      const uint32_t c = got->assignment[i];
      const uint64_t own = reference::distance_s(reference::infinite, bricks[i], got->centres[c]);
      for (const Brick& centre : got->centres)
        ASSERT_GE(reference::distance_s(reference::infinite, bricks[i], centre), own);
      for (size_t v = 0; v < brick_voxels; ++v) sums[c][v] += weights[i] * bricks[i][v];
      weight[c] += weights[i];
    }
    for (size_t c = 0; c < 190; ++c) {
      ASSERT_GT(weight[c], 0u);
      for (size_t v = 0; v < brick_voxels; ++v)
        ASSERT_EQ(got->centres[c][v], (2 * sums[c][v] + weight[c]) / (2 * weight[c]));
    }
  }
}

TEST(KMeans, ErrorNeverGrows) {
  const std::vector<Brick> bricks = make_bricks(Kind::clusters, 2000, 12, 11);
  const std::vector<uint64_t> weights(bricks.size(), 1);
  std::vector<SquaredError> errors;
  KMeansOptions options{.codewords = 100};
  options.report = [&](uint32_t iteration, SquaredError error) {
    EXPECT_EQ(iteration, errors.size());
    errors.push_back(error);
  };
  const Result<Clustering> got = run(bricks, weights, options);
  ASSERT_TRUE(got);
  ASSERT_EQ(errors.size(), got->iterations + 1);
  for (size_t i = 1; i < errors.size(); ++i) EXPECT_TRUE(errors[i] < errors[i - 1]);
  EXPECT_TRUE(errors.back() == got->error);
}

TEST(KMeans, NoIterationsLeaveBricksAsCentres) {
  const std::vector<Brick> bricks = make_bricks(Kind::noise, 300, 12, 2);
  const std::vector<uint64_t> weights(bricks.size(), 1);
  for (const Seeding seeding : {Seeding::furthest, Seeding::d2}) {
    const Result<Clustering> got =
        run(bricks, weights, {.codewords = 40, .seeding = seeding, .max_iterations = 0});
    ASSERT_TRUE(got);
    EXPECT_EQ(got->iterations, 0u);
    EXPECT_EQ(std::set<Brick>(got->centres.begin(), got->centres.end()).size(), 40u);
    for (const Brick& centre : got->centres)
      EXPECT_NE(std::find(bricks.begin(), bricks.end(), centre), bricks.end());
  }
}

TEST(KMeans, WithAsManyCodewordsAsBricksTheseAreTheCentres) {
  const std::vector<Brick> bricks = make_bricks(Kind::noise, 40, 12, 2);
  const std::vector<uint64_t> weights(bricks.size(), 3);
  for (const uint32_t k : {40u, 41u, ~0u}) {
    const Result<Clustering> got = run(bricks, weights, {.codewords = k});
    ASSERT_TRUE(got);
    EXPECT_EQ(got->centres, bricks);
    for (uint32_t i = 0; i < bricks.size(); ++i) EXPECT_EQ(got->assignment[i], i);
    EXPECT_TRUE(got->error == 0);
  }
}

TEST(KMeans, NoMoreCentresThanDifferentBricks) {
  std::vector<Brick> bricks(1000, Brick{});
  for (size_t i = 0; i < bricks.size(); ++i) bricks[i][7] = static_cast<uint16_t>(i % 5);
  const std::vector<uint64_t> weights(bricks.size(), 1);
  for (const Seeding seeding : {Seeding::furthest, Seeding::d2}) {
    const Result<Clustering> got = run(bricks, weights, {.codewords = 50, .seeding = seeding});
    ASSERT_TRUE(got);
    EXPECT_EQ(got->centres.size(), 5u);
    EXPECT_TRUE(got->error == 0);
    for (size_t i = 0; i < bricks.size(); ++i) EXPECT_EQ(got->centres[got->assignment[i]], bricks[i]);
  }
}

TEST(KMeans, BricksAsFarApartAsCanBe) {
  // Black and white at full range, and what lies one grey level from these.
  std::vector<Brick> bricks(6);
  bricks[0].fill(65535);
  bricks[1].fill(65534);
  bricks[2].fill(0);
  bricks[3].fill(1);
  bricks[4].fill(65535);
  bricks[4][7] = 65534;
  bricks[5].fill(32768);
  const std::vector<uint64_t> weights = {1, 7, 1, uint64_t{1} << 31, 3, 1};
  for (const Seeding seeding : {Seeding::furthest, Seeding::d2})
    for (const uint32_t k : {1u, 2u, 3u, 5u})
      for (const uint32_t iterations : {0u, 1u, ~0u})
        expect_equal(bricks, weights, {.codewords = k, .seeding = seeding, .max_iterations = iterations},
                     "k " + std::to_string(k));
}

TEST(KMeans, SumsAtTheExtremes) {
  // 2^47 in weights, voxels of 0 and 65535: the largest sums and errors that there are.
  std::vector<Brick> bricks(4, Brick{});
  bricks[1].fill(65535);
  for (size_t v = 0; v < brick_voxels; ++v) {
    bricks[2][v] = v % 2 ? 65535 : 0;
    bricks[3][v] = v % 2 ? 0 : 65535;
  }
  const std::vector<uint64_t> weights(4, uint64_t{1} << 45);
  expect_equal(bricks, weights, {.codewords = 1}, "one");
  const Result<Clustering> one = run(bricks, weights, {.codewords = 1});
  ASSERT_TRUE(one);
  EXPECT_EQ(one->centres[0][9], 32768);
  const SquaredError squares = SquaredError{32768} * 32768 + SquaredError{32767} * 32767;
  EXPECT_TRUE(one->error == squares * 64 * 2 * (uint64_t{1} << 45));
  for (const Seeding seeding : {Seeding::furthest, Seeding::d2})
    for (const uint32_t k : {2u, 3u})
      expect_equal(bricks, weights, {.codewords = k, .seeding = seeding}, "more");
}

TEST(KMeans, ProgressGrows) {
  const std::vector<Brick> bricks = make_bricks(Kind::clusters, 3000, 12, 11);
  const std::vector<uint64_t> weights(bricks.size(), 1);
  MemoryBudget budget;
  Context ctx;
  ctx.memory = &budget;
  std::vector<double> done;
  ctx.progress = [&](double d) { done.push_back(d); };
  ASSERT_TRUE(kmeans(bricks, weights, {.codewords = 100}, ctx));
  ASSERT_GT(done.size(), 2u);
  for (size_t i = 1; i < done.size(); ++i) EXPECT_GT(done[i], done[i - 1]);
  EXPECT_GT(done.front(), 0);
  EXPECT_LE(done.back(), 1);
}

TEST(KMeans, RefusesWhatCannotBe) {
  const std::vector<Brick> bricks = make_bricks(Kind::noise, 10, 8, 1);
  const std::vector<uint64_t> weights(10, 1);
  const auto code = [&](std::span<const Brick> b, std::span<const uint64_t> w, uint32_t k) {
    const Result<Clustering> got = run(b, w, {.codewords = k});
    return got ? ErrorCode::internal : got.error().code;
  };
  EXPECT_EQ(code(bricks, weights, 0), ErrorCode::usage);
  EXPECT_EQ(code({}, {}, 3), ErrorCode::usage);
  EXPECT_EQ(code(bricks, std::span(weights).first(9), 3), ErrorCode::usage);
  std::vector<uint64_t> bad = weights;
  bad[4] = 0;
  EXPECT_EQ(code(bricks, bad, 3), ErrorCode::usage);
  bad[4] = (uint64_t{1} << 47) - 8;
  EXPECT_EQ(code(bricks, bad, 3), ErrorCode::usage);
  bad[3] = ~uint64_t{0};
  EXPECT_EQ(code(bricks, bad, 3), ErrorCode::usage);
}

TEST(KMeans, HonoursTheMemoryLimit) {
  const std::vector<Brick> bricks = make_bricks(Kind::noise, 1000, 8, 1);
  const std::vector<uint64_t> weights(bricks.size(), 1);
  MemoryBudget budget(100000);
  Context ctx;
  ctx.memory = &budget;
  const Result<Clustering> got = kmeans(bricks, weights, {.codewords = 10}, ctx);
  ASSERT_FALSE(got);
  EXPECT_EQ(got.error().code, ErrorCode::limit);
  EXPECT_NE(got.error().what.find("--max-memory"), std::string::npos);
  ASSERT_TRUE(budget.reserve(100000, "what was released"));
}

TEST(KMeans, StopsWhenAsked) {
  const std::vector<Brick> bricks = make_bricks(Kind::noise, 1000, 8, 1);
  const std::vector<uint64_t> weights(bricks.size(), 1);
  KMeansOptions options{.codewords = 100};
  options.report = [](uint32_t, SquaredError) { interrupt_signal = 2; };
  const Result<Clustering> got = run(bricks, weights, options);
  interrupt_signal = 0;
  ASSERT_FALSE(got);
  EXPECT_EQ(got.error().code, ErrorCode::interrupted);
}

}  // namespace
}  // namespace voxkit::vq
