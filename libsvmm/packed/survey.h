// What is known of a volume's values before it is encoded.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <unordered_set>
#include <vector>

#include "formats/volume.h"

namespace voxkit::svmm {

/// Looks at all voxels of a scalar volume, in parts, in any order.
class Survey {
 public:
  explicit Survey(VoxelFormat format);
  /// Voxels of a box of that size. Thread-safe.
  void look(ConstVoxelSpan voxels, Index3 size);
  /// The codes of all values there are, ascending: of integers themselves, of floats their bits in order
  /// (ValueMap::ordered). Of floats none where there are more than 262144.
  std::vector<uint32_t> values() const;
  /// Of floats: whether all of them are.
  bool finite() const { return !infinite_; }
  /// Of floats: the least and greatest finite value; 0 to 0 where there is none.
  ValueRange range() const { return range_.lo <= range_.hi ? range_ : ValueRange{}; }

 private:
  VoxelFormat format_;
  std::mutex mutex_;
  std::unique_ptr<std::atomic<uint8_t>[]> seen_;  ///< by value of integers
  size_t values_ = 0;                             ///< that integers may have
  std::unordered_set<uint32_t> floats_;           ///< codes of floats
  std::atomic<bool> many_floats_{false};          ///< more than are counted
  std::atomic<bool> infinite_{false};             ///< there are infinities, or NaN
  ValueRange range_{1, 0};
};

}  // namespace voxkit::svmm
