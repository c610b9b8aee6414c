// Verifying a whole file: every checksum, and that everything in it is as FORMAT.md says.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <unordered_set>

#include "formats/parallel.h"
#include "formats/reservation.h"
#include "libcolor/attributes/attribute_encode.h"
#include "libcolor/part_codecs.h"
#include "libcolor/store.h"
#include "libcolor/surface/morton.h"

namespace voxkit::color {
namespace {

/// What is below a node.
struct Below {
  uint64_t voxels = 0, colors = 0;  ///< no voxels: no node begins here
  uint64_t begin = 0;               ///< of nodes with symmetry: the first byte
};
/// Nodes with symmetry take five bytes or more, so these are apart.
constexpr uint64_t place_of(uint64_t byte) {
  return byte / 4;
}

class Checker {
 public:
  Checker(const Volume& volume, const DagView& view, Context& ctx)
      : volume_(volume), params_(volume.params()), view_(view), ctx_(ctx), reservation_(*ctx.memory) {}

  Status run() {
    const Container& container = volume_.container();
    VOX_CHECK(parallel_for(ctx_, static_cast<int64_t>(container.table().size()), [&](int64_t i) -> Status {
      VOX_CHECK(container.chunk(static_cast<size_t>(i)));
      return {};
    }));
    VOX_CHECK(check_dag());
    const auto parts = static_cast<int64_t>(part_count(params_.color_count));
    VOX_CHECK(parallel_for(ctx_, parts, [&](int64_t i) { return check_part(static_cast<uint64_t>(i)); }));
    const auto kinds = static_cast<int64_t>(volume_.attributes().size());
    return parallel_for(ctx_, parts * kinds, [&](int64_t i) {
      return check_values(static_cast<size_t>(i % kinds), static_cast<uint64_t>(i / kinds));
    });
  }

 private:
  tl::unexpected<Error> bad(const std::string& what) const {
    return bad_input(volume_.container().name(), what);
  }

  Status check_dag() {
    std::vector<Below> below(view_.leaf_count);
    VOX_CHECK(reservation_.add(below.size() * sizeof(Below), "a table of voxels below nodes"));
    for (uint64_t i = 0; i < view_.leaf_count; ++i) {
      const uint64_t leaf = view_.leaves[i];
      if (leaf == 0 && params_.leaf_voxels > 0) return bad(fmt::format("chunk LEAF, word {}: no voxels", i));
      below[i] = {static_cast<uint64_t>(std::popcount(leaf)), leaf_colors(leaf, params_.colors)};
    }
    for (int h = leaf_height + 1; h <= params_.height; ++h) {
      VOX_TRY(auto next, view_.symmetric ? check_symmetric_nodes(h, below) : check_nodes(h, below));
      below = std::move(next);
    }
    if (params_.leaf_voxels == 0) return {};
    const Below all = below_root(below);
    if (all.voxels != params_.leaf_voxels || all.colors != params_.color_count)
      return bad(fmt::format("chunk DAGP: {} voxels and {} colors: below the root there are {} and {}",
                             params_.leaf_voxels, params_.color_count, all.voxels, all.colors));
    VOX_CHECK(check_extents(params_.height, params_.root, Index3(0)));
    if (params_.counts == Counts::node) return {};
    known_.resize((static_cast<size_t>(params_.height) + 1) * order_states);
    VOX_CHECK(check_offsets(params_.height, params_.root, first_state(params_.curve)));
    return {};
  }

  Below below_root(const std::vector<Below>& nodes) const {
    const uint64_t address = view_.symmetric ? params_.root & address_mask : params_.root;
    const bool bytes = view_.symmetric && params_.height > leaf_height;
    const uint64_t place = bytes ? place_of(address) : address;
    return place < nodes.size() && (!bytes || nodes[place].begin == address) ? nodes[place] : Below{};
  }

  /// The nodes of a height, one after the other; what is below each.
  Result<std::vector<Below>> check_nodes(int h, const std::vector<Below>& children) {
    const uint64_t words = view_.words[static_cast<size_t>(h)];
    VOX_CHECK(reservation_.add(words * sizeof(Below), "a table of voxels below nodes"));
    std::vector<Below> below(words);
    for (uint64_t at = 0; at < words;) {
      const auto broken = [&](const std::string& rule) {
        return bad(fmt::format("chunk NODE {}, word {}: {}", h, at, rule));
      };
      const NodeRef node = view_.node(h, static_cast<uint32_t>(at));
      if (!node.there) return broken("the node ends behind the chunk");
      if (node.mask == 0) return broken("no octants");
      Below own{0, params_.colors == Colors::all ? uint64_t{1} : 0};
      const auto octants = static_cast<uint32_t>(std::popcount(node.mask));
      const bool beside = params_.counts == Counts::pointer;
      for (uint32_t octant = 0; octant < 8; ++octant) {
        if (!node.has(octant)) continue;
        const uint32_t pointer = view_.pointer(node, octant);
        if (pointer >= children.size() || children[pointer].voxels == 0)
          return broken(fmt::format("pointer {}: nothing begins there", pointer));
        own.voxels += children[pointer].voxels;
        own.colors += children[pointer].colors;
      }
      const uint32_t count = *node.words >> 8;
      const bool wide = !beside && own.colors >= wide_count;
      if (beside ? count != 0
                 : view_.colors_below(h, static_cast<uint32_t>(at)) != own.colors ||
                       (count == wide_count) != wide)
        return broken(fmt::format("a count of {}: expected that of {} colors", count, own.colors));
      below[at] = own;
      at += node_words(octants, wide, params_.counts);
    }
    return below;
  }

  /// The same of nodes with symmetry, by the place of their first byte.
  Result<std::vector<Below>> check_symmetric_nodes(int h, const std::vector<Below>& children) {
    const uint64_t bytes = view_.coded_bytes[static_cast<size_t>(h)];
    VOX_CHECK(reservation_.add((place_of(bytes) + 1) * sizeof(Below), "a table of voxels below nodes"));
    std::vector<Below> below(place_of(bytes) + 1);
    for (uint64_t at = 0; at < bytes;) {
      const auto broken = [&](const std::string& rule) {
        return bad(fmt::format("chunk SNOD {}, byte {}: {}", h, at, rule));
      };
      const NodeRef node = view_.node(h, static_cast<uint32_t>(at));
      const uint8_t* const behind = node.there ? DagView::behind_octants(node) : nullptr;
      if (!node.there || behind > node.end) return broken("the node ends behind the chunk");
      if (node.mask == 0) return broken("no octants");
      Below own{0, params_.colors == Colors::all ? uint64_t{1} : 0, at};
      for (uint32_t octant = 0; octant < 8; ++octant) {
        if (!node.has(octant)) continue;
        const uint32_t pointer = view_.pointer(node, octant), address = pointer & address_mask;
        Below child;
        if (h == leaf_height + 1 && (address & word_in_node) != 0) {
          const uint64_t word = view_.leaf(pointer);
          if (word == 0 || leaf_octants(word) != node.above_words[address & ~word_in_node])
            return broken(fmt::format("octant {}: a word without voxels", octant));
          child = {static_cast<uint64_t>(std::popcount(word)), leaf_colors(word, params_.colors)};
        } else {
          const uint64_t place = h == leaf_height + 1 ? address : place_of(address);
          if (place < children.size() && (h == leaf_height + 1 || children[place].begin == address))
            child = children[place];
        }
        if (child.voxels == 0) return broken(fmt::format("pointer {}: nothing begins there", address));
        own.voxels += child.voxels;
        own.colors += child.colors;
      }
      if (view_.colors_below(h, static_cast<uint32_t>(at)) != own.colors)
        return broken(fmt::format("a count of {}: expected that of {} colors",
                                  view_.colors_below(h, static_cast<uint32_t>(at)), own.colors));
      below[place_of(at)] = own;
      at += static_cast<uint64_t>(behind - (view_.coded[static_cast<size_t>(h)] + at));
    }
    return below;
  }

  /// Counts beside pointers, of nodes that are gone through in a state and those below: how many colours.
  Result<uint64_t> check_offsets(int h, uint32_t pointer, OrderState state) {
    if (h == leaf_height) return uint64_t{leaf_colors(view_.leaf(pointer), params_.colors)};
    std::vector<uint64_t>& known = known_[static_cast<size_t>(h) * order_states + state];
    if (known.empty()) {
      const uint64_t words = view_.words[static_cast<size_t>(h)];
      VOX_CHECK(reservation_.add(words * sizeof(uint64_t), "a table of colors below nodes"));
      known.resize(words);
    }
    if (known[pointer] != 0) return known[pointer];
    const NodeRef node = view_.node(h, pointer);
    uint64_t colors = params_.colors == Colors::all ? 1 : 0;
    for (const uint8_t octant : octant_orders.octant[state]) {
      if (!node.has(octant)) continue;
      const ChildRef child = view_.child(node, h, octant, state);
      if (child.colors_before != colors)
        return bad(fmt::format("chunk NODE {}, word {}: {} colors before octant {}: expected {}", h, pointer,
                               child.colors_before, octant, colors));
      VOX_TRY(const uint64_t below, check_offsets(h - 1, child.pointer, octant_orders.next[state][octant]));
      colors += below;
    }
    return known[pointer] = colors;
  }

  /// No voxel is outside the volume: of nodes that reach beyond it, those below. A node need be looked at
  /// once for each way to reach beyond, however often it is there.
  Status check_extents(int h, uint32_t pointer, Index3 corner) {
    const Index3 dims = volume_.info().dims, end = corner + (int64_t{1} << h);
    const auto outside = [&] {
      return bad(fmt::format("a voxel in the cell of {} at {},{},{}: outside the volume", 1 << h, corner.x,
                             corner.y, corner.z));
    };
    uint64_t beyond = 0;
    for (int a = 0; a < 3; ++a) {
      if (corner[a] >= dims[a]) return outside();
      if (end[a] > dims[a]) beyond |= uint64_t{1} << a;
    }
    if (beyond == 0 || !seen_.insert(pointer | beyond << 32 | static_cast<uint64_t>(h) << 40).second)
      return {};
    if (h == leaf_height) {
      for (uint64_t left = view_.leaf(pointer); left != 0; left &= left - 1) {
        const Index3 at = corner + Index3(morton_place(static_cast<uint64_t>(std::countr_zero(left))));
        if (at.x >= dims.x || at.y >= dims.y || at.z >= dims.z) return outside();
      }
      return {};
    }
    const NodeRef node = view_.node(h, pointer);
    for (uint32_t octant = 0; octant < 8; ++octant) {
      if (!node.has(octant)) continue;
      const Index3 at = corner + Index3(octant & 1, octant >> 1 & 1, octant >> 2) * (int64_t{1} << (h - 1));
      VOX_CHECK(check_extents(h - 1, view_.pointer(node, octant), at));
    }
    return {};
  }

  /// Of codecs whose parts are decoded as a whole, that is the check.
  Status check_part(uint64_t part) const {
    const Store& store = volume_.store();
    if (store.decodes_parts()) return store.decoded(part) ? Status() : store.status();
    const std::byte* const bytes = store.part(part, volume_.container());
    if (bytes == nullptr) return store.status();
    const PartCodec& codec = part_codec(params_.codec);
    if (codec.check == nullptr) return {};
    const std::string wrong =
        codec.check({bytes, store.part_bytes(part)}, params_, colors_of_part(params_.color_count, part));
    return wrong.empty() ? Status() : bad(fmt::format("chunk COLR 0.{}: {}", part, wrong));
  }

  Status check_values(size_t which, uint64_t part) const {
    const AttributeStore& attributes = volume_.store().attributes();
    const AttributeParams& own = attributes.params()[which];
    VOX_TRY(const auto bytes, attributes.part(which, part, volume_.container()));
    const std::string wrong = check_attribute_part(bytes, own, colors_of_part(params_.color_count, part));
    return wrong.empty()
               ? Status()
               : bad(fmt::format("chunk ATTR {}.{}: {}", static_cast<int>(own.attribute), part, wrong));
  }

  const Volume& volume_;
  const Params& params_;
  const DagView& view_;
  Context& ctx_;
  Reservation reservation_;
  std::unordered_set<uint64_t> seen_;         ///< nodes that reach beyond the volume
  std::vector<std::vector<uint64_t>> known_;  ///< by height and state: colours below nodes; 0: not known
};

}  // namespace

Status Volume::check(Context& ctx) const {
  VOX_TRY(const DagView* const view, store_->dag(*container_, params_));
  return Checker(*this, *view, ctx).run();
}

}  // namespace voxkit::color
