#include "libcolor/edit/arrangement.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <deque>

#include "formats/reservation.h"
#include "libcolor/edit/sound_walk.h"
#include "libcolor/layout.h"
#include "libcolor/surface/morton.h"

namespace voxkit::color {
namespace {

/// A surface while it is read.
struct Reading {
  Reading(const Placed& placed, const DagView& dag, AttributeSet set)
      : volume(*placed.volume),
        view(dag),
        colors(volume.store(), volume.container(), volume.params()),
        attributes(volume.store(), volume.container(), volume.params(), set),
        box{placed.at, placed.at + volume.info().dims} {}
  const Volume& volume;
  const DagView& view;
  ColorReader colors;
  AttributesReader attributes;
  Box box;  ///< in the grid
  uint64_t voxels = 0;
};

/// A node or a word of a surface that reaches into a cell of the grid.
struct Piece {
  Reading* surface;
  WalkedCell cell;  ///< its corner is a place in the grid
};
using Pieces = std::vector<Piece>;

/// Octants of a cell that a box reaches into, as a mask.
uint32_t octants_touched(Index3 corner, int64_t half, const Box& box) {
  constexpr std::array<std::array<uint32_t, 2>, 3> halves = {{{0x55, 0xaa}, {0x33, 0xcc}, {0x0f, 0xf0}}};
  uint32_t octants = 0xff;
  for (int a = 0; a < 3; ++a) {
    const int64_t middle = corner[a] + half;
    const auto& [lower, upper] = halves[static_cast<size_t>(a)];
    if (box.lo[a] >= middle || box.hi[a] <= corner[a]) octants &= ~lower;
    if (box.hi[a] <= middle || box.lo[a] >= middle + half) octants &= ~upper;
  }
  return octants;
}

class Walk {
 public:
  Walk(Index3 dims, AttributeSet set, const SurfaceSource::Sink& sink, Context& ctx,
       Arrangement::Census& census)
      : grid_{Index3(0), dims},
        set_(set),
        height_(height_of(dims)),
        sink_(sink),
        ctx_(ctx),
        census_(census),
        below_(static_cast<size_t>(height_) + 1) {
    run_.reserve(run_voxels + 64);
  }

  Status add(const Placed& placed) {
    const Volume& volume = *placed.volume;
    if (volume.params().leaf_voxels == 0) return {};
    VOX_TRY(const DagView* const view, volume.store().dag(volume.container(), volume.params()));
    Reading& reading = readings_.emplace_back(placed, *view, set_);
    return enter({&reading, {view->height, view->root, placed.at, 0, first_state(view->curve)}});
  }

  Status run() {
    if (!roots_.empty()) VOX_CHECK(cell(height_, Index3(0), roots_));
    return flush();
  }

 private:
  /// Down to what is no larger than the grid.
  Status enter(const Piece& piece) {
    const WalkedCell& at = piece.cell;
    const Box box{at.corner, at.corner + (int64_t{1} << at.height)};
    if (intersect(intersect(box, piece.surface->box), grid_).empty()) return {};
    if (at.height <= height_) {
      roots_.push_back(piece);
      return {};
    }
    return for_each_child(piece, [&](const Piece& child) { return enter(child); });
  }

  template <class Use>
  Status for_each_child(const Piece& piece, const Use& use) {
    const WalkedCell& at = piece.cell;
    const DagView& view = piece.surface->view;
    const NodeRef node = view.node(at.height, at.pointer);
    if (node.mask == 0) return damaged(piece);
    const auto children = children_of(view, node, at.height, at.state);
    const int64_t side = int64_t{1} << (at.height - 1);
    for (uint32_t octant = 0; octant < 8; ++octant) {
      if (!node.has(octant)) continue;
      VOX_CHECK(use({piece.surface,
                     {at.height - 1, children[octant].pointer, octant_corner(at.corner, octant, side),
                      at.color + children[octant].colors_before, octant_orders.next[at.state][octant]}}));
    }
    return {};
  }

  /// A cell of the grid, and what reaches into it: nothing that is larger.
  Status cell(int h, Index3 corner, const Pieces& pieces) {
    constexpr uint64_t between_looks = 1 << 16;
    if (++census_.cells % between_looks == 0) {
      VOX_CHECK(check_interrupt());
      ctx_.progress(std::ldexp(static_cast<double>(code_of(corner)), -3 * height_));
    }
    if (h == leaf_height) return word(corner, pieces);
    // The cells of a height are gone through one after the other: each finds its lists where those of the one
    // before were.
    auto& below = below_[static_cast<size_t>(h) - 1];
    for (Pieces& list : below) list.clear();
    const int64_t half = int64_t{1} << (h - 1);
    for (const Piece& piece : pieces) {
      const auto sort_in = [&](const Piece& part) -> Status {
        const Index3 from = part.cell.corner;
        const Box box =
            intersect({from, from + (int64_t{1} << part.cell.height)}, intersect(part.surface->box, grid_));
        if (box.empty()) return {};
        for (uint32_t left = octants_touched(corner, half, box); left != 0; left &= left - 1)
          below[static_cast<size_t>(std::countr_zero(left))].push_back(part);
        return {};
      };
      VOX_CHECK(piece.cell.height == h ? for_each_child(piece, sort_in) : sort_in(piece));
    }
    for (uint32_t octant = 0; octant < 8; ++octant)
      if (!below[octant].empty()) VOX_CHECK(cell(h - 1, octant_corner(corner, octant, half), below[octant]));
    return {};
  }

  /// A word of the grid, from the words that reach into it; those of the surfaces named first come first.
  Status word(Index3 corner, const Pieces& pieces) {
    uint64_t there = 0, shared = 0, differing = 0;
    std::array<Rgb, 64> colors;
    const size_t bytes = set_.bytes();
    std::array<std::byte, 64 * all_attribute_bytes> values;
    for (const Piece& piece : pieces) {
      Reading& surface = *piece.surface;
      const WalkedCell& at = piece.cell;
      const uint64_t leaf = surface.view.leaf(at.pointer);
      if (leaf == 0) return damaged(piece);
      const Box inside =
          intersect({corner, corner + (int64_t{1} << leaf_height)}, intersect(surface.box, grid_));
      for (uint64_t left = leaf & leaf_within(at.corner, inside); left != 0; left &= left - 1) {
        const auto bit = static_cast<uint32_t>(std::countr_zero(left));
        const uint64_t index = at.color + leaf_index(leaf, bit, surface.view.colors, at.state);
        const Rgb color = surface.colors.color(index);
        own_.clear();
        surface.attributes.append(index, own_);
        const uint64_t to = code_of(at.corner + Index3(morton_place(bit)) - corner);
        const uint64_t to_bit = uint64_t{1} << to;
        if ((there & to_bit) == 0) {
          there |= to_bit;
          colors[to] = color;
          std::ranges::copy(own_, &values[to * bytes]);
        } else {
          shared |= to_bit;
          if (color != colors[to] || !std::equal(own_.begin(), own_.end(), &values[to * bytes]))
            differing |= to_bit;
        }
        ++surface.voxels;
      }
      if (surface.voxels > surface.volume.params().leaf_voxels) return damaged(piece);
    }
    const uint64_t first = code_of(corner);
    for (uint64_t left = there; left != 0; left &= left - 1) {
      const auto bit = static_cast<size_t>(std::countr_zero(left));
      run_.push_back({first | bit, colors[bit]});
      values_.insert(values_.end(), &values[bit * bytes], &values[bit * bytes] + bytes);
    }
    census_.voxels += static_cast<uint64_t>(std::popcount(there));
    census_.shared += static_cast<uint64_t>(std::popcount(shared));
    census_.differing += static_cast<uint64_t>(std::popcount(differing));
    return run_.size() < run_voxels ? Status() : flush();
  }

  Status flush() {
    VOX_CHECK(check_interrupt());
    for (const Reading& surface : readings_) VOX_CHECK(surface.volume.store().status());
    const Status taken = run_.empty() ? Status() : sink_({run_, values_});
    run_.clear();
    values_.clear();
    return taken;
  }

  static Status damaged(const Piece& piece) {
    return bad_input(piece.surface->volume.container().name(),
                     "chunk NODE: nodes or words without voxels, or too many");
  }
  static uint64_t code_of(Index3 place) {
    return morton_code(static_cast<uint32_t>(place.x), static_cast<uint32_t>(place.y),
                       static_cast<uint32_t>(place.z));
  }

  static constexpr size_t run_voxels = 1 << 14;
  Box grid_;
  AttributeSet set_;
  int height_;
  const SurfaceSource::Sink& sink_;
  Context& ctx_;
  Arrangement::Census& census_;
  std::deque<Reading> readings_;  ///< they stay where they are
  Pieces roots_;
  std::vector<std::array<Pieces, 8>> below_;  ///< by height: what reaches into the octants of the cell above
  std::vector<SurfaceVoxel> run_;
  std::vector<std::byte> values_, own_;  ///< attributes: of the run; of a voxel
};

/// What all of them have.
AttributeSet common_attributes(std::span<const Placed> surfaces) {
  AttributeSet set;
  for (size_t i = 0; i < attribute_kinds.size(); ++i) {
    const auto attribute = static_cast<Attribute>(i);
    if (std::ranges::all_of(surfaces, [&](const Placed& placed) {
          return placed.volume->params().attributes.has(attribute);
        }))
      set.add(attribute);
  }
  return set;
}

}  // namespace

Arrangement::Arrangement(std::vector<Placed> surfaces, VolumeInfo info) : surfaces_(std::move(surfaces)) {
  info_ = std::move(info);
  info_.format = VoxelFormat::rgba32;
  attributes_ = common_attributes(surfaces_);
}

Status Arrangement::read(Context& ctx, const Sink& sink) {
  census_ = {};
  // Up to eight pieces of each reach into an octant, and a list that grows has room for twice as many.
  constexpr uint64_t surface_bytes = (most_levels + 1) * 8 * 8 * 2 * sizeof(Piece) + sizeof(Reading);
  VOX_TRY(const Reservation memory,
          Reservation::take(surfaces_.size() * surface_bytes, "a walk through surfaces", ctx));
  Walk walk(info_.dims, attributes_, sink, ctx, census_);
  for (const Placed& placed : surfaces_) VOX_CHECK(walk.add(placed));
  return walk.run();
}

Result<uint64_t> voxels_in(const Volume& volume, const Box& box) {
  const Box part = intersect(box, volume.info().box());
  if (part == volume.info().box() || volume.params().leaf_voxels == 0) return volume.params().leaf_voxels;
  if (part.empty()) return 0;
  VOX_TRY(const DagView* const view, volume.store().dag(volume.container(), volume.params()));
  uint64_t voxels = 0;
  VOX_CHECK(sound_walk(volume, *view, part, leaf_height, [&](const WalkedCell& cell) -> Status {
    const uint64_t inside = view->leaf(cell.pointer) & leaf_within(cell.corner, part);
    voxels += static_cast<uint64_t>(std::popcount(inside));
    return {};
  }));
  return voxels;
}

}  // namespace voxkit::color
