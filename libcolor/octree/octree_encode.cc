#include "libcolor/octree/octree_encode.h"

#include <algorithm>

#include "formats/little_endian.h"
#include "formats/parallel.h"
#include "libcolor/octree/context_fit.h"
#include "libcolor/octree/context_lookup.h"
#include "libpage/decision.h"

namespace voxkit::color {
namespace {

/// Pages of a height that its tree is grown from, at most.
constexpr uint64_t sampled_pages = 64;

/// Calls visit(facts, solid) for each octant of a page that is coded.
template <class Visit>
void visit_page(const Octree& octree, int height, uint64_t page, const Visit& visit) {
  const OctreeLevel& level = octree.level(height);
  const uint64_t first = page << page_nodes_log2, nodes = nodes_of_page(level.nodes(), page);
  NodeWalk walk(octree, height, page);
  for (uint64_t i = 0; i < nodes; ++i) {
    if (i > 0) walk.next();
    Surroundings around(level, walk.neighbors(), first);
    code_mask(around, level.mask(first + i), [&](const Facts& facts, bool solid) {
      visit(facts, solid);
      return solid;
    });
  }
}

Result<ContextTree> grow_tree(const Octree& octree, int height, Context& ctx) {
  const uint64_t pages = octree.level(height).pages(), sampled = std::min(pages, sampled_pages);
  VOX_TRY(const Reservation memory,
          Reservation::take(8 * page_nodes * (sampled + sampled / 4 + 1) * ContextSamples::sample_bytes,
                            "samples of an octree's masks", ctx));
  std::vector<ContextSamples> parts(sampled);
  VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(sampled), [&](int64_t i) -> Status {
    const auto number = static_cast<uint64_t>(i);
    visit_page(octree, height, number * pages / sampled,
               [&](const Facts& facts, bool solid) { parts[number].add(facts, solid); });
    return {};
  }));
  return ContextSamples::joined(std::move(parts)).grow(pages / sampled, ctx);
}

std::vector<std::byte> encode_page(const Octree& octree, int height, uint64_t page,
                                   const ContextLookup& tree) {
  std::vector<page::Decision> decisions;
  decisions.reserve(8 * page_nodes);
  visit_page(octree, height, page, [&](const Facts& facts, bool solid) {
    decisions.push_back(page::decision(tree.number(facts), solid));
  });
  page::RansEncoder coder;
  for (size_t i = decisions.size(); i-- > 0;) coder.put(decisions[i].part, decisions[i].start, 0, 0);
  std::vector<std::byte> bytes;
  coder.finish(bytes, 0);
  return bytes;
}

}  // namespace

Result<EncodedOctree> encode_octree(const Octree& octree, Context& ctx) {
  EncodedOctree encoded;
  if (octree.empty()) return encoded;
  page::BitWriter trees;
  std::vector<std::byte> table;  // of pages
  for (int h = octree.height(); h > 0; --h) {
    const OctreeLevel& level = octree.level(h);
    VOX_TRY(const ContextTree tree, grow_tree(octree, h, ctx));
    tree.write(trees);
    const ContextLookup lookup(tree);
    std::vector<std::vector<std::byte>> pages(level.pages());
    VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(pages.size()), [&](int64_t i) -> Status {
      const auto page = static_cast<uint64_t>(i);
      pages[page] = encode_page(octree, h, page, lookup);
      return {};
    }));
    for (uint64_t page = 0; page < pages.size(); ++page) {
      if (encoded.parts.empty() || encoded.parts.back().size() >= mask_part_bytes)
        encoded.parts.emplace_back();
      encoded.parts.back().insert(encoded.parts.back().end(), pages[page].begin(), pages[page].end());
      std::byte entry[4];
      store_le(entry, static_cast<uint16_t>(level.children_of_page(page)));
      store_le(entry + 2, static_cast<uint16_t>(pages[page].size()));
      table.insert(table.end(), entry, entry + 4);
    }
    encoded.nodes += level.nodes();
  }
  const auto tree_bytes = trees.take();
  encoded.directory.resize(4);
  store_le(encoded.directory.data(), static_cast<uint32_t>(tree_bytes.size()));
  encoded.directory.insert(encoded.directory.end(), tree_bytes.begin(), tree_bytes.end());
  encoded.directory.insert(encoded.directory.end(), table.begin(), table.end());
  encoded.bytes = encoded.directory.size();
  for (const auto& part : encoded.parts) encoded.bytes += part.size();
  return encoded;
}

}  // namespace voxkit::color
