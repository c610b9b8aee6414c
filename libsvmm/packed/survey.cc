#include "libsvmm/packed/survey.h"

#include <algorithm>
#include <cmath>

#include "libsvmm/packed/value_map.h"

namespace voxkit::svmm {
namespace {

template <class T>
void mark(ConstVoxelSpan voxels, Index3 size, std::atomic<uint8_t>* seen) {
  for (int64_t z = 0; z < size.z; ++z)
    for (int64_t y = 0; y < size.y; ++y) {
      const auto* const row = reinterpret_cast<const T*>(voxels.row(y, z));
      for (int64_t x = 0; x < size.x; ++x)
        if (std::atomic<uint8_t>& mark = seen[row[x]]; mark.load(std::memory_order_relaxed) == 0)
          mark.store(1, std::memory_order_relaxed);
    }
}

/// As many as a palette of a model may have.
constexpr size_t most_floats = size_t{1} << 18;

/// Codes of the floats, up to more than `most_floats`.
std::unordered_set<uint32_t> codes_of(ConstVoxelSpan voxels, Index3 size) {
  std::unordered_set<uint32_t> codes;
  uint32_t before = 0;
  bool any = false;
  for (int64_t z = 0; z < size.z; ++z)
    for (int64_t y = 0; y < size.y; ++y) {
      const auto* const row = reinterpret_cast<const float*>(voxels.row(y, z));
      for (int64_t x = 0; x < size.x; ++x) {
        const uint32_t code = ValueMap::ordered(row[x]);
        if (any && code == before) continue;
        codes.insert(before = code);
        any = true;
      }
      if (codes.size() > most_floats) return codes;
    }
  return codes;
}

ValueRange range_of(ConstVoxelSpan voxels, Index3 size, std::atomic<bool>& infinite) {
  float lo = INFINITY, hi = -INFINITY;
  for (int64_t z = 0; z < size.z; ++z)
    for (int64_t y = 0; y < size.y; ++y) {
      const auto* const row = reinterpret_cast<const float*>(voxels.row(y, z));
      for (int64_t x = 0; x < size.x; ++x) {
        const float v = row[x];
        if (!std::isfinite(v)) {
          infinite = true;
          continue;
        }
        lo = std::min(lo, v), hi = std::max(hi, v);
      }
    }
  return lo <= hi ? ValueRange{static_cast<double>(lo), static_cast<double>(hi)} : ValueRange{1, 0};
}

}  // namespace

Survey::Survey(VoxelFormat format) : format_(format) {
  if (format == VoxelFormat::float32) return;
  values_ = size_t{1} << 8 * voxel_bytes(format);
  seen_ = std::make_unique<std::atomic<uint8_t>[]>(values_);
}

void Survey::look(ConstVoxelSpan voxels, Index3 size) {
  if (format_ != VoxelFormat::float32) {
    if (format_ == VoxelFormat::density16)
      mark<uint16_t>(voxels, size, seen_.get());
    else
      mark<uint8_t>(voxels, size, seen_.get());
    return;
  }
  if (!many_floats_) {
    const auto codes = codes_of(voxels, size);
    const std::lock_guard lock(mutex_);
    if (!many_floats_)
      floats_.insert(codes.begin(), codes.end());  // another thread may have found many since
    if (floats_.size() > most_floats) {
      many_floats_ = true;
      floats_.clear();
    }
  }
  const ValueRange found = range_of(voxels, size, infinite_);
  if (found.lo > found.hi) return;
  const std::lock_guard lock(mutex_);
  range_ = range_.lo <= range_.hi ? ValueRange{std::min(range_.lo, found.lo), std::max(range_.hi, found.hi)}
                                  : found;
}

std::vector<uint32_t> Survey::values() const {
  std::vector<uint32_t> values(floats_.begin(), floats_.end());
  std::sort(values.begin(), values.end());
  for (size_t i = 0; i < values_; ++i)
    if (seen_[i]) values.push_back(static_cast<uint32_t>(i));
  return values;
}

}  // namespace voxkit::svmm
