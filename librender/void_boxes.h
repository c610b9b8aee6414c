// Large boxes of void, found once and stepped over by the rays that follow: neighbouring rays cross the same
// holes. For the host; a device searches anew for every ray.
#pragma once

#include <atomic>
#include <memory>

#include "librender/cast_kernel.h"
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
  /// What is void depends on `range`.
  explicit VoidMemo(const ValueRange& range) : range_(range), slots_(std::make_unique<Slot[]>(size)) {}
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
    for (int a = 0; a < 3; ++a) {
      found &= slot.corner[a].load(std::memory_order_acquire) == key.corner[a];
      box.lo[a] = slot.lo[a].load(std::memory_order_acquire);
      box.hi[a] = slot.hi[a].load(std::memory_order_acquire);
    }
    return found && slot.version.load(std::memory_order_relaxed) == version;
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
  static constexpr int log2_size = 17;
  static constexpr size_t size = size_t{1} << log2_size;
  static size_t hash(const Key& key) {
    const uint64_t mixed =
        key.corner[0] * uint64_t{0x9e3779b97f4a7c15} ^ key.corner[1] * uint64_t{0xc2b2ae3d27d4eb4f} ^
        key.corner[2] * uint64_t{0x165667b19e3779f9} ^ static_cast<uint64_t>(key.log2_edge) << 59;
    return (mixed * uint64_t{0x9e3779b97f4a7c15}) >> (64 - log2_size);
  }
  ValueRange range_;
  std::unique_ptr<Slot[]> slots_;
};

/// Grows an aligned void cell as far as it remains void, first by as much as it is wide, then by less.
template <class Every>
VoidBox grow(VoidBox box, const int64_t (&dims)[3], Every& every) {
  for (bool grown = true; grown && every.budget() > 0;) {
    grown = false;
    for (int side = 0; side < 6; ++side) {
      const int a = side / 2;
      const bool up = side % 2 == 0;
      for (uint32_t step = box.hi[a] - box.lo[a]; step > 0; step /= 2) {
        VoidBox slab = box;
        const auto room = up ? static_cast<uint32_t>(dims[a]) - box.hi[a] : box.lo[a];
        const uint32_t by = std::min(step, room);
        if (by == 0) break;
        (up ? slab.lo : slab.hi)[a] = up ? box.hi[a] : box.lo[a];
        (up ? slab.hi : slab.lo)[a] = up ? box.hi[a] + by : box.lo[a] - by;
        if (!every(slab.lo, slab.hi)) continue;
        (up ? box.hi : box.lo)[a] = (up ? slab.hi : slab.lo)[a];
        grown = true;
      }
    }
  }
  return box;
}

/// A cell, or the void box that was made of it.
struct BoxedCell {
  Voxel value;
  int log2_edge;
  const VoidBox* box = nullptr;
  [[gnu::always_inline]] bool leave(GridRay& ray) const {
    return log2_edge < 0 ? ray.leave(box->lo, box->hi) : ray.leave(log2_edge);
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
    [[gnu::always_inline]] BoxedCell locate(uint32_t x, uint32_t y, uint32_t z, int) {
      // Most likely the void box that the ray before came to next, or the voxel in which it ended.
      const uint32_t v[3] = {x, y, z};
      if (const Passed& next = trail_[passed_ % remembered]; next.holds(v)) {
        ++passed_;
        return {next.value, -1, &next.box};
      }
      if (last_.holds(v)) return {last_.value, last_.log2_edge, nullptr};
      const auto cell = walk_.locate(x, y, z, -1);
      if (!volume_.params->colour_of.is_void(cell.value)) {
        for (int a = 0; a < 3; ++a) {
          last_.box.lo[a] = v[a] >> cell.log2_edge << cell.log2_edge;
          last_.size[a] = uint32_t{1} << cell.log2_edge;
        }
        last_.value = cell.value;
        last_.log2_edge = cell.log2_edge;
      } else if (cell.log2_edge >= volume_.least_log2) {
        Passed& next = trail_[passed_++ % remembered];
        next.value = cell.value;
        next.box = grown(v, cell.log2_edge);
        for (int a = 0; a < 3; ++a) next.size[a] = next.box.hi[a] - next.box.lo[a];
        return {next.value, -1, &next.box};
      }
      return {cell.value, cell.log2_edge, nullptr};
    }
    /// A new ray.
    void start() { passed_ = 0; }
    uint32_t blocks() const { return walk_.blocks_entered(); }
    uint32_t bytes() const { return walk_.bytes_read(); }

   private:
    /// The void box of the void cell around a voxel.
    [[gnu::noinline]] VoidBox grown(const uint32_t (&v)[3], int log2_edge) {
      VoidMemo::Key key{{}, log2_edge};
      VoidBox box;
      for (int a = 0; a < 3; ++a) key.corner[a] = v[a] >> log2_edge << log2_edge;
      if (volume_.memo->find(key, box)) return box;
      for (int a = 0; a < 3; ++a) {
        box.lo[a] = key.corner[a];
        box.hi[a] = static_cast<uint32_t>(
            std::min(int64_t{box.lo[a]} + (int64_t{1} << log2_edge), volume_.params->dims[a]));
      }
      const auto is_void = [this](const Voxel& value) { return volume_.params->colour_of.is_void(value); };
      svmm::EveryVoxel every(*volume_.view, *volume_.pools, is_void, 4096);
      box = grow(box, volume_.params->dims, every);
      volume_.memo->insert(key, box);
      return box;
    }

    static constexpr unsigned remembered = 32;
    struct Passed {
      VoidBox box{};
      uint32_t size[3] = {};
      Voxel value;
      int log2_edge = 0;
      [[gnu::always_inline]] bool holds(const uint32_t (&v)[3]) const {
        return ((v[0] - box.lo[0] < size[0]) & (v[1] - box.lo[1] < size[1]) & (v[2] - box.lo[2] < size[2])) !=
               0;
      }
    };
    const BoxedSvmmView& volume_;
    svmm::Walk<svmm::MappedPools> walk_;
    Passed trail_[remembered];  ///< what the last rays came to, in the order of the way
    Passed last_;               ///< the last voxel that was not void
    unsigned passed_ = 0;       ///< by this ray
  };
  Cursor cursor() const { return Cursor(*this); }
};

}  // namespace voxkit::render
