#include "libcolor/store.h"

#include <fmt/format.h>

#include <algorithm>

#include "libcolor/part_codecs.h"
#include "libcolor/textures/image_codec.h"

namespace voxkit::color {
namespace {

/// Colours below the root, as the nodes say. With counts beside pointers, where no node says how many it has,
/// those on the way to the last octant do.
uint64_t all_colors(const DagView& view) {
  if (view.counts == Counts::node) return view.colors_below(view.height, view.root);
  uint64_t before = 0;
  uint32_t pointer = view.root;
  OrderState state = first_state(view.curve);
  for (int h = view.height; h > leaf_height; --h) {
    const NodeRef node = view.node(h, pointer);
    if (node.words == nullptr || node.mask == 0) return ~uint64_t{0};
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

}  // namespace

Status Store::find_chunks(const Container& container, const Params& params) {
  const auto& table = container.table();
  const auto bad = [&](const std::string& what) { return bad_input(container.name(), "table: " + what); };
  constexpr size_t none = ~size_t{0};
  const uint64_t parts = part_count(params.color_count);
  if (parts > table.size()) return bad(fmt::format("fewer chunks COLR than {}", parts));
  leaves_ = none;
  nodes_.assign(static_cast<size_t>(params.height - leaf_height), none);
  parts_.assign(parts, none);
  for (size_t i = 0; i < table.size(); ++i) {
    const ChunkEntry& entry = table[i];
    const auto place = [&](size_t& slot, bool known) -> Status {
      if (known && slot == none) {
        slot = i;
        return {};
      }
      return bad(fmt::format("chunk {} {}.{}: not expected, or twice",
                             entry.kind == leaves_kind  ? "LEAF"
                             : entry.kind == nodes_kind ? "NODE"
                                                        : "COLR",
                             entry.index, entry.part));
    };
    size_t nowhere = 0;
    if (entry.kind == leaves_kind) {
      VOX_CHECK(place(leaves_, entry.index == 0 && entry.part == 0));
    } else if (entry.kind == nodes_kind) {
      const bool known =
          entry.index > leaf_height && entry.index <= static_cast<uint32_t>(params.height) && entry.part == 0;
      VOX_CHECK(place(known ? nodes_[entry.index - leaf_height - 1] : nowhere, known));
    } else if (entry.kind == colors_kind) {
      const bool known = entry.index == 0 && entry.part < parts;
      VOX_CHECK(place(known ? parts_[entry.part] : nowhere, known));
    }
  }
  if (leaves_ == none) return bad("no chunk LEAF");
  if (table[leaves_].length % sizeof(uint64_t) != 0 || table[leaves_].length == 0)
    return bad(fmt::format("chunk LEAF has {} bytes: expected a multiple of 8", table[leaves_].length));
  for (size_t h = 0; h < nodes_.size(); ++h) {
    if (nodes_[h] == none) return bad(fmt::format("no chunk NODE {}", h + leaf_height + 1));
    const uint64_t length = table[nodes_[h]].length;
    if (length % sizeof(uint32_t) != 0)
      return bad(
          fmt::format("chunk NODE {} has {} bytes: expected a multiple of 4", h + leaf_height + 1, length));
  }
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
  return find_palette(container, params);
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

Result<const DagView*> Store::dag(const Container& container, const Params& params) const {
  if (const DagView* const ready = ready_.load(std::memory_order_acquire)) return ready;
  const std::lock_guard lock(mutex_);
  if (view_) return &*view_;
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
  for (size_t h = 0; h < nodes_.size(); ++h) {
    VOX_TRY(const auto nodes, container.chunk(nodes_[h]));
    view.nodes[h + leaf_height + 1] = reinterpret_cast<const uint32_t*>(nodes.data());
    view.words[h + leaf_height + 1] = nodes.size() / sizeof(uint32_t);
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
  const std::lock_guard lock(mutex_);
  if (status_) status_ = tl::unexpected<Error>(chunk.error());
  return nullptr;
}

void Store::report(const Container& container, const std::string& what) const {
  const std::lock_guard lock(mutex_);
  if (status_) status_ = bad_input(container.name(), what);
}

void Store::decode_images(const Container& container, const Params& params, MemoryBudget& memory) {
  if (!makes_images(params.codec)) return;
  decode_parts(
      [&](uint64_t number) -> Result<std::vector<Rgb>> {
        VOX_TRY(const auto bytes, container.chunk(parts_[number]));
        auto colors = decode_as_image(bytes, params.codec, params.image_curve,
                                      colors_of_part(params.color_count, number));
        if (!colors)
          return fail(colors.error().code, container.name(),
                      fmt::format("chunk COLR 0.{}: {}", number, colors.error().what));
        return colors;
      },
      image_part_work_bytes(params.codec), memory);
}

void Store::decode_parts(DecodedParts::Decode decode, uint64_t work_bytes, MemoryBudget& memory) {
  decoded_ = std::make_unique<DecodedParts>(parts_.size(), memory, work_bytes, std::move(decode));
}

std::shared_ptr<const DecodedParts::Part> Store::decoded(uint64_t number) const {
  auto part = decoded_->get(number);
  if (part) return std::move(*part);
  const std::lock_guard lock(mutex_);
  if (status_) status_ = tl::unexpected<Error>(part.error());
  return nullptr;
}

Status Store::status() const {
  const std::lock_guard lock(mutex_);
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
  if (has_threshold(params_.codec))
    view_ = PartView(bytes_, store_.part_bytes(part), colors_of_part(params_.color_count, part),
                     params_.endpoints);
  if (!plain_ && has_threshold(params_.codec) && !view_.valid()) damaged("fewer bytes than its blocks take");
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
