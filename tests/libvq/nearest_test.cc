// What the search rules out is ruled out rightly: keys are never further apart than their bricks, the kernels
// of all machines agree, and nothing within reach is missed.
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "libvq/nearest_axes.h"
#include "libvq/nearest_kernel_x86.h"
#include "libvq/nearest_search.h"
#include "tests/libvq/kmeans_bricks.h"

namespace voxkit::vq {
namespace {

using test::all_kinds;
using test::Kind;
using test::make_bricks;

uint64_t squared_distance(const Brick& a, const Brick& b) {
  uint64_t sum = 0;
  for (size_t v = 0; v < a.size(); ++v) {
    const int64_t d = int64_t{a[v]} - b[v];
    sum += static_cast<uint64_t>(d * d);
  }
  return sum;
}
template <size_t N>
int64_t squared_distance(const std::array<int16_t, N>& a, const std::array<int16_t, N>& b) {
  int64_t sum = 0;
  for (size_t i = 0; i < N; ++i) sum += int64_t{a[i] - b[i]} * (a[i] - b[i]);
  return sum;
}

TEST(PrincipalAxes, AreOrthonormal) {
  for (const Kind kind : all_kinds) {
    const std::vector<Brick> bricks = make_bricks(kind, 300, 16, 1);
    const PrincipalAxes found = principal_axes(bricks);
    for (size_t a = 0; a < brick_voxels; ++a)
      for (size_t b = 0; b <= a; ++b) {
        double dot = 0;
        for (size_t v = 0; v < brick_voxels; ++v) dot += found.axes[a][v] * found.axes[b][v];
        ASSERT_NEAR(dot, a == b ? 1 : 0, 1e-13) << static_cast<int>(kind) << ' ' << a << ' ' << b;
      }
  }
}

TEST(PrincipalAxes, TheFirstIsWhereBricksDifferMost) {
  const std::vector<Brick> bricks = make_bricks(Kind::line, 200, 12, 1);
  const PrincipalAxes found = principal_axes(bricks);
  for (const double x : found.axes[0]) EXPECT_NEAR(std::abs(x), 0.125, 1e-12);
}

TEST(KeySpace, ReachesAsFarAsBricks) {
  for (const int bits : {1, 8, 12, 13, 16})
    for (const Kind kind : all_kinds) {
      // The space is made for some bricks only; others must be found, too.
      const std::vector<Brick> bricks = make_bricks(kind, 400, bits, 3);
      const KeySpace space{std::span(bricks).first(kind == Kind::line ? 4 : 100)};
      EXPECT_TRUE(bits > 12 || space.narrow());
      std::vector<Key> keys;
      for (const Brick& brick : bricks) keys.push_back(space.key(brick));
      for (size_t i = 0; i < bricks.size(); ++i)
        for (size_t j = 0; j < i; j += 1 + i % 7) {
          const uint64_t distance = squared_distance(bricks[i], bricks[j]);
          if (distance == 0) continue;
          const int64_t reach = space.reach(distance);
          ASSERT_LT(squared_distance(keys[i].fine, keys[j].fine), reach)
              << bits << ' ' << static_cast<int>(kind);
          ASSERT_LT(squared_distance(keys[i].coarse, keys[j].coarse), reach)
              << bits << ' ' << static_cast<int>(kind);
        }
    }
}

TEST(KeySpace, ReachGrowsWithDistance) {
  for (const uint16_t top : {uint16_t{1}, uint16_t{4095}, uint16_t{65535}}) {
    Brick brick{};
    brick[5] = top;
    const KeySpace space{std::span(&brick, 1)};
    EXPECT_EQ(space.reach(0), 0);
    int32_t last = 0;
    for (uint64_t d = 1; d < uint64_t{1} << 38; d += 1 + d / 3) {
      EXPECT_GE(space.reach(d), last);
      last = space.reach(d);
    }
    EXPECT_LE(space.reach(~uint64_t{0}), (int32_t{1} << 30) + (1 << 20));
    EXPECT_GE(space.reach(~uint64_t{0}), last);
  }
}

TEST(KeySpace, KeysTellBricksApart) {
  // Else all the rest would be right, and slow.
  const std::vector<Brick> bricks = make_bricks(Kind::clusters, 500, 12, 3);
  const KeySpace space(bricks);
  size_t apart = 0, near = 0;
  for (size_t i = 1; i < bricks.size(); ++i) {
    const int64_t keys = squared_distance(space.key(bricks[i]).fine, space.key(bricks[i - 1]).fine);
    const auto truly = static_cast<int64_t>(squared_distance(bricks[i], bricks[i - 1]));
    if (truly < 4000000) continue;  // of the same shape
    ++apart;
    near += keys < truly / 2;
  }
  EXPECT_GT(apart, 300u);
  EXPECT_EQ(near, 0u);
}

std::vector<const Kernels*> kernels_of_this_machine(bool narrow) {
  std::vector<const Kernels*> all{&search_kernels(false, narrow)};
#ifdef VOXKIT_AVX2
  if (has_avx2()) all.push_back(&avx2_kernels(narrow));
  if (has_avx512()) all.push_back(&avx512_kernels(narrow));
#endif
  return all;
}

TEST(Kernels, DistancesAreExact) {
  for (const int bits : {12, 16})
    for (const Kernels* kernels : kernels_of_this_machine(bits == 12))
      for (const Kind kind : {Kind::noise, Kind::extremes}) {
        const std::vector<Brick> bricks = make_bricks(kind, 33, bits, 9);
        for (const uint32_t mask : {1u, 0x80000000u, 0xffffffffu, 0x50010204u}) {
          std::array<uint64_t, leaf_bricks> out;
          out.fill(7);
          kernels->distances(bricks.data(), mask, bricks[32], out.data());
          for (size_t i = 0; i < leaf_bricks; ++i)
            ASSERT_EQ(out[i], mask >> i & 1 ? squared_distance(bricks[i], bricks[32]) : 7);
        }
      }
}

TEST(Kernels, NearBricksAreThoseWhoseKeysAre) {
  std::mt19937 random(4);
  for (const Kernels* kernels : kernels_of_this_machine(true))
    for (int round = 0; round < 60; ++round) {
      // Coordinates up to the limits; then distances do not fit, so few are that large.
      const int most = round % 3 == 0 ? 4000 : 300;
      const auto any_key = [&] {
        Key key{};
        for (int16_t& x : key.fine) x = static_cast<int16_t>(static_cast<int>(random() % 601) - 300);
        key.fine[random() % fine_axes] =
            static_cast<int16_t>(static_cast<int>(random() % (2 * most + 1)) - most);
        if (most == 300) key.fine[0] = random() % 2 ? key_limit : -key_limit;
        for (const int16_t x : key.fine) key.norm += static_cast<uint32_t>(x * x);
        return key;
      };
      Leaf leaf;
      std::vector<Key> keys;
      std::vector<uint32_t> edges;
      std::vector<int32_t> reaches;
      for (size_t i = 0; i < leaf_bricks; ++i) {
        keys.push_back(any_key());
        for (int j = 0; j < fine_pairs; ++j) leaf[static_cast<size_t>(j)][i] = key_pair(keys[i].fine, j);
        reaches.push_back(
            static_cast<int32_t>(random() % 8 == 0 ? 0 : random() % (1u << (10 + random() % 20))));
        edges.push_back(keys[i].norm - static_cast<uint32_t>(reaches[i]));
      }
      const Brick none{};
      std::vector<QueryKey> queries;
      std::vector<Key> query_keys;
      std::vector<int32_t> query_reaches;
      for (size_t q = 0; q < 9; ++q) {
        query_keys.push_back(any_key());
        query_reaches.push_back(static_cast<int32_t>(q % 2 ? 0 : random() % 4000000));
        queries.push_back(query_key(query_keys[q], none, query_reaches[q]));
      }
      const std::vector<uint32_t> numbers{8, 0, 1, 2, 3, 5, 7};
      std::vector<uint32_t> masks(numbers.size() + 1, 5);
      kernels->near_bricks(leaf, edges.data(), queries.data(), numbers.data(), numbers.size(), masks.data());
      for (size_t k = 0; k < numbers.size(); ++k)
        for (size_t i = 0; i < leaf_bricks; ++i) {
          const int64_t distance = squared_distance(keys[i].fine, query_keys[numbers[k]].fine);
          ASSERT_EQ(masks[k] >> i & 1, distance < int64_t{reaches[i]} + query_reaches[numbers[k]]);
        }
    }
}

TEST(Kernels, NearBoxKeepsWhatReachesIt) {
  std::mt19937 random(5);
  for (const Kernels* kernels : kernels_of_this_machine(true))
    for (size_t count = 1; count < 70; ++count) {
      const auto coordinate = [&] { return static_cast<int16_t>(static_cast<int>(random() % 6001) - 3000); };
      KeyBox box;
      for (size_t a = 0; a < coarse_axes; ++a) {
        box.least[a] = coordinate();
        box.most[a] = std::max(coordinate(), box.least[a]);
      }
      const auto reach = static_cast<int32_t>(count % 3 == 0 ? 0 : random() % (1u << 26));
      QueryRows in, out;
      in.make_room(count);
      in.size = count;
      std::vector<uint32_t> expected;
      for (size_t q = 0; q < count; ++q) {
        std::array<int16_t, coarse_axes> key;
        int64_t distance = 0;
        for (size_t a = 0; a < coarse_axes; ++a) {
          key[a] = coordinate();
          const int64_t outside = std::max({0, box.least[a] - key[a], key[a] - box.most[a]});
          distance += outside * outside;
        }
        for (int j = 0; j < coarse_pairs; ++j) in.pairs[static_cast<size_t>(j)][q] = key_pair(key, j);
        in.reach[q] = static_cast<int32_t>(count % 2 == 0 ? 0 : random() % (1u << 27));
        in.number[q] = static_cast<uint32_t>(1000 + q);
        if (distance < int64_t{reach} + in.reach[q]) expected.push_back(static_cast<uint32_t>(q));
      }
      kernels->near_box(box, reach, in, out);
      ASSERT_EQ(out.size, expected.size());
      for (size_t k = 0; k < out.size; ++k) {
        const uint32_t q = expected[k];
        EXPECT_EQ(out.number[k], 1000 + q);
        EXPECT_EQ(out.reach[k], in.reach[q]);
        for (size_t j = 0; j < coarse_pairs; ++j) EXPECT_EQ(out.pairs[j][k], in.pairs[j][q]);
      }
    }
}

/// Notes what is found.
struct Listing {
  const BrickTree& tree;
  std::set<std::pair<uint32_t, uint32_t>> found_;  // query, brick
  int32_t reach(size_t) const { return 0; }
  const uint32_t* edges(size_t leaf) const { return tree.leaf_norms(leaf); }
  void found(size_t position, uint32_t query, uint64_t) { found_.insert({query, tree.index(position)}); }
  void leave(const Branch&) {}
};

TEST(Search, MissesNothingWithinReach) {
  MemoryBudget budget;
  Context ctx;
  ctx.memory = &budget;
  for (const Kind kind : {Kind::clusters, Kind::ramps, Kind::extremes})
    for (const size_t count : {1u, 31u, 32u, 33u, 500u}) {
      std::vector<Brick> bricks = make_bricks(kind, count, 12, 6);
      const std::vector<Brick> seekers = make_bricks(kind, 40, 12, 7);
      const KeySpace space(bricks);
      Result<BrickTree> tree = BrickTree::build(bricks, space, ctx);
      ASSERT_TRUE(tree);
      // Some bricks are replaced by others far from where they were.
      for (size_t p = 0; p < count; p += 5) {
        bricks[tree->index(p)] = seekers[p % seekers.size()];
        tree->replace(p, bricks[tree->index(p)], space.key(bricks[tree->index(p)]));
      }
      const uint64_t far = 64 * 300 * 300;
      QueryBlock queries;
      for (const Brick& seeker : seekers) queries.add(space.key(seeker), seeker, space.reach(far));
      SearchSpace scratch;
      Listing listing{*tree, {}};
      search(*tree, search_kernels(true, true), tree->root(), queries, queries.rows(), scratch, 0, listing);
      size_t missed = 0, near = 0;
      for (uint32_t q = 0; q < seekers.size(); ++q)
        for (uint32_t i = 0; i < count; ++i)
          if (squared_distance(seekers[q], bricks[i]) <= far) {
            ++near;
            missed += !listing.found_.contains({q, i});
          }
      EXPECT_EQ(missed, 0u) << count;
      EXPECT_TRUE(near > 0 || count < 33);
    }
}

TEST(BrickTree, HasEveryBrickOnce) {
  MemoryBudget budget;
  Context ctx;
  ctx.memory = &budget;
  for (const size_t count : {1u, 32u, 65u, 5000u}) {
    const std::vector<Brick> bricks = make_bricks(Kind::ramps, count, 12, 6);
    const KeySpace space(bricks);
    ctx.threads = 1;
    const Result<BrickTree> tree = BrickTree::build(bricks, space, ctx);
    ctx.threads = 3;
    const Result<BrickTree> again = BrickTree::build(bricks, space, ctx);
    ASSERT_TRUE(tree && again);
    ASSERT_EQ(tree->size(), count);
    std::vector<bool> seen(count);
    for (size_t p = 0; p < count; ++p) {
      EXPECT_FALSE(seen[tree->index(p)]);
      seen[tree->index(p)] = true;
      EXPECT_EQ(tree->brick(p), bricks[tree->index(p)]);
      EXPECT_EQ(tree->index(p), again->index(p));
      const Key key = tree->key(p), expected = space.key(tree->brick(p));
      EXPECT_EQ(key.fine, expected.fine);
      EXPECT_EQ(key.coarse, expected.coarse);
      EXPECT_EQ(key.norm, expected.norm);
    }
    for (const size_t parts : {1u, 4u, 256u}) {
      size_t leaf = 0;
      for (const Branch& branch : tree->branches(parts)) {
        EXPECT_EQ(branch.first, leaf);
        leaf = branch.last;
      }
      EXPECT_EQ(leaf, tree->leaves());
    }
  }
}

}  // namespace
}  // namespace voxkit::vq
