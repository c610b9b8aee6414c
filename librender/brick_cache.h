// Decoded bricks near at hand: what a thread has of a compressed volume.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "formats/hd.h"
#include "librender/dvr_lanes.h"
#include "librender/grid.h"
#include "libsvmm/svmm.h"
#include "libvq/vq.h"

namespace voxkit::render {

/// A brick and the voxels one further on, 5^3 values x fastest, so that all cells that begin in it are there.
inline constexpr int slot_edge = 5, slot_values = 128;

/// Makes them, for one thread. T is uint16_t for integers and float.
template <class T>
class BrickReader {
 public:
  virtual ~BrickReader() = default;
  /// The values of the brick at a place, each clamped to the volume's edges. Where a file is damaged they
  /// mean nothing, and the volume's store has the error.
  virtual void read(uint32_t x, uint32_t y, uint32_t z, T* values) = 0;
  /// Forgets what it remembers.
  virtual void forget() {}
  /// Bricks decoded so far.
  uint64_t decoded() const { return decoded_; }

 protected:
  uint64_t decoded_ = 0;
};

template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const DenseGrid> grid);
template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const svmm::Volume> volume);
/// Remembers decoded bricks by their id, so that equal ones are decoded once.
template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const vq::Volume> volume);

/// Direct-mapped by the brick's place.
template <class T>
class BrickCache {
 public:
  explicit BrickCache(std::unique_ptr<BrickReader<T>> reader)
      : reader_(std::move(reader)),
        values_(static_cast<size_t>((slots + PortableLanes::count) * slot_values)),
        places_(slots, -1) {}
  const T* values() const { return values_.data(); }
  const BrickReader<T>& reader() const { return *reader_; }
  /// Forgets everything.
  void forget() {
    std::fill(places_.begin(), places_.end(), -1);
    reader_->forget();
  }
  /// The slot of the brick (x, y, z), whose number is `place`. `held`: the slots of all lanes; these stay.
  int32_t find(int32_t place, uint32_t x, uint32_t y, uint32_t z, int lane, const Ints& held) {
    const auto slot = static_cast<int32_t>(static_cast<uint32_t>(place) * 2654435761u >> (32 - log2_slots));
    if (places_[static_cast<size_t>(slot)] == place) return slot;
    for (int i = 0; i < PortableLanes::count; ++i)
      if (i != lane && held[i] == slot) {  // this lane has a slot of its own
        reader_->read(x, y, z, at(slots + lane));
        return slots + lane;
      }
    reader_->read(x, y, z, at(slot));
    places_[static_cast<size_t>(slot)] = place;
    return slot;
  }

 private:
  static constexpr int log2_slots = 12, slots = 1 << log2_slots;
  T* at(int32_t slot) { return values_.data() + int64_t{slot} * slot_values; }
  std::unique_ptr<BrickReader<T>> reader_;
  std::vector<T> values_;
  std::vector<int32_t> places_;
};

}  // namespace voxkit::render
