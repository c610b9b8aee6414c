// The DAG against a plain octree: the same voxels, and each one's colour where a walk through all of it finds
// it.
#include <gtest/gtest.h>

#include <glm/common.hpp>

#include "libcolor/surface/morton.h"
#include "tests/libcolor/dag_cases.h"

namespace voxkit::color {
namespace {

TEST(OctantOrder, TheHilbertCurveGoesFromVoxelToVoxel) {
  for (int height = 1; height <= 6; ++height) {
    std::vector<uint64_t> places;
    const auto walk = [&](const auto& self, int h, uint64_t cell, OrderState state) -> void {
      if (h == 0) return places.push_back(cell);
      for (const uint64_t octant : octant_orders.octant[state])
        self(self, h - 1, cell << 3 | octant, octant_orders.next[state][octant]);
    };
    walk(walk, height, 0, first_state(Curve::hilbert));
    EXPECT_EQ(std::set(places.begin(), places.end()).size(), uint64_t{1} << 3 * height);
    for (size_t i = 1; i < places.size(); ++i) {
      const glm::ivec3 step =
          glm::abs(glm::ivec3(morton_place(places[i])) - glm::ivec3(morton_place(places[i - 1])));
      ASSERT_EQ(step.x + step.y + step.z, 1) << i;
    }
    EXPECT_EQ(places.front(), 0u);
    EXPECT_EQ(places.back(), morton_code((1u << height) - 1, 0, 0));
  }
}

TEST(OctantOrder, WhatIsBeforeIsAMask) {
  for (OrderState state = 0; state < order_states; ++state) {
    uint32_t octants = 0;
    uint64_t voxels = 0;
    for (const uint8_t octant : octant_orders.octant[state]) {
      EXPECT_EQ(octant_orders.before[state][octant], octants);
      octants |= 1u << octant;
      for (const uint8_t voxel : octant_orders.octant[octant_orders.next[state][octant]]) {
        EXPECT_EQ(octant_orders.voxels_before[state][8u * octant + voxel], voxels);
        voxels |= uint64_t{1} << (8 * octant + voxel);
      }
    }
    EXPECT_EQ(octants, 0xffu);
    EXPECT_EQ(voxels, ~uint64_t{0});
  }
}

TEST(Dag, VoxelsAndTheirColorsAreThoseOfTheTree) {
  for (const Case& c : cases())
    for (const auto& [colors, counts, curve] : variants()) {
      SCOPED_TRACE(c.name);
      const auto dag = build(c.voxels, c.height, colors, counts, curve);
      ASSERT_TRUE(dag) << dag.error().what;
      const PlainOrder order(c.voxels, c.height, colors, curve);
      EXPECT_EQ(dag->voxels, c.voxels.size());
      EXPECT_EQ(dag->color_count, order.count);
      expect_order(view_of(*dag), c, order);
    }
}

TEST(Dag, EqualSubtreesAreStoredOnce) {
  const auto dag = build(cases()[4].voxels, 4);
  ASSERT_TRUE(dag);
  EXPECT_EQ(dag->leaves.size(), 1);
  EXPECT_EQ(dag->nodes[3].size(), 9);
  EXPECT_EQ(dag->nodes[4].size(), 9);
  EXPECT_EQ(dag->node_count, 2);
}

TEST(Dag, LargeCountsGetWordsOfTheirOwn) {
  // 2^24 voxels and more: a full cube of 256^3 in a corner, and one voxel elsewhere.
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  DagBuilder builder(9, ctx);
  Voxels run(1 << 16);
  for (uint64_t first = 0; first < 1 << 24; first += run.size()) {
    for (size_t i = 0; i < run.size(); ++i) run[i].place = first + i;
    ASSERT_TRUE(builder.add(run));
  }
  const SurfaceVoxel last{(uint64_t{1} << 27) - 1, {}};
  ASSERT_TRUE(builder.add(std::span(&last, 1)));
  const auto dag = builder.finish();
  ASSERT_TRUE(dag);
  EXPECT_EQ(dag->color_count, (1u << 24) + 1);
  const DagView view = view_of(*dag);
  EXPECT_EQ(find_voxel(view, last.place).color, 1u << 24);
  EXPECT_EQ(find_voxel(view, (1u << 24) - 1).color, (1u << 24) - 1);
  EXPECT_EQ(view.colors_below(9, dag->root), (1u << 24) + 1);
  EXPECT_EQ(dag->nodes[8].size(), 11 + 2);
  EXPECT_EQ(dag->nodes[7].size(), 9 + 2);
}

TEST(Dag, NumbersUpToTwoToThe63) {
  // Every voxel of a cube of 2^21 a side is there, and then all but one octant of the root.
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  DagPool pool(21, Colors::leaf, Counts::node, Curve::morton, ctx);
  Subtree full = *pool.add_leaf(~uint64_t{0}), root;
  for (int h = 3; h <= 21; ++h) {
    Octants octants;
    for (uint32_t octant = 0; octant < 8; ++octant)
      if (h < 21 || octant != 2) octants.add(octant, full);
    full = root = *pool.add_node(h, octants, morton_state);
  }
  const uint64_t eighth = uint64_t{1} << 60;
  EXPECT_EQ(root.colors, 7 * eighth);
  const Dag dag = pool.finish(root, root.colors);
  const uint64_t last = (uint64_t{1} << 63) - 1;
  EXPECT_EQ(find_voxel(view_of(dag), last).color, 7 * eighth - 1);
  EXPECT_EQ(find_voxel(view_of(dag), uint64_t{1} << 31).color, uint64_t{1} << 31);
  EXPECT_FALSE(find_voxel(view_of(dag), 2 * eighth + 5).there);
  Dag hilbert = dag;
  hilbert.curve = Curve::hilbert;  // which begins in octant 0 and goes on to 2, 6, 4, 5, 7, 3 and 1
  EXPECT_EQ(find_voxel(view_of(hilbert), 0).color, 0u);
  EXPECT_EQ(find_voxel(view_of(hilbert), morton_code((1u << 21) - 1, 0, 0)).color, 7 * eighth - 1);
  // Counts beside pointers have 32 bits.
  const auto beside = recount(dag, Colors::leaf, Counts::pointer, Curve::morton, ctx);
  ASSERT_FALSE(beside);
  EXPECT_EQ(beside.error().code, ErrorCode::limit);
}

TEST(Dag, RunsDoNotMatter) {
  const Voxels voxels = scattered(10, 5000, 3);
  const auto a = build(voxels, 10, 1), b = build(voxels, 10, 777);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->nodes, b->nodes);
  EXPECT_EQ(a->leaves, b->leaves);
}

TEST(Dag, VoxelsOutOfOrderAreRefused) {
  for (const Voxels& voxels : {Voxels{{7, {}}, {7, {}}}, Voxels{{7, {}}, {6, {}}}, Voxels{{1 << 15, {}}}}) {
    const auto dag = build(voxels, 5);
    ASSERT_FALSE(dag);
    EXPECT_EQ(dag.error().code, ErrorCode::internal);
  }
}

TEST(Dag, MemoryIsLimited) {
  MemoryBudget memory(1 << 16);
  Context ctx;
  ctx.memory = &memory;
  DagBuilder builder(12, ctx);
  const Status status = builder.add(scattered(12, 20000, 4));
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::limit);
}

TEST(Dag, CountsInNodesDoNotDependOnTheCurve) {
  const Voxels voxels = scattered(8, 5000, 3);
  const auto a = build(voxels, 8, Colors::all, Counts::node, Curve::morton),
             b = build(voxels, 8, Colors::all, Counts::node, Curve::hilbert);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->nodes, b->nodes);
  const auto plain = build(voxels, 8), leaf = build(voxels, 8, Colors::leaf, Counts::node, Curve::hilbert);
  ASSERT_TRUE(plain && leaf);
  EXPECT_EQ(plain->nodes, leaf->nodes);
  EXPECT_EQ(plain->leaves, leaf->leaves);
}

TEST(Dag, DamagedWordsLeadNowhere) {
  const Voxels voxels = scattered(8, 2000, 5);
  auto dag = build(voxels, 8);
  ASSERT_TRUE(dag);
  std::mt19937_64 random(6);
  for (int round = 0; round < 300; ++round) {
    Dag damaged = *dag;
    for (int i = 0; i < 5; ++i) {
      auto& pool = damaged.nodes[3 + random() % 6];
      pool[random() % pool.size()] = static_cast<uint32_t>(random() >> random() % 64);
    }
    // Exact sizes, so that a sanitizer sees what lies beyond.
    for (auto& pool : damaged.nodes) pool.shrink_to_fit();
    const DagView view = view_of(damaged);
    for (const SurfaceVoxel& v : voxels) (void)find_voxel(view, v.place);
  }
}

}  // namespace
}  // namespace voxkit::color
