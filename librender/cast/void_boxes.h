// Large boxes of void, found once and stepped over by the rays that follow: neighbouring rays cross the same
// holes. For the host; a device searches anew for every ray.
#pragma once

#include "libcolor/dag/void_search.h"
#include "librender/cast/dag_grid.h"
#include "librender/cast/mask_grid.h"
#include "librender/cast/ray_packet.h"
#include "librender/cast/void_memo.h"
#include "libsvmm/every_voxel.h"

namespace voxkit::render {

/// Grows a void box as far as it remains void, to each side in turn by as much as it is wide there.
template <class Every>
VoidBox grow(VoidBox box, const int64_t (&dims)[3], Every& every) {
  // How far it may get: what lies beyond is not void, however much wider the box becomes meanwhile.
  VoidBox limit{
      {}, {static_cast<uint32_t>(dims[0]), static_cast<uint32_t>(dims[1]), static_cast<uint32_t>(dims[2])}};
  for (bool grown = true; grown && every.budget() > 0;) {
    grown = false;
    for (int side = 0; side < 6; ++side) {
      const int a = side / 2;
      const uint32_t lo = box.lo[a], hi = box.hi[a];
      for (;;) {
        VoidBox slab = box;
        if (side % 2 == 0) {
          slab.lo[a] = hi;
          slab.hi[a] = hi + std::min(hi - lo, limit.hi[a] - hi);
        } else {
          slab.hi[a] = lo;
          slab.lo[a] = lo - std::min(hi - lo, lo - limit.lo[a]);
        }
        if (slab.lo[a] == slab.hi[a]) break;
        if (every(slab.lo, slab.hi)) {
          box.lo[a] = std::min(lo, slab.lo[a]);
          box.hi[a] = std::max(hi, slab.hi[a]);
          grown = true;
          break;
        }
        if (!every.found()) return box;
        if (side % 2 == 0)
          limit.hi[a] = static_cast<uint32_t>(std::max<uint64_t>(every.begin(a), hi));
        else
          limit.lo[a] = static_cast<uint32_t>(std::min<uint64_t>(every.end(a), lo));
      }
    }
  }
  return box;
}

/// A cell of one value, or the void box that was made of it.
struct BoxedCell {
  Voxel value;
  VoidBox box;
  bool is_void;
  Color color;  ///< unless it is void
  [[gnu::always_inline]] bool leave(GridRay& ray) const { return ray.leave(box.lo, box.hi); }
  [[gnu::always_inline]] bool holds(const uint32_t (&v)[3], int) const {
    return ((v[0] - box.lo[0] < box.hi[0] - box.lo[0]) & (v[1] - box.lo[1] < box.hi[1] - box.lo[1]) &
            (v[2] - box.lo[2] < box.hi[2] - box.lo[2])) != 0;
  }
  /// Whether it is void to all rays that come there.
  [[gnu::always_inline]] bool is_void_to_all() const { return is_void; }
};
/// The same with levels of detail. A ray for which coarser cells are fine enough may see a voxel beside a
/// void cell in the cell around both.
struct LevelCell : BoxedCell {
  int level;       ///< void: the greatest `finest` that it is void to; else the one that it is there for
  bool grown;      ///< a void box that is void to all
  uint64_t parts;  ///< of one that is not void, nor a voxel
  [[gnu::always_inline]] bool holds(const uint32_t (&v)[3], int finest) const {
    return BoxedCell::holds(v, finest) && (is_void ? finest <= level : finest == level);
  }
  [[gnu::always_inline]] bool is_void_to_all() const { return is_void && grown; }
};

/// SVMM files as what boxes are grown in.
struct SvmmSpace {
  struct IsVoid {
    const ColorOf* color_of;
    bool operator()(const Voxel& value) const { return color_of->is_void(value); }
  };
  const svmm::View* view;
  const svmm::MappedPools* pools;
  IsVoid is_void;

  using Walk = SvmmView<svmm::MappedPools, Search::path>::Cursor;
  Walk walk() const { return SvmmView<svmm::MappedPools, Search::path>{view, pools}.cursor(); }
  /// Asks whether boxes are void, as long as that pays.
  auto search() const { return svmm::EveryVoxel(*view, *pools, is_void, 4096); }
};
/// Surfaces as DAGs as that.
struct DagSpace {
  DagCastView<Search::path> view;

  using Walk = DagCastView<Search::path>::Cursor;
  Walk walk() const { return view.cursor(); }
  auto search() const { return color::VoidSearch(*view.dag, 1024); }
};

/// Packed volumes of colours as that.
struct MaskSpace {
  MaskCastView<Search::path> view;

  using Walk = MaskCastView<Search::path>::Cursor;
  Walk walk() const { return view.cursor(); }
  auto search() const { return MaskVoidSearch(*view.tree, 1024); }
};

/// A compressed volume on the host, searched along a path from the root; with all detail, or of surfaces with
/// levels of it.
template <class Space, bool levels = false>
struct BoxedView {
  Space space;
  const CastParams* params;
  VoidMemo* memo;
  int least_log2;  ///< cells smaller than that are not worth growing

  class Cursor {
   public:
    explicit Cursor(const BoxedView& volume) : volume_(volume), walk_(volume.space.walk()) {}
    using Boxed = std::conditional_t<levels, LevelCell, BoxedCell>;
    [[gnu::always_inline]] const Boxed& locate(uint32_t x, uint32_t y, uint32_t z, int finest) {
      const uint32_t v[3] = {x, y, z};
      const int shift = levels && finest > 0 ? finest : 0;
      Boxed& known = recent_[((x >> shift) + (y >> shift) * 11 + (z >> shift) * 57) % remembered];
      if (known.holds(v, finest)) return known;
      const Cell cell = walk_.locate(x, y, z, levels ? finest : -1);
      known.value = cell.value;
      for (int a = 0; a < 3; ++a) {
        known.box.lo[a] = v[a] >> cell.log2_edge << cell.log2_edge;
        known.box.hi[a] = static_cast<uint32_t>(
            std::min(int64_t{known.box.lo[a]} + (int64_t{1} << cell.log2_edge), volume_.params->dims[a]));
      }
      const ColorOf& color_of = volume_.params->color_of;
      known.is_void = color_of.is_void(cell.value);
      if constexpr (levels) {
        known.level = known.is_void ? cell.log2_edge : finest;
        known.grown = false;
        if (!known.is_void && cell.log2_edge > 0) known.parts = walk_.parts(cell);
      }
      if (!known.is_void)
        known.color = color_of(cell.value);
      else if (cell.log2_edge >= volume_.least_log2)
        grow_cell(cell.log2_edge, known);
      return known;
    }
    uint64_t parts(const LevelCell& cell) const requires levels { return cell.parts; }
    uint32_t blocks() const { return walk_.blocks(); }
    uint32_t bytes() const { return walk_.bytes(); }

   private:
    /// Makes a void cell a box.
    [[gnu::noinline]] void grow_cell(int log2_edge, Boxed& known) {
      const VoidBox cell = known.box;
      const VoidMemo::Key key{{cell.lo[0], cell.lo[1], cell.lo[2]}, log2_edge};
      if (!volume_.memo->find(key, known.box)) {
        auto search = volume_.space.search();
        known.box = grow(known.box, volume_.params->dims, search);
        volume_.memo->insert(key, known.box);
      }
      if constexpr (levels) {
        known.grown = cut(volume_.params->coarsest, cell, known.box);
        if (known.grown)
          known.level = 64;
        else
          known.box = cell;
      }
    }
    /// Cuts a box to whole cells of edge 2^log2_edge. Whether these are around a cell.
    bool cut(int log2_edge, const VoidBox& cell, VoidBox& box) const {
      const uint64_t within = (uint64_t{1} << log2_edge) - 1;
      bool around = true;
      for (int a = 0; a < 3; ++a) {
        const uint64_t lo = (box.lo[a] + within) & ~within;
        const uint64_t hi = box.hi[a] == volume_.params->dims[a] ? box.hi[a] : box.hi[a] & ~within;
        around &= lo <= cell.lo[a] && hi >= cell.hi[a];
        box.lo[a] = static_cast<uint32_t>(lo);
        box.hi[a] = static_cast<uint32_t>(hi);
      }
      return around;
    }

    const BoxedView& volume_;
    typename Space::Walk walk_;
    static constexpr uint32_t remembered = 128;
    Boxed recent_[remembered] = {};  ///< cells of neighbouring voxels, which neighbouring rays meet
  };
  Cursor cursor() const { return Cursor(*this); }
};

/// The void boxes that a packet of rays came through, which are most likely those of the packet beside it.
/// All of these rays are mirrored alike.
class VoidTrail {
 public:
  /// Moves rays through them, and forgets those in which no ray was.
  template <class Rays>
  [[gnu::always_inline]] void follow(Rays& rays) {
    int kept = 0;
    for (int i = 0; i < count_; ++i)
      if (rays.leave(boxes_[i])) boxes_[kept++] = boxes_[i];
    count_ = kept;
  }
  [[gnu::always_inline]] void add(const Mirror::Box& box) {
    if (count_ < most) boxes_[count_++] = box;
  }

 private:
  static constexpr int most = 32;
  Mirror::Box boxes_[most];
  int count_ = 0;
};

}  // namespace voxkit::render
