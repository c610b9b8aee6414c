#include "libcolor/dag/dag_pool.h"

#include <fmt/format.h>

#include <algorithm>

#include "formats/hash.h"

namespace voxkit::color {
namespace {

template <class Word>
uint64_t hash_of(std::span<const Word> words) {
  uint64_t hash = words.size();
  for (const Word word : words) hash = mix64(hash ^ word) + 0x9e3779b97f4a7c15u;
  return hash;
}

}  // namespace

template <class Word>
void UniqueRuns<Word>::grow(size_t slots) {
  std::vector<Slot> old(slots);
  std::swap(old, slots_);
  for (const Slot& slot : old) {
    if (slot.tag == 0) continue;
    // The tag has the lowest bits of the place in the table, of any size up to 2^32 slots.
    size_t at = slot.tag & (slots - 1);
    while (slots_[at].tag != 0) at = (at + 1) & (slots - 1);
    slots_[at] = slot;
  }
}

template <class Word>
uint32_t UniqueRuns<Word>::add(std::vector<Word>& pool, std::span<const Word> words) {
  if (2 * (used_ + 1) > slots_.size()) grow(std::max<size_t>(64, 2 * slots_.size()));
  const uint64_t hash = hash_of(words);
  const auto tag = std::max<uint32_t>(1, static_cast<uint32_t>(hash));
  size_t at = tag & (slots_.size() - 1);
  for (; slots_[at].tag != 0; at = (at + 1) & (slots_.size() - 1)) {
    const Slot& slot = slots_[at];
    // Two runs that begin with equal words are equally long, so this does not look beyond one that is equal.
    if (slot.tag == tag && pool.size() - slot.place >= words.size() &&
        std::equal(words.begin(), words.end(), pool.begin() + slot.place))
      return slot.place;
  }
  const auto place = static_cast<uint32_t>(pool.size());
  slots_[at] = {place, tag};
  ++used_;
  pool.insert(pool.end(), words.begin(), words.end());
  return place;
}

template class UniqueRuns<uint32_t>;
template class UniqueRuns<uint64_t>;

DagPool::DagPool(int height, Colors colors, Counts counts, Curve curve, Context& ctx)
    : unique_nodes_(static_cast<size_t>(height) + 1), reservation_(*ctx.memory) {
  dag_.height = height;
  dag_.colors = colors;
  dag_.counts = counts;
  dag_.curve = curve;
  dag_.nodes.resize(static_cast<size_t>(height) + 1);
}

Result<Subtree> DagPool::add_leaf(uint64_t leaf) {
  if (dag_.leaves.size() == ~uint32_t{0})
    return fail(ErrorCode::limit, {}, "more than 4294967295 different leaf words: use a lower --resolution");
  const uint32_t pointer = unique_leaves_.add(dag_.leaves, std::span<const uint64_t>(&leaf, 1));
  return Subtree{pointer, leaf_colors(leaf, dag_.colors)};
}

Result<Subtree> DagPool::add_node(int height, const Octants& octants, OrderState state) {
  std::array<uint64_t, 8> before{};  // by child: colours of the node that come before
  uint64_t colors = dag_.colors == Colors::all ? 1 : 0;
  for (const uint8_t octant : octant_orders.octant[state]) {
    if ((octants.mask >> octant & 1) == 0) continue;
    const auto child = static_cast<size_t>(std::popcount(octants.mask & ((1u << octant) - 1)));
    before[child] = colors;
    colors += octants.subtrees[child].colors;
  }
  std::array<uint32_t, 17> words;
  uint32_t length = 1;
  words[0] = octants.mask;
  for (uint32_t i = 0; i < octants.count; ++i) {
    words[length++] = octants.subtrees[i].pointer;
    if (dag_.counts == Counts::node) continue;
    if (before[i] > ~uint32_t{0})
      return fail(ErrorCode::limit, {}, "more than 4294967295 colors: use --counts node");
    words[length++] = static_cast<uint32_t>(before[i]);
  }
  if (dag_.counts == Counts::node) {
    const bool wide = colors >= wide_count;
    words[0] |= (wide ? wide_count : static_cast<uint32_t>(colors)) << 8;
    if (wide) {
      words[length++] = static_cast<uint32_t>(colors);
      words[length++] = static_cast<uint32_t>(colors >> 32);
    }
  }
  auto& pool = dag_.nodes[static_cast<size_t>(height)];
  auto& unique = unique_nodes_[static_cast<size_t>(height)];
  if (pool.size() + length > ~uint32_t{0})
    return fail(ErrorCode::limit, {},
                fmt::format("the nodes of {} voxels a side take more than 16 GiB: use a lower --resolution",
                            uint64_t{1} << height));
  const uint64_t known = unique.size();
  const uint32_t pointer = unique.add(pool, std::span<const uint32_t>(words.data(), length));
  dag_.node_count += unique.size() - known;
  return Subtree{pointer, colors};
}

Status DagPool::check_memory() {
  uint64_t bytes = dag_.leaves.capacity() * sizeof(uint64_t) + unique_leaves_.bytes();
  for (size_t h = 0; h < dag_.nodes.size(); ++h)
    bytes += dag_.nodes[h].capacity() * sizeof(uint32_t) + unique_nodes_[h].bytes();
  if (bytes <= reserved_) return {};
  VOX_CHECK(reservation_.add(bytes - reserved_, "the DAG"));
  reserved_ = bytes;
  return {};
}

Dag DagPool::finish(Subtree root, uint64_t voxels) {
  if (voxels == 0) dag_.leaves.push_back(0);
  dag_.root = root.pointer;
  dag_.color_count = root.colors;
  dag_.voxels = voxels;
  return std::move(dag_);
}

}  // namespace voxkit::color
