// Decoded pages that were used lately.
#pragma once

#include <array>
#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "formats/context.h"

namespace voxkit::svmm {

/// Keeps decoded pages within a share of a memory limit. The oldest goes first, unless it was used since it
/// came or was last spared, which costs a use nothing. Thread-safe.
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
  struct Hash {
    size_t operator()(const Key& key) const {
      return static_cast<size_t>((key.number * 0x9E3779B97F4A7C15u) ^ static_cast<uint64_t>(key.level) << 57);
    }
  };
  struct Entry {
    Key key;
    std::shared_ptr<const Page> page;
    bool used;
  };
  /// Threads that ask for different pages seldom wait for each other.
  struct Shard {
    std::mutex mutex;
    std::list<Entry> entries;  ///< the youngest first
    std::unordered_map<Key, std::list<Entry>::iterator, Hash> places;
    uint64_t bytes = 0;
  };
  static constexpr size_t shard_count = 16;
  Shard& shard_of(const Key& key) { return shards_[Hash()(key) >> 40 & (shard_count - 1)]; }
  /// The oldest that was not used.
  void drop_last(Shard& shard);

  MemoryBudget& memory_;
  uint64_t shard_limit_;
  std::array<Shard, shard_count> shards_;
};

}  // namespace voxkit::svmm
