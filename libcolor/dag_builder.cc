#include "libcolor/dag_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

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

DagBuilder::DagBuilder(int height, Colors colors, Counts counts, Context& ctx)
    : open_(static_cast<size_t>(height) + 1),
      unique_nodes_(static_cast<size_t>(height) + 1),
      reservation_(*ctx.memory) {
  dag_.height = height;
  dag_.colors = colors;
  dag_.counts = counts;
  dag_.nodes.resize(static_cast<size_t>(height) + 1);
}

Status DagBuilder::add(std::span<const SurfaceVoxel> voxels) {
  for (const SurfaceVoxel& voxel : voxels) {
    if (voxel.place < next_ || voxel.place >> (3 * dag_.height) != 0)
      return fail(ErrorCode::internal, {}, fmt::format("voxel {:#x} out of order", voxel.place));
    next_ = voxel.place + 1;
    if (voxel.place >> 6 != leaf_place_) {
      if (leaf_ != 0) {
        VOX_CHECK(close_leaf());
        // All nodes below the lowest one that holds both are complete.
        const int differing = 63 - std::countl_zero((voxel.place >> 6) ^ leaf_place_);
        VOX_CHECK(close_up_to(leaf_height + differing / 3));
      }
      leaf_place_ = voxel.place >> 6;
    }
    leaf_ |= uint64_t{1} << (voxel.place & 63);
  }
  dag_.voxels += voxels.size();
  return check_memory();
}

Status DagBuilder::append(int height, uint32_t octant, Closed child) {
  if (height > dag_.height) {
    dag_.root = child.pointer;
    dag_.color_count = child.colors;
    return {};
  }
  Open& node = open_[static_cast<size_t>(height)];
  node.mask |= 1u << octant;
  node.pointers[node.children] = child.pointer;
  node.counts[node.children++] = child.colors;
  return {};
}

Status DagBuilder::close_leaf() {
  if (dag_.leaves.size() == ~uint32_t{0})
    return fail(ErrorCode::limit, {}, "more than 4294967295 different leaf words: use a lower --resolution");
  const uint32_t pointer = unique_leaves_.add(dag_.leaves, std::span<const uint64_t>(&leaf_, 1));
  const uint32_t colors = leaf_colors(leaf_, dag_.colors);
  leaf_ = 0;
  return append(leaf_height + 1, static_cast<uint32_t>(leaf_place_ & 7), {pointer, colors});
}

Result<DagBuilder::Closed> DagBuilder::close(int height) {
  Open& node = open_[static_cast<size_t>(height)];
  std::array<uint32_t, 17> words;
  uint64_t colors = dag_.colors == Colors::all ? 1 : 0;
  uint32_t length = 1;
  words[0] = node.mask;
  for (uint32_t i = 0; i < node.children; ++i) {
    words[length++] = node.pointers[i];
    if (dag_.counts == Counts::pointer) {
      if (colors > ~uint32_t{0})
        return fail(ErrorCode::limit, {}, "more than 4294967295 colors: use --counts node");
      words[length++] = static_cast<uint32_t>(colors);
    }
    colors += node.counts[i];
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
  const uint64_t before = unique.size();
  const uint32_t pointer = unique.add(pool, std::span<const uint32_t>(words.data(), length));
  dag_.node_count += unique.size() - before;
  node = {};
  return Closed{pointer, colors};
}

Status DagBuilder::close_up_to(int height) {
  for (int h = leaf_height + 1; h <= height; ++h) {
    VOX_TRY(const Closed child, close(h));
    VOX_CHECK(append(h + 1, static_cast<uint32_t>(leaf_place_ >> 3 * (h - leaf_height) & 7), child));
  }
  return {};
}

Status DagBuilder::check_memory() {
  uint64_t bytes = dag_.leaves.capacity() * sizeof(uint64_t) + unique_leaves_.bytes();
  for (size_t h = 0; h < dag_.nodes.size(); ++h)
    bytes += dag_.nodes[h].capacity() * sizeof(uint32_t) + unique_nodes_[h].bytes();
  if (bytes <= reserved_) return {};
  VOX_CHECK(reservation_.add(bytes - reserved_, "the DAG"));
  reserved_ = bytes;
  return {};
}

Result<Dag> DagBuilder::finish() {
  if (dag_.voxels == 0) {
    dag_.leaves.push_back(0);
    return std::move(dag_);
  }
  VOX_CHECK(close_leaf());
  VOX_CHECK(close_up_to(dag_.height));
  return std::move(dag_);
}

}  // namespace voxkit::color
