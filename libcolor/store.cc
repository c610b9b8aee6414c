#include "libcolor/store.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "libcolor/dag/color_walk.h"
#include "libcolor/octree/octree_dag.h"

#include "libcolor/part_codecs.h"
#include "libcolor/predicted/predicted.h"
#include "libcolor/surface/morton.h"
#include "libcolor/textures/image_codec.h"

namespace voxkit::color {
namespace {

constexpr size_t none = ~size_t{0};

/// Colours below the root, as the nodes say. With counts beside pointers, where no node says how many it has,
/// those on the way to the last octant do.
uint64_t all_colors(const DagView& view) {
  if (view.counts == Counts::node) return view.colors_below(view.height, view.root);
  uint64_t before = 0;
  uint32_t pointer = view.root;
  OrderState state = first_state(view.curve);
  for (int h = view.height; h > leaf_height; --h) {
    const NodeRef node = view.node(h, pointer);
    if (!node.there || node.mask == 0) return ~uint64_t{0};
    uint8_t last = 0;
    for (const uint8_t octant : octant_orders.octant[state])
      if (node.has(octant)) last = octant;
    const ChildRef child = view.child(node, h, last, state);
    before += child.colors_before;
    pointer = child.pointer;
    state = octant_orders.next[state][last];
  }
  return before + leaf_colors(view.leaf(pointer), view.colors);
}

/// Of the chunks that nodes with pointers lie in.
uint32_t kind_of_nodes(const Params& params) {
  return params.geometry == Geometry::ssvdag ? symmetric_kind : nodes_kind;
}

}  // namespace

Store::Store(MemoryBudget& memory, int threads) : memory_(memory), made_memory_(memory) {
  ctx_.threads = threads;
  ctx_.memory = &memory;
}

Status Store::find_chunks(const Container& container, const Params& params) {
  const auto& table = container.table();
  const auto bad = [&](const std::string& what) { return bad_input(container.name(), "table: " + what); };
  const uint64_t parts = part_count(params.color_count);
  if (parts > table.size()) return bad(fmt::format("fewer chunks COLR than {}", parts));
  const bool octree = params.geometry == Geometry::octree;
  leaves_ = octree_directory_ = none;
  nodes_.assign(static_cast<size_t>(params.height - leaf_height), none);
  parts_.assign(parts, none);
  if (octree)
    masks_.assign(static_cast<size_t>(std::ranges::count(table, masks_kind, &ChunkEntry::kind)), none);
  for (size_t i = 0; i < table.size(); ++i) {
    const ChunkEntry& entry = table[i];
    const auto place = [&](std::string_view kind, size_t* slot) -> Status {
      if (slot == nullptr || *slot != none)
        return bad(fmt::format("chunk {} {}.{}: not expected, or twice", kind, entry.index, entry.part));
      *slot = i;
      return {};
    };
    const auto part_of = [&](std::vector<size_t>& slots) {
      return entry.index == 0 && entry.part < slots.size() ? &slots[entry.part] : nullptr;
    };
    const bool only = entry.index == 0 && entry.part == 0;
    if (entry.kind == leaves_kind) {
      VOX_CHECK(place("LEAF", only && !octree ? &leaves_ : nullptr));
    } else if (entry.kind == nodes_kind || entry.kind == symmetric_kind) {
      const bool known = entry.kind == kind_of_nodes(params) && !octree && entry.index > leaf_height &&
                         entry.index <= static_cast<uint32_t>(params.height) && entry.part == 0;
      VOX_CHECK(place(entry.kind == nodes_kind ? "NODE" : "SNOD",
                      known ? &nodes_[entry.index - leaf_height - 1] : nullptr));
    } else if (entry.kind == octree_kind) {
      VOX_CHECK(place("OCTD", only && octree ? &octree_directory_ : nullptr));
    } else if (entry.kind == masks_kind) {
      VOX_CHECK(place("MASK", part_of(masks_)));
    } else if (entry.kind == colors_kind) {
      VOX_CHECK(place("COLR", part_of(parts_)));
    }
  }
  VOX_CHECK(check_geometry(container, params));
  for (uint64_t part = 0; part < parts; ++part) {
    if (parts_[part] == none) return bad(fmt::format("no chunk COLR 0.{}", part));
    const uint64_t length = table[parts_[part]].length;
    const uint32_t colors = colors_of_part(params.color_count, part);
    if (const auto part_bytes = part_codec(params.codec).part_bytes;
        part_bytes != nullptr && length != part_bytes(params, colors))
      return bad(
          fmt::format("chunk COLR 0.{} has {} bytes: expected {}", part, length, part_bytes(params, colors)));
    sizes_.push_back(length);
  }
  found_ = std::make_unique<std::atomic<const std::byte*>[]>(parts);
  VOX_CHECK(attributes_.find(container, params));
  return find_palette(container, params);
}

Status Store::check_geometry(const Container& container, const Params& params) const {
  const auto& table = container.table();
  const auto bad = [&](const std::string& what) { return bad_input(container.name(), "table: " + what); };
  if (params.geometry == Geometry::octree)
    return octree_directory_ == none ? Status(bad("no chunk OCTD")) : Status();
  if (leaves_ == none) return bad("no chunk LEAF");
  if (table[leaves_].length % sizeof(uint64_t) != 0 || table[leaves_].length == 0)
    return bad(fmt::format("chunk LEAF has {} bytes: expected a multiple of 8", table[leaves_].length));
  const bool symmetric = params.geometry == Geometry::ssvdag;
  if (symmetric && table[leaves_].length / sizeof(uint64_t) > word_in_node)
    return bad(fmt::format("chunk LEAF has {} bytes: expected at most 2^28 words", table[leaves_].length));
  for (size_t h = 0; h < nodes_.size(); ++h) {
    if (nodes_[h] == none)
      return bad(fmt::format("no chunk {} {}", symmetric ? "SNOD" : "NODE", h + leaf_height + 1));
    const uint64_t length = table[nodes_[h]].length;
    if (const uint64_t most = h == 0 ? word_in_node : address_mask + 1; symmetric && length > most)
      return bad(
          fmt::format("chunk SNOD {} has {} bytes: expected at most {}", h + leaf_height + 1, length, most));
    if (!symmetric && length % sizeof(uint32_t) != 0)
      return bad(
          fmt::format("chunk NODE {} has {} bytes: expected a multiple of 4", h + leaf_height + 1, length));
  }
  return {};
}

Status Store::find_palette(const Container& container, const Params& params) {
  if (params.codec != ColorCodec::palette) return {};
  VOX_TRY(const auto bytes, container.only_chunk(palette_kind));
  if (bytes.size() != uint64_t{params.palette_colors} * 3)
    return bad_input(container.name(),
                     fmt::format("chunk PALT has {} bytes: expected 3 for each of {} colors", bytes.size(),
                                 params.palette_colors));
  palette_ = {bytes.data(), params.palette_colors};
  return {};
}

Status Store::open_octree(const Container& container, const Params& params) const {
  if (octree_) return {};
  VOX_TRY(const auto directory, container.chunk(octree_directory_));
  std::vector<uint64_t> sizes;
  for (const size_t part : masks_) sizes.push_back(container.table()[part].length);
  VOX_TRY(octree_, OctreeReader::open(
                       directory, params.height, params.leaf_voxels, std::move(sizes),
                       [this, &container](uint64_t part) { return container.chunk(masks_[part]); },
                       container.name(), memory_));
  return {};
}

Result<OctreeReader*> Store::octree(const Container& container, const Params& params) const {
  if (params.geometry != Geometry::octree || params.colors != Colors::leaf || params.curve != Curve::morton ||
      ready_.load(std::memory_order_acquire) != nullptr)
    return nullptr;
  const std::lock_guard lock(mutex_);
  VOX_CHECK(open_octree(container, params));
  return octree_.get();
}

Result<DagView> Store::view_of_chunks(const Container& container, const Params& params) const {
  DagView view;
  view.height = params.height;
  view.colors = params.colors;
  view.counts = params.counts;
  view.curve = params.curve;
  view.root = params.root;
  // Chunks begin at multiples of 64 in the file, so their words are aligned.
  VOX_TRY(const auto leaves, container.chunk(leaves_));
  view.leaves = reinterpret_cast<const uint64_t*>(leaves.data());
  view.leaf_count = leaves.size() / sizeof(uint64_t);
  view.symmetric = params.geometry == Geometry::ssvdag;
  for (size_t h = 0; h < nodes_.size(); ++h) {
    VOX_TRY(const auto nodes, container.chunk(nodes_[h]));
    const size_t height = h + leaf_height + 1;
    if (view.symmetric) {
      view.coded[height] = reinterpret_cast<const uint8_t*>(nodes.data());
      view.coded_bytes[height] = nodes.size();
    } else {
      view.nodes[height] = reinterpret_cast<const uint32_t*>(nodes.data());
      view.words[height] = nodes.size() / sizeof(uint32_t);
    }
  }
  return view;
}

Result<const DagView*> Store::dag(const Container& container, const Params& params) const {
  if (const DagView* const ready = ready_.load(std::memory_order_acquire)) return ready;
  const std::lock_guard lock(mutex_);
  if (view_) return &*view_;
  DagView view;
  if (params.geometry == Geometry::octree) {
    VOX_CHECK(open_octree(container, params));
    auto dag = dag_of(*octree_, params.colors, params.counts, params.curve, ctx_);
    if (!dag) return fail(dag.error().code, container.name(), dag.error().what);
    made_ = std::move(*dag);
    uint64_t bytes = made_.leaves.size() * sizeof(uint64_t);
    for (const auto& nodes : made_.nodes) bytes += nodes.size() * sizeof(uint32_t);
    VOX_CHECK(made_memory_.add(bytes, "the DAG of an octree"));
    view = view_of(made_);
  } else {
    VOX_TRY(view, view_of_chunks(container, params));
  }
  if (params.leaf_voxels > 0 && all_colors(view) != params.color_count)
    return bad_input(container.name(),
                     fmt::format("chunk DAGP, byte 8: {} colors: expected {}, as the root of the DAG has",
                                 params.color_count, all_colors(view)));
  view_ = view;
  ready_.store(&*view_, std::memory_order_release);
  return &*view_;
}

const std::byte* Store::verify(uint64_t number, const Container& container) const {
  const auto chunk = container.chunk(parts_[number]);
  if (chunk) {
    found_[number].store(chunk->data(), std::memory_order_release);
    return chunk->data();
  }
  report(chunk.error());
  return nullptr;
}

void Store::report(const Container& container, const std::string& what) const {
  const std::lock_guard lock(mutex_);
  if (status_) status_ = bad_input(container.name(), what);
}

void Store::report(const Error& error) const {
  const std::lock_guard lock(mutex_);
  if (status_) status_ = tl::unexpected<Error>(error);
}

Result<std::vector<PartCell>> Store::cells_of_part(uint64_t number, const Container& container,
                                                   const Params& params) const {
  const uint64_t first = number << part_log2, last = first + colors_of_part(params.color_count, number);
  std::vector<PartCell> cells;
  cells.reserve(last - first);
  uint64_t next = first;
  const auto add = [&](uint64_t word, Index3 corner, uint64_t color) {
    // Other parts may have the first and the last voxels of a word.
    for (; color < first && word != 0; ++color) word &= word - 1;
    const uint64_t left = last - next;
    while (static_cast<uint64_t>(std::popcount(word)) > left) word ^= std::bit_floor(word);
    if (color != next || word == 0) return false;
    const uint64_t code = morton_code(static_cast<uint32_t>(corner.x), static_cast<uint32_t>(corner.y),
                                      static_cast<uint32_t>(corner.z));
    cells.push_back({code >> 3 * leaf_height, word, static_cast<uint32_t>(next - first)});
    next += static_cast<uint64_t>(std::popcount(word));
    return true;
  };
  VOX_TRY(OctreeReader* const octree, this->octree(container, params));
  if (octree != nullptr) {
    octree->for_each_word_of(first, last - 1, add);
    VOX_CHECK(octree->status());
  } else {
    VOX_TRY(const DagView* const view, dag(container, params));
    ColorWalk(*view, first, last).run(params.color_count, add);
  }
  if (next != last)
    return bad_input(container.name(),
                     fmt::format("chunk COLR 0.{}: counts of colors that do not add up", number));
  return cells;
}

void Store::decode_whole_parts(const Container& container, const Params& params) {
  const bool predicted = params.codec == ColorCodec::predicted;
  if (!predicted && !makes_images(params.codec)) return;
  decode_parts(
      [this, &container, &params, predicted](uint64_t number) -> Result<std::vector<Rgb>> {
        VOX_TRY(const auto bytes, container.chunk(parts_[number]));
        const uint32_t count = colors_of_part(params.color_count, number);
        std::vector<PartCell> cells;
        if (predicted) {
          VOX_TRY(cells, cells_of_part(number, container, params));
        }
        auto colors = predicted ? decode_predicted(bytes, cells, count)
                                : decode_as_image(bytes, params.codec, params.image_curve, count);
        if (!colors)
          return fail(colors.error().code, container.name(),
                      fmt::format("chunk COLR 0.{}: {}", number, colors.error().what));
        return colors;
      },
      predicted ? predicted_decode_bytes(std::min<uint64_t>(params.color_count, part_colors))
                : image_part_work_bytes(params.codec));
}

void Store::decode_parts(DecodedParts::Decode decode, uint64_t work_bytes) {
  decoded_ = std::make_unique<DecodedParts>(parts_.size(), memory_, work_bytes, std::move(decode));
}

std::shared_ptr<const DecodedParts::Part> Store::decoded(uint64_t number) const {
  auto part = decoded_->get(number);
  if (part) return std::move(*part);
  report(part.error());
  return nullptr;
}

Status Store::status() const {
  const std::lock_guard lock(mutex_);
  if (status_ && octree_) return octree_->status();
  return status_;
}

bool ColorReader::open(uint64_t part) {
  if (store_.decodes_parts()) {
    decoded_ = store_.decoded(part);
    bytes_ = decoded_ ? reinterpret_cast<const std::byte*>(decoded_->data()) : nullptr;
  } else {
    bytes_ = store_.part(part, container_);
  }
  plain_ = store_.decodes_parts() || params_.codec == ColorCodec::raw;
  first_ = last_ = 0;
  part_ = bytes_ != nullptr ? part : ~uint64_t{0};
  if (bytes_ == nullptr) return false;
  if (makes_textures(params_.codec))
    texture_.open(bytes_, params_, colors_of_part(params_.color_count, part));
  if (params_.codec == ColorCodec::palette)
    palette_.open(PaletteView(bytes_, store_.part_bytes(part), colors_of_part(params_.color_count, part),
                              palette_bits(params_.palette_colors)),
                  store_.palette());
  if (makes_blocks(params_.codec))
    view_ = PartView(bytes_, store_.part_bytes(part), colors_of_part(params_.color_count, part),
                     params_.endpoints);
  if (!plain_ && makes_blocks(params_.codec) && !view_.valid()) damaged("fewer bytes than its blocks take");
  return true;
}

void ColorReader::find(uint32_t within) {
  first_ = last_ = 0;
  if (!view_.valid()) return;
  const uint32_t number = within / macro_block_colors, base = number * macro_block_colors;
  macro_ = view_.macro_block(number);
  if (macro_.raw) return;
  const uint32_t block = view_.find_block(macro_, within - base);
  if (block == macro_.last) return damaged("a macro block has not its blocks");
  block_ = view_.block(block);
  first_ = base + block_.first;
  const uint32_t end = colors_of_part(params_.color_count, part_);
  last_ = block + 1 < macro_.last ? base + view_.first_color(block + 1)
                                  : std::min(end, base + macro_block_colors);
  if (last_ <= first_) {
    last_ = first_;
    damaged("blocks out of order");
  }
}

void ColorReader::damaged(const char* what) const {
  store_.report(container_, fmt::format("chunk COLR 0.{}: {}", part_, what));
}

}  // namespace voxkit::color
