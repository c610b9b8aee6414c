// Large boxes of void, found once and stepped over by the rays that follow: neighbouring rays cross the same
// holes. For the host; a device searches anew for every ray.
#pragma once

#include <atomic>
#include <memory>

#include "librender/ray_packet.h"
#include "libsvmm/every_voxel.h"

namespace voxkit::render {

/// A box of voxels lo <= v < hi.
struct VoidBox {
  uint32_t lo[3], hi[3];
};

/// Void boxes by the cell that they were grown from, for all threads that draw a volume. The box of a cell
/// depends on nothing else, so what is remembered from other rays and other pictures changes no result.
class VoidMemo {
 public:
  /// What is void depends on `range`. 12 MB, which count against ctx.memory as long as it lives.
  static Result<std::shared_ptr<VoidMemo>> create(const ValueRange& range, Context& ctx) {
    VOX_TRY(std::unique_ptr<Buffer> buffer, Buffer::allocate(size * sizeof(Slot), "a memo of void", ctx));
    return std::shared_ptr<VoidMemo>(new VoidMemo(range, std::move(buffer)));
  }
  const ValueRange& range() const { return range_; }

  /// A cell: its lo corner and log2 of its edge.
  struct Key {
    uint32_t corner[3];
    int log2_edge;
  };
  /// Whether the box of a cell is known. Reads only, so that threads do not take the slot from each other's
  /// caches: a slot that is written meanwhile has another version afterwards.
  bool find(const Key& key, VoidBox& box) const {
    const Slot& slot = slots_[hash(key)];
    const uint32_t version = slot.version.load(std::memory_order_acquire);
    bool found = version % 2 == 0 &&
                 slot.log2_edge.load(std::memory_order_acquire) == static_cast<uint32_t>(key.log2_edge + 1);
    VoidBox there;
    for (int a = 0; a < 3; ++a) {
      found &= slot.corner[a].load(std::memory_order_acquire) == key.corner[a];
      there.lo[a] = slot.lo[a].load(std::memory_order_acquire);
      there.hi[a] = slot.hi[a].load(std::memory_order_acquire);
    }
    if (!found || slot.version.load(std::memory_order_relaxed) != version) return false;
    box = there;
    return true;
  }
  /// Takes the place of another. Does nothing where someone else is at it.
  void insert(const Key& key, const VoidBox& box) {
    Slot& slot = slots_[hash(key)];
    uint32_t version = slot.version.load(std::memory_order_relaxed);
    if (version % 2 != 0 || !slot.version.compare_exchange_strong(version, version + 1)) return;
    slot.log2_edge.store(static_cast<uint32_t>(key.log2_edge + 1), std::memory_order_release);
    for (int a = 0; a < 3; ++a) {
      slot.corner[a].store(key.corner[a], std::memory_order_release);
      slot.lo[a].store(box.lo[a], std::memory_order_release);
      slot.hi[a].store(box.hi[a], std::memory_order_release);
    }
    slot.version.store(version + 2, std::memory_order_release);
  }

 private:
  struct Slot {
    std::atomic<uint32_t> version{0};    ///< odd while it is written
    std::atomic<uint32_t> log2_edge{0};  ///< and 1; 0: empty
    std::atomic<uint32_t> corner[3]{}, lo[3]{}, hi[3]{};
  };
  static constexpr int log2_size = 18;
  static constexpr size_t size = size_t{1} << log2_size;
  static size_t hash(const Key& key) {
    const uint64_t mixed =
        key.corner[0] * uint64_t{0x9e3779b97f4a7c15} ^ key.corner[1] * uint64_t{0xc2b2ae3d27d4eb4f} ^
        key.corner[2] * uint64_t{0x165667b19e3779f9} ^ static_cast<uint64_t>(key.log2_edge) << 59;
    return (mixed * uint64_t{0x9e3779b97f4a7c15}) >> (64 - log2_size);
  }
  VoidMemo(const ValueRange& range, std::unique_ptr<Buffer> buffer)
      : range_(range), buffer_(std::move(buffer)), slots_(reinterpret_cast<Slot*>(buffer_->data())) {
    std::uninitialized_value_construct_n(slots_, size);
  }
  ValueRange range_;
  std::unique_ptr<Buffer> buffer_;
  Slot* slots_;
};

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
  Colour colour;  ///< unless it is void
  [[gnu::always_inline]] bool leave(GridRay& ray) const { return ray.leave(box.lo, box.hi); }
  [[gnu::always_inline]] bool holds(const uint32_t (&v)[3]) const {
    return ((v[0] - box.lo[0] < box.hi[0] - box.lo[0]) & (v[1] - box.lo[1] < box.hi[1] - box.lo[1]) &
            (v[2] - box.lo[2] < box.hi[2] - box.lo[2])) != 0;
  }
};

/// A compressed volume on the host, searched along the path of blocks, with all detail.
struct BoxedSvmmView {
  const svmm::View* view;
  const svmm::MappedPools* pools;
  const CastParams* params;
  VoidMemo* memo;
  int least_log2;  ///< cells smaller than that are not worth growing

  class Cursor {
   public:
    explicit Cursor(const BoxedSvmmView& volume) : volume_(volume), walk_(*volume.view, *volume.pools) {}
    [[gnu::always_inline]] const BoxedCell& locate(uint32_t x, uint32_t y, uint32_t z, int) {
      const uint32_t v[3] = {x, y, z};
      BoxedCell& known = recent_[(x + y * 11 + z * 57) % remembered];
      if (known.holds(v)) return known;
      const auto cell = walk_.locate(x, y, z, -1);
      known.value = cell.value;
      for (int a = 0; a < 3; ++a) {
        known.box.lo[a] = v[a] >> cell.log2_edge << cell.log2_edge;
        known.box.hi[a] = static_cast<uint32_t>(
            std::min(int64_t{known.box.lo[a]} + (int64_t{1} << cell.log2_edge), volume_.params->dims[a]));
      }
      const ColourOf& colour_of = volume_.params->colour_of;
      known.is_void = colour_of.is_void(cell.value);
      if (!known.is_void)
        known.colour = colour_of(cell.value);
      else if (cell.log2_edge >= volume_.least_log2)
        grow_cell(cell.log2_edge, known);
      return known;
    }
    uint32_t blocks() const { return walk_.blocks_entered(); }
    uint32_t bytes() const { return walk_.bytes_read(); }

   private:
    /// Makes a void cell a box.
    [[gnu::noinline]] void grow_cell(int log2_edge, BoxedCell& known) {
      const VoidMemo::Key key{{known.box.lo[0], known.box.lo[1], known.box.lo[2]}, log2_edge};
      if (volume_.memo->find(key, known.box)) return;
      const auto is_void = [this](const Voxel& value) { return volume_.params->colour_of.is_void(value); };
      svmm::EveryVoxel every(*volume_.view, *volume_.pools, is_void, 4096);
      known.box = grow(known.box, volume_.params->dims, every);
      volume_.memo->insert(key, known.box);
    }

    const BoxedSvmmView& volume_;
    svmm::Walk<svmm::MappedPools> walk_;
    static constexpr uint32_t remembered = 128;
    BoxedCell recent_[remembered] = {};  ///< cells of neighbouring voxels, which neighbouring rays meet
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
