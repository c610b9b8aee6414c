// Decoded pages that were used lately.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "formats/context.h"

namespace voxkit::svmm {

/// Keeps decoded pages within a share of a memory limit. Pages take turns to go, and one that was used since
/// its last turn is spared (second chance), which costs a use nothing. Thread-safe.
class PageCache {
 public:
  using Page = std::vector<std::byte>;
  struct Key {
    int level = 0;
    uint64_t number = 0;
    friend bool operator==(const Key&, const Key&) = default;
  };

  /// `memory`, which must outlive it, counts the pages; at most an eighth of it, and at most 256 MiB.
  explicit PageCache(MemoryBudget& memory);
  ~PageCache();
  /// Null where it is not kept.
  std::shared_ptr<const Page> find(const Key& key);
  /// Keeps a page, where there is memory for it.
  void keep(const Key& key, std::shared_ptr<const Page> page);

 private:
  /// With nothing to follow on the way to a page.
  struct Slot {
    Key key;
    std::shared_ptr<const Page> page;  ///< null: the slot is free
    bool used = false;
  };
  /// Threads that ask for different pages seldom wait for each other. A table with linear probing, of which
  /// at least half is free.
  struct Shard {
    std::mutex mutex;
    std::vector<Slot> slots;
    size_t count = 0, turn = 0;
    uint64_t bytes = 0;

    /// The slot that has the key, or the free one where it would be.
    size_t place_of(const Key& key) const;
    void grow();
    /// Frees a slot, and moves those behind it that it kept from their places.
    void free(size_t at);
  };
  static constexpr size_t shard_count = 16;
  static uint64_t hash(const Key& key) {
    return (key.number ^ static_cast<uint64_t>(key.level) << 57) * 0x9E3779B97F4A7C15u;
  }
  Shard& shard_of(const Key& key) { return shards_[hash(key) >> 60]; }
  /// Of a shard that has some.
  void drop_one(Shard& shard);

  MemoryBudget& memory_;
  uint64_t shard_limit_;
  std::array<Shard, shard_count> shards_;
};

}  // namespace voxkit::svmm
