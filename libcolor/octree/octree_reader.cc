#include "libcolor/octree/octree_reader.h"

#include <fmt/format.h>

#include "formats/little_endian.h"
#include "formats/parallel.h"
#include "libcolor/octree/octree_encode.h"
#include "libpage/decision.h"

namespace voxkit::color {

Result<std::unique_ptr<OctreeReader>> OctreeReader::open(std::span<const std::byte> directory, int height,
                                                         uint64_t voxels, std::vector<uint64_t> part_sizes,
                                                         PartBytes parts, std::string name,
                                                         MemoryBudget& memory) {
  const auto wrong = [&](const std::string& what) { return bad_input(name, "chunk OCTD: " + what); };
  std::unique_ptr<OctreeReader> reader(new OctreeReader);
  reader->parts_ = std::move(parts);
  reader->name_ = name;
  reader->reservation_ = Reservation(memory);
  if (voxels == 0) {
    if (!directory.empty() || !part_sizes.empty()) return wrong("nodes, and no voxels");
    reader->octree_.emplace(height, std::vector<OctreeLevel>());
    return reader;
  }
  if (directory.size() < 4 || load_le<uint32_t>(directory.data()) > directory.size() - 4)
    return wrong(fmt::format("{} bytes: fewer than its trees take", directory.size()));
  const auto tree_bytes = directory.subspan(4, load_le<uint32_t>(directory.data()));
  page::BitReader in(tree_bytes);
  const auto heights = static_cast<size_t>(height) + 1;
  reader->trees_.resize(heights);
  for (size_t h = heights - 1; h > 0; --h) {
    const auto tree = ContextTree::read(in);
    if (!tree) return wrong(tree.error().what);
    reader->trees_[h] = ContextLookup(*tree);
  }
  if (!in.at_end()) return wrong("its trees of contexts do not end where they should");

  // Pages follow, of one height after the other: how many there are is how many children those before have.
  const auto table = directory.subspan(4 + tree_bytes.size());
  if (table.size() % 4 != 0) return wrong(fmt::format("a table of pages of {} bytes", table.size()));
  std::vector<OctreeLevel> levels;
  reader->first_page_.resize(heights);
  std::vector<uint64_t> part_bytes;
  uint64_t nodes = 1, at = 0;
  Page place{0, 0, 0};
  for (size_t h = heights - 1; h > 0; --h) {
    const uint64_t pages = page_count(nodes);
    if (pages > table.size() / 4 - at)
      return wrong(fmt::format("{} pages: fewer than the nodes of height {} take", table.size() / 4, h));
    if (nodes > ~uint32_t{0}) return wrong(fmt::format("{} nodes of height {}", nodes, h));
    VOX_CHECK(reader->reservation_.add(OctreeLevel::bytes(nodes), "an octree"));
    reader->first_page_[h] = at;
    std::vector<uint64_t> children_before{0};
    children_before.reserve(pages + 1);
    for (uint64_t page = 0; page < pages; ++page, ++at) {
      const uint32_t children = load_le<uint16_t>(&table[4 * at]);
      const uint64_t own = nodes_of_page(nodes, page);
      if (children < own || children > 8 * own)
        return wrong(fmt::format("page {} of height {}: {} children of {} nodes", page, h, children, own));
      place.bytes = load_le<uint16_t>(&table[4 * at + 2]);
      if (place.bytes == 0) return wrong(fmt::format("page {} of height {} has no bytes", page, h));
      if (place.offset >= mask_part_bytes) {
        part_bytes.push_back(place.offset);
        ++place.part, place.offset = 0;
      }
      reader->pages_.push_back(place);
      place.offset += place.bytes;
      children_before.push_back(children_before.back() + children);
    }
    levels.emplace_back(nodes, std::move(children_before));
    nodes = levels.back().children();
  }
  if (at != table.size() / 4) return wrong(fmt::format("{} pages: expected {}", table.size() / 4, at));
  part_bytes.push_back(place.offset);
  if (part_bytes != part_sizes) return wrong("other sizes of pages than its chunks MASK have");
  if (nodes != voxels) return wrong(fmt::format("{} voxels: expected {}", nodes, voxels));
  levels.emplace_back(0, std::vector<uint64_t>{0});
  std::ranges::reverse(levels);
  OctreeReader* const self = reader.get();
  reader->octree_.emplace(height, std::move(levels), [self](int h, uint64_t page) { self->load(h, page); });
  return reader;
}

Status OctreeReader::decode_page(int height, uint64_t page) {
  OctreeLevel& level = octree_->level(height);
  const Page& place = pages_[first_page_[static_cast<size_t>(height)] + page];
  VOX_TRY(const auto part, parts_(place.part));
  const auto damaged = [&] {
    return bad_input(
        name_, fmt::format("chunk MASK 0.{}: page {} of height {} is damaged", place.part, page, height));
  };
  NodeWalk walk(*octree_, height, page);
  const ContextLookup& tree = trees_[static_cast<size_t>(height)];
  page::RansDecoder coder;
  coder.open(part.subspan(place.offset, place.bytes));
  const uint64_t first = page << page_nodes_log2, nodes = nodes_of_page(level.nodes(), page);
  uint8_t* const masks = level.page(page);
  uint64_t children = 0;
  for (uint64_t i = 0; i < nodes; ++i) {
    if ((i > 0 && !walk.next()) || walk.neighbors()[center] != first + i) return damaged();
    Surroundings around(level, walk.neighbors(), first);
    masks[i] = code_mask(around, 0,
                         [&](const Facts& facts, bool) { return page::decide(coder, tree.number(facts)); });
    children += count_octants(masks[i]);
  }
  if (!coder.finished() || children != level.children_of_page(page)) return damaged();
  return {};
}

OctreeReader::NodePath OctreeReader::path_to(uint64_t voxel) const {
  NodePath path{voxel};
  for (int h = 1; h <= octree_->height(); ++h) {
    const uint64_t child = path[static_cast<size_t>(h) - 1];
    const uint64_t page = octree_->level(h).page_with_child(child);
    const OctreeLevel& level = octree_->level_at(h, page << page_nodes_log2);
    // The last one whose children begin there or before.
    uint64_t node = page << page_nodes_log2, behind = node + nodes_of_page(level.nodes(), page);
    while (behind - node > 1) {
      const uint64_t middle = node + (behind - node) / 2;
      (level.first_child(middle) <= child ? node : behind) = middle;
    }
    path[static_cast<size_t>(h)] = node;
  }
  return path;
}

void OctreeReader::load(int height, uint64_t page) {
  const std::lock_guard lock(loading_);
  OctreeLevel& level = octree_->level(height);
  if (level.ready(page)) return;
  if (const Status decoded = decode_page(height, page); !decoded) {
    std::fill_n(level.page(page), nodes_of_page(level.nodes(), page), uint8_t{0});
    const std::lock_guard status_lock(mutex_);
    if (status_) status_ = decoded;
  }
  ++pages_decoded_;
  level.set_ready(page);
}

Status OctreeReader::decode_all(const Context& ctx) {
  if (octree_->empty()) return {};
  const std::lock_guard lock(loading_);
  for (int h = octree_->height(); h > 0; --h) {
    OctreeLevel& level = octree_->level(h);
    VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(level.pages()), [&](int64_t i) -> Status {
      const auto page = static_cast<uint64_t>(i);
      if (level.ready(page)) return {};
      VOX_CHECK(decode_page(h, page));
      ++pages_decoded_;
      level.set_ready(page);
      return {};
    }));
  }
  return status();
}

Status OctreeReader::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

}  // namespace voxkit::color
