// DAGs with symmetry: reflections bit by bit, every voxel and colour as a plain walk has it, damage.
#include <gtest/gtest.h>

#include "libcolor/dag/symmetric_dag.h"
#include "libcolor/surface/morton.h"
#include "tests/libcolor/dag_cases.h"

namespace voxkit::color {
namespace {

Result<SymmetricDag> symmetric(const Dag& dag, uint64_t limit = 0) {
  MemoryBudget memory(limit);
  Context ctx;
  ctx.memory = &memory;
  return symmetric_dag_of(dag, ctx);
}
uint64_t bytes_of(const SymmetricDag& dag) {
  uint64_t bytes = dag.leaves.size() * sizeof(uint64_t);
  for (const auto& nodes : dag.nodes) bytes += nodes.size();
  return bytes;
}

/// A place in a cube of 2^height a side, mirrored.
uint64_t mirrored_place(uint64_t place, int height, uint32_t mirror) {
  glm::uvec3 at = morton_place(place);
  for (int a = 0; a < 3; ++a)
    if ((mirror >> a & 1) != 0) at[a] = (1u << height) - 1 - at[a];
  return morton_code(at.x, at.y, at.z);
}
Voxels mirrored(const Voxels& voxels, int height, uint32_t mirror) {
  Voxels out;
  for (const SurfaceVoxel& v : voxels) out.push_back({mirrored_place(v.place, height, mirror), v.color});
  std::ranges::sort(out, {}, &SurfaceVoxel::place);
  return out;
}

TEST(SymmetricDag, WordsAndOctantsAreMirroredBitByBit) {
  for (uint32_t mirror = 0; mirror < 8; ++mirror) {
    for (uint32_t bit = 0; bit < 64; ++bit)
      EXPECT_EQ(mirrored_word(uint64_t{1} << bit, mirror), uint64_t{1} << mirrored_place(bit, 2, mirror));
    for (uint32_t mask = 0; mask < 256; ++mask) {
      uint32_t expected = 0;
      for (uint32_t octant = 0; octant < 8; ++octant)
        if ((mask >> octant & 1) != 0) expected |= 1u << mirrored_place(octant, 1, mirror);
      EXPECT_EQ(mirrored_octants(mask, mirror), expected);
    }
  }
}

TEST(SymmetricDag, VoxelsAndTheirColorsAreThoseOfTheTree) {
  for (const Case& c : cases())
    for (const auto& [colors, counts, curve] : variants()) {
      if (counts == Counts::pointer) continue;
      SCOPED_TRACE(c.name);
      auto dag = build(c.voxels, c.height, colors, counts, curve);
      ASSERT_TRUE(dag);
      const auto dag_with = symmetric(*dag);
      ASSERT_TRUE(dag_with) << dag_with.error().what;
      expect_order(view_of(*dag_with), c, PlainOrder(c.voxels, c.height, colors, curve));
    }
}

TEST(SymmetricDag, MirrorImagesAreStoredOnce) {
  // Two images of each other in opposite octants of the root are one node with two pointers.
  for (uint32_t mirror = 1; mirror < 8; ++mirror) {
    const Voxels one = scattered(5, 300, mirror), other = mirrored(one, 5, mirror);
    Voxels both = one;
    for (const SurfaceVoxel& v : other) both.push_back({v.place | uint64_t{7} << 15, v.color});
    const auto half = symmetric(*build(one, 5)), whole = symmetric(*build(both, 6));
    ASSERT_TRUE(half && whole);
    EXPECT_EQ(whole->leaves, half->leaves);
    EXPECT_EQ(whole->node_count, half->node_count + 1);
    EXPECT_LE(bytes_of(*whole), bytes_of(*half) + 2 + 2 + 6);
  }
  // A ball has one eighth of everything.
  const auto ball = build(sphere_shell(7), 7);
  ASSERT_TRUE(ball);
  const auto eighth = symmetric(*ball);
  ASSERT_TRUE(eighth);
  EXPECT_EQ(eighth->nodes[7].size(), 2u + 3u + 8u * 2u);
  EXPECT_LE(8 * (eighth->node_count - 1), 2 * ball->node_count);
}

TEST(SymmetricDag, IsSmallerAndSaysWhenMemoryEnds) {
  const auto dag = build(scattered(12, 30000, 4), 12);
  ASSERT_TRUE(dag);
  const auto with = symmetric(*dag);
  ASSERT_TRUE(with);
  uint64_t plain = dag->leaves.size() * sizeof(uint64_t);
  for (const auto& nodes : dag->nodes) plain += nodes.size() * sizeof(uint32_t);
  EXPECT_LT(4 * bytes_of(*with), 3 * plain);
  const auto limited = symmetric(*dag, 1 << 16);
  ASSERT_FALSE(limited);
  EXPECT_EQ(limited.error().code, ErrorCode::limit);
}

TEST(SymmetricDag, DamagedBytesLeadNowhere) {
  const Voxels voxels = scattered(8, 2000, 5);
  const auto dag = build(voxels, 8);
  ASSERT_TRUE(dag);
  const auto with = symmetric(*dag);
  ASSERT_TRUE(with);
  std::mt19937_64 random(6);
  for (int round = 0; round < 300; ++round) {
    SymmetricDag damaged = *with;
    for (int i = 0; i < 5; ++i) {
      auto& bytes = damaged.nodes[3 + random() % 6];
      bytes[random() % bytes.size()] = static_cast<uint8_t>(random());
      if (round % 3 == 0) bytes.resize(1 + random() % bytes.size());
    }
    // Exact sizes, so that a sanitizer sees what lies beyond.
    for (auto& bytes : damaged.nodes) bytes.shrink_to_fit();
    const DagView view = view_of(damaged);
    for (const SurfaceVoxel& v : voxels) (void)find_voxel(view, v.place);
  }
}

}  // namespace
}  // namespace voxkit::color
