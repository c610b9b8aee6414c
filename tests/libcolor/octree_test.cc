// Octrees for storage: what is known around an octant against a plain search, trees of contexts, pages.
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "libcolor/dag/dag_builder.h"
#include "libcolor/octree/context_fit.h"
#include "libcolor/octree/context_lookup.h"
#include "libcolor/octree/octree_dag.h"
#include "libcolor/octree/octree_encode.h"
#include "libcolor/octree/octree_reader.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

struct Fixture {
  MemoryBudget memory;
  Context ctx;
  explicit Fixture(int threads = 2) {
    ctx.memory = &memory;
    ctx.threads = threads;
  }
};

Dag dag_of_voxels(const Voxels& voxels, int height, Context& ctx) {
  DagBuilder builder(height, ctx);
  EXPECT_TRUE(builder.add(voxels));
  return *builder.finish();
}

struct Coded {
  EncodedOctree bytes;
  std::unique_ptr<OctreeReader> reader;
};
Coded coded(const Dag& dag, Context& ctx) {
  Reservation memory(*ctx.memory);
  const auto octree = octree_of(dag, memory);
  EXPECT_TRUE(octree);
  Coded out;
  out.bytes = *encode_octree(*octree, ctx);
  return out;
}
Result<std::unique_ptr<OctreeReader>> opened(const EncodedOctree& bytes, int height, uint64_t voxels,
                                             MemoryBudget& memory) {
  std::vector<uint64_t> sizes;
  for (const auto& part : bytes.parts) sizes.push_back(part.size());
  return OctreeReader::open(
      bytes.directory, height, voxels, sizes,
      [&](uint64_t part) -> Result<std::span<const std::byte>> { return std::span(bytes.parts[part]); },
      "file", memory);
}
Voxels voxels_of(const OctreeReader& reader, const Box& box) {
  Voxels voxels;
  reader.for_each_word(box, [&](uint64_t word, Index3 corner, uint64_t first) {
    EXPECT_TRUE(voxels.empty() || first > 0);
    const uint64_t place = morton_code(static_cast<uint32_t>(corner.x), static_cast<uint32_t>(corner.y),
                                       static_cast<uint32_t>(corner.z));
    for (uint64_t left = word; left != 0; left &= left - 1)
      voxels.push_back({place | static_cast<uint64_t>(std::countr_zero(left)), {}});
    return true;
  });
  return voxels;
}
bool same_places(const Voxels& a, const Voxels& b) {
  return std::ranges::equal(a, b, [](const auto& x, const auto& y) { return x.place == y.place; });
}

/// Scenes of each kind: dense, thin, scattered, one voxel, full.
std::vector<std::pair<Voxels, int>> scenes() {
  return {{{{0, {}}}, 2},
          {{{77, {}}}, 21},
          {voxels_where(2, [](uint32_t, uint32_t, uint32_t) { return true; }), 2},
          {voxels_where(5, [](uint32_t, uint32_t, uint32_t) { return true; }), 5},
          {voxels_where(5, [](uint32_t x, uint32_t y, uint32_t z) { return (x * y + z) % 5 == 0; }), 5},
          {sphere_shell(7), 7},
          {scattered(18, 5000, 3), 18},
          {scattered(7, 60000, 4), 7}};
}

/// The facts of an octant by FORMAT.md's words, from sets of cells.
std::vector<bool> plain_facts(const std::set<uint64_t>& nodes, const std::vector<uint64_t>& in_order,
                              const std::set<uint64_t>& children, size_t node, uint32_t octant) {
  const size_t first = node / page_nodes * page_nodes;
  std::vector<bool> of;
  const auto at = morton_place(in_order[node] << 3 | octant);
  const auto state = [&](int dx, int dy, int dz) {  // 0: void, 1: solid, 2: open
    const int64_t x = int64_t{at.x} + dx, y = int64_t{at.y} + dy, z = int64_t{at.z} + dz;
    if (x < 0 || y < 0 || z < 0) return 0;
    const uint64_t cell =
        morton_code(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z));
    if (cell >> 3 == in_order[node]) return (cell & 7) < octant && children.contains(cell) ? 1 : 0;
    if (!nodes.contains(cell >> 3)) return 0;
    const auto number = static_cast<size_t>(std::ranges::lower_bound(in_order, cell >> 3) - in_order.begin());
    if (number < first || number > node) return 2;
    return children.contains(cell) ? 1 : 0;
  };
  for (int k = -2; k <= 2; ++k)
    for (int j = -2; j <= 2; ++j)
      for (int i = -2; i <= 2; ++i) of.push_back(state(i, j, k) == 1);
  for (int k = -1; k <= 1; ++k)
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) of.push_back(state(i, j, k) == 2);
  for (int bit = 0; bit < 3; ++bit) of.push_back((octant >> bit & 1) != 0);
  bool before = false;
  for (uint32_t o = 0; o < octant; ++o) before |= children.contains(in_order[node] << 3 | o);
  of.push_back(!before);
  return of;
}

TEST(Octree, FactsAreThoseOfAPlainSearch) {
  Fixture f;
  for (const auto& [voxels, height] : scenes()) {
    const Dag dag = dag_of_voxels(voxels, height, f.ctx);
    Reservation memory(f.memory);
    const Octree octree = *octree_of(dag, memory);
    for (int h = 1; h <= height; ++h) {
      std::set<uint64_t> nodes, children;
      for (const SurfaceVoxel& voxel : voxels) {
        nodes.insert(voxel.place >> 3 * h);
        children.insert(voxel.place >> 3 * (h - 1));
      }
      const std::vector<uint64_t> in_order(nodes.begin(), nodes.end());
      const OctreeLevel& level = octree.level(h);
      ASSERT_EQ(level.nodes(), nodes.size());
      ASSERT_EQ(level.children(), children.size());
      // Every node of small heights, some of large ones; all of them are walked through.
      const size_t step = 1 + nodes.size() / 60;
      size_t node = 0, next = 0;
      for (uint64_t page = 0; page < level.pages(); ++page) {
        NodeWalk walk(octree, h, page);
        for (uint64_t i = 0; i < nodes_of_page(level.nodes(), page); ++i, ++node) {
          const bool more = i == 0 || walk.next();
          ASSERT_TRUE(more);
          ASSERT_EQ(walk.neighbors()[center], node);
          Surroundings around(level, walk.neighbors(), page << page_nodes_log2);
          const bool looked_at = node == next;
          if (looked_at) next += step;
          code_mask(around, level.mask(node), [&](const Facts& facts, bool solid) {
            if (!looked_at) return solid;
            const auto octant = static_cast<uint32_t>(facts.words[8] & 7);
            EXPECT_EQ(solid, children.contains(in_order[node] << 3 | octant));
            const auto expected = plain_facts(nodes, in_order, children, node, octant);
            for (uint32_t fact = 0; fact < fact_count; ++fact)
              EXPECT_EQ(facts[fact], expected[fact])
                  << "height " << h << " node " << node << " fact " << fact;
            return solid;
          });
          if (testing::Test::HasFailure()) return;
        }
        EXPECT_FALSE(page + 1 == level.pages() && walk.next());
      }
    }
  }
}

TEST(Octree, EveryVoxelComesBackOnAnyNumberOfThreads) {
  for (const auto& [voxels, height] : scenes()) {
    Fixture one(1), three(3);
    const Dag dag = dag_of_voxels(voxels, height, one.ctx);
    const Coded file = coded(dag, one.ctx), other = coded(dag, three.ctx);
    EXPECT_EQ(file.bytes.directory, other.bytes.directory);
    EXPECT_EQ(file.bytes.parts, other.bytes.parts);
    const Box all{Index3(0), Index3(int64_t{1} << height)};
    for (const bool whole : {false, true}) {
      const auto reader = opened(file.bytes, height, voxels.size(), three.memory);
      ASSERT_TRUE(reader) << reader.error().what;
      EXPECT_TRUE(!whole || (*reader)->decode_all(three.ctx));
      EXPECT_TRUE(same_places(voxels_of(**reader, all), voxels));
      EXPECT_TRUE((*reader)->status());
      const auto made = dag_of(**reader, Colors::leaf, Counts::node, Curve::morton, three.ctx);
      ASSERT_TRUE(made);
      EXPECT_EQ(made->leaves, dag.leaves);
      EXPECT_EQ(made->nodes, dag.nodes);
      EXPECT_EQ(made->root, dag.root);
    }
  }
}

TEST(Octree, ABoxNeedsThePagesAroundIt) {
  Fixture f;
  const Voxels voxels = sphere_shell(8);
  const Dag dag = dag_of_voxels(voxels, 8, f.ctx);
  const Coded file = coded(dag, f.ctx);
  std::mt19937 random(5);
  uint64_t most = 0, pages = 0;
  for (int i = 0; i < 12; ++i) {
    const auto reader = opened(file.bytes, 8, voxels.size(), f.memory);
    ASSERT_TRUE(reader);
    const auto coordinate = [&] { return static_cast<int64_t>(random() % 240); };
    const Index3 corner(coordinate(), coordinate(), coordinate());
    const Box box{corner, corner + int64_t{16}};
    Voxels expected, found;
    const auto keep = [&](const Voxels& from, Voxels& to) {
      for (const SurfaceVoxel& v : from)
        if (box.contains(Index3(morton_place(v.place)))) to.push_back(v);
    };
    EXPECT_EQ((*reader)->is_void(box), [&] {
      keep(voxels, expected);
      return expected.empty();
    }());
    keep(voxels_of(**reader, box), found);
    EXPECT_TRUE(same_places(found, expected));
    most = std::max(most, (*reader)->pages_decoded());
    EXPECT_TRUE((*reader)->decode_all(f.ctx));
    pages = (*reader)->pages_decoded();
  }
  EXPECT_GT(pages, 10u);
  EXPECT_LT(most, pages);
}

TEST(Octree, NothingHasNoBytes) {
  Fixture f;
  const Dag dag = dag_of_voxels({}, 5, f.ctx);
  const Coded file = coded(dag, f.ctx);
  EXPECT_TRUE(file.bytes.directory.empty());
  EXPECT_TRUE(file.bytes.parts.empty());
  const auto reader = opened(file.bytes, 5, 0, f.memory);
  ASSERT_TRUE(reader);
  EXPECT_TRUE((*reader)->is_void({Index3(0), Index3(32)}));
}

/// Facts as good as random, but for octants that are as another one is.
Facts random_facts(std::mt19937& random) {
  Facts facts{};
  for (uint32_t fact = 0; fact < fact_count; ++fact) {
    const auto [word, bit] = Facts::places[fact];
    facts.words[word] |= uint64_t{random() & 1} << bit;
  }
  return facts;
}

TEST(ContextTree, AsksForWhatTells) {
  std::mt19937 random(1);
  Fixture f;
  for (const uint32_t fact : {0u, 61u, 124u, 125u, 151u, 155u}) {
    ContextSamples samples;
    for (int i = 0; i < 2000; ++i) {
      const Facts facts = random_facts(random);
      samples.add(facts, facts[fact] != (i % 16 == 0));
    }
    const auto tree = std::move(samples).grow(1, f.ctx);
    ASSERT_TRUE(tree);
    ASSERT_EQ(tree->nodes()[0].fact, fact);
    EXPECT_EQ(tree->nodes().size(), 3u) << "chance is not asked for";
    // 15 of 16, in parts of 2048: 1920, nearest to 1900 (24); 128 nearest to 148 (11), for some draws 104.
    EXPECT_NEAR(tree->nodes()[2].number, 24, 1);
    EXPECT_NEAR(tree->nodes()[1].number, 11, 1);
  }
}

TEST(ContextTree, ChanceIsALeaf) {
  std::mt19937 random(2);
  Fixture f;
  ContextSamples samples;
  for (int i = 0; i < 5000; ++i) samples.add(random_facts(random), (random() & 3) == 0);
  const auto tree = std::move(samples).grow(1, f.ctx);
  ASSERT_TRUE(tree);
  EXPECT_EQ(tree->nodes().size(), 1u);
}

/// A tree of random questions and numbers.
ContextTree random_tree(std::mt19937& random, size_t questions) {
  ContextTree tree;
  std::vector<uint32_t> leaves{0};
  for (size_t i = 0; i < questions; ++i) {
    const size_t at = random() % leaves.size();
    const uint32_t first = tree.split(leaves[at], static_cast<uint32_t>(random() % fact_count));
    leaves[at] = first;
    leaves.push_back(first + 1);
  }
  for (const uint32_t leaf : leaves) tree.set_number(leaf, static_cast<uint8_t>(1 + random() % 31));
  return tree;
}

TEST(ContextTree, BitsAndLookUpSayTheSame) {
  std::mt19937 random(3);
  for (const size_t questions : {0u, 1u, 2u, 3u, 40u, 500u}) {
    const ContextTree tree = random_tree(random, questions);
    page::BitWriter out;
    tree.write(out);
    const auto bytes = out.take();
    page::BitReader in(bytes);
    const auto read = ContextTree::read(in);
    ASSERT_TRUE(read);
    EXPECT_TRUE(in.at_end());
    const ContextLookup lookup(*read);
    for (int i = 0; i < 2000; ++i) {
      const Facts facts = random_facts(random);
      uint32_t at = 0;  // from the root, by the tree's own nodes
      while (tree.nodes()[at].number == 0)
        at = tree.nodes()[at].next + (facts[tree.nodes()[at].fact] ? 1 : 0);
      EXPECT_EQ(lookup.number(facts), tree.nodes()[at].number);
    }
  }
}

TEST(ContextTree, OthersAreRefused) {
  const auto read = [](const std::function<void(page::BitWriter&)>& write) {
    page::BitWriter out;
    write(out);
    const auto bytes = out.take();
    page::BitReader in(bytes);
    return ContextTree::read(in).has_value();
  };
  const auto leaf = [](page::BitWriter& out, uint32_t number) {
    out.put(0, 1);
    out.put(number, 5);
  };
  const auto question = [](page::BitWriter& out, uint32_t fact) {
    out.put(1, 1);
    out.put(fact, 8);
  };
  EXPECT_TRUE(read([&](auto& out) { leaf(out, 31); }));
  EXPECT_FALSE(read([&](auto& out) { leaf(out, 0); }));
  EXPECT_TRUE(read([&](auto& out) { question(out, 155), leaf(out, 1), leaf(out, 2); }));
  EXPECT_FALSE(read([&](auto& out) { question(out, 156), leaf(out, 1), leaf(out, 2); }));
  EXPECT_FALSE(read([&](auto& out) { question(out, 1), leaf(out, 1); })) << "cut off";
  const auto chain = [&](int length) {
    return read([&](auto& out) {
      for (int i = 0; i < length; ++i) question(out, 3), leaf(out, 1);
      leaf(out, 2);
    });
  };
  EXPECT_TRUE(chain(most_questions));
  EXPECT_FALSE(chain(most_questions + 1));
}

/// Whatever is changed in a directory or a page: an error, or an octree that can be walked.
TEST(Octree, DamageIsFoundOrHarmless) {
  Fixture f;
  const Voxels voxels = sphere_shell(6);
  const Dag dag = dag_of_voxels(voxels, 6, f.ctx);
  const Coded file = coded(dag, f.ctx);
  std::mt19937 random(6);
  int refused = 0, late = 0, same = 0;
  for (int i = 0; i < 600; ++i) {
    EncodedOctree damaged = file.bytes;
    auto& bytes = i % 3 == 0 ? damaged.directory : damaged.parts[random() % damaged.parts.size()];
    bytes[random() % bytes.size()] ^= static_cast<std::byte>(1 + random() % 255);
    const auto reader = opened(damaged, 6, voxels.size(), f.memory);
    if (!reader) {
      ++refused;
      continue;
    }
    const Voxels found = voxels_of(**reader, {Index3(0), Index3(64)});
    EXPECT_LE(found.size(), voxels.size());
    if (!(*reader)->status())
      ++late;
    else
      same += same_places(found, voxels);
    EXPECT_EQ((*reader)->decode_all(f.ctx).has_value(), (*reader)->status().has_value());
  }
  EXPECT_GT(refused, 60);
  EXPECT_GT(late, 200);
}

}  // namespace
}  // namespace voxkit::color
