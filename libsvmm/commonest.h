// What stands for a set of labels, which have no average: the commonest of them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace voxkit::svmm {

/// Counts values, by keys that order them. Keeps as much as twice the different ones, and at most what is
/// added.
class Commonest {
 public:
  void clear() {
    counts_.clear();
    most_ = least_room;
  }
  void add(uint32_t key, uint64_t times) {
    if (!counts_.empty() && counts_.back().key == key) {  // labels come in runs
      counts_.back().times += times;
      return;
    }
    counts_.push_back({key, times});
    if (counts_.size() < most_) return;
    join();
    most_ = std::max(least_room, 2 * counts_.size());
  }
  /// The key that was added most often, of several such the least. At least one was added.
  uint32_t key() {
    join();
    return std::max_element(counts_.begin(), counts_.end(),
                            [](const Count& a, const Count& b) { return a.times < b.times; })
        ->key;
  }
  /// Bytes that are kept of so many values, of which so many are different.
  static uint64_t bytes(uint64_t values, uint64_t different) {
    return std::min(values, 2 * std::max<uint64_t>(different, least_room)) * sizeof(Count);
  }

 private:
  struct Count {
    uint32_t key;
    uint64_t times;
  };
  static constexpr size_t least_room = size_t{1} << 12;

  /// One count a key, in their order.
  void join() {
    std::sort(counts_.begin(), counts_.end(), [](const Count& a, const Count& b) { return a.key < b.key; });
    size_t kept = 0;
    for (const Count& count : counts_) {
      if (kept > 0 && counts_[kept - 1].key == count.key)
        counts_[kept - 1].times += count.times;
      else
        counts_[kept++] = count;
    }
    counts_.resize(kept);
  }

  std::vector<Count> counts_;
  size_t most_ = least_room;
};

}  // namespace voxkit::svmm
