// Boxes of void that were found, remembered from ray to ray and picture to picture.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>

#include "formats/copy.h"
#include "librender/pixel.h"

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

/// What was learned of a volume's void from earlier pictures.
class LearnedVoid {
 public:
  /// Of pictures that show the same range of values.
  Result<std::shared_ptr<VoidMemo>> memo(const ValueRange& range, Context& ctx) const {
    const std::lock_guard lock(mutex_);
    if (!memo_ || !(memo_->range() == range)) {
      memo_.reset();
      VOX_TRY(memo_, VoidMemo::create(range, ctx));
    }
    return memo_;
  }

 private:
  mutable std::mutex mutex_;
  mutable std::shared_ptr<VoidMemo> memo_;
};

}  // namespace voxkit::render
