// Decoded bricks near at hand: what a thread has of a compressed volume.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

#include "formats/hd.h"
#include "librender/cast/grid.h"
#include "librender/dvr/dvr_lanes.h"
#include "librender/dvr/transfer.h"
#include "libsvmm/packed/packed.h"
#include "libsvmm/svmm.h"
#include "libvq/vq.h"

namespace voxkit::render {

/// A brick and the voxels one further on, 5^3 values x fastest, so that all cells that begin in it are there.
inline constexpr int slot_edge = 5, slot_values = 128;

/// As many decoded bricks of a VQ file a thread remembers.
inline constexpr uint32_t remembered_bricks = 4096;

/// Makes them, for one thread. T is uint16_t for integers and float.
template <class T>
class BrickReader {
 public:
  virtual ~BrickReader() = default;
  /// The values of the brick at a place, each clamped to the volume's edges. Where a file is damaged they
  /// mean nothing, and `status` or the volume's store has the error.
  virtual void read(uint32_t x, uint32_t y, uint32_t z, T* values) = 0;
  /// Forgets what it remembers.
  virtual void forget() {}
  /// Times that a brick was decoded so far.
  uint64_t decoded() const { return decoded_; }
  /// Which bricks were, a bit each, x fastest.
  const std::vector<uint64_t>& places() const { return places_; }
  /// The first error, of files without a store.
  const Status& status() const { return status_; }

 protected:
  /// `bricks`: of the volume.
  explicit BrickReader(Index3 bricks)
      : bricks_(bricks), places_(static_cast<size_t>(bricks.x * bricks.y * bricks.z + 63) / 64) {}
  const Index3& bricks() const { return bricks_; }
  /// A brick is being decoded.
  void count(uint32_t x, uint32_t y, uint32_t z) {
    const auto place = static_cast<uint64_t>((z * bricks_.y + y) * bricks_.x + x);
    places_[place / 64] |= uint64_t{1} << place % 64;
    ++decoded_;
  }
  void fail(Error error) {
    if (status_) status_ = tl::unexpected<Error>(std::move(error));
  }

 private:
  Index3 bricks_;
  Status status_;
  uint64_t decoded_ = 0;
  std::vector<uint64_t> places_;
};

template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const DenseGrid> grid);
template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const svmm::Volume> volume);
/// Remembers decoded bricks by their id, so that equal ones are decoded once. With a transfer function, what
/// it does not show may have other values that it does not show either; so bricks whose ranges say that no
/// cell here shows them need not be decoded. (vq_brick_reader.cc)
template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const vq::Volume> volume,
                                             const TransferFunction* shown);
/// Of scalars, from pages of the finest level that is there. (packed_brick_reader.cc)
template <class T>
std::unique_ptr<BrickReader<T>> brick_reader(std::shared_ptr<const svmm::PackedVolume> volume);

inline Index3 bricks_of(const VolumeInfo& info) {
  return (info.dims + Index3(vq::brick_edge - 1)) / Index3(vq::brick_edge);
}
/// A stored value: integers as they are.
template <class T>
T value_of(const Voxel& voxel) {
  if constexpr (std::is_floating_point_v<T>)
    return voxel.as<float>();
  else
    return static_cast<T>(voxel.as<uint32_t>());
}

/// Direct-mapped by the brick's place.
template <class T>
class BrickCache {
 public:
  explicit BrickCache(std::unique_ptr<BrickReader<T>> reader)
      : reader_(std::move(reader)), values_(values_count), places_(slots, -1) {}
  /// Of memory that it takes, with its reader, for a volume of so many bricks.
  static uint64_t bytes(const Index3& bricks) {
    return values_count * sizeof(T) + slots * sizeof(int32_t) +
           static_cast<uint64_t>(bricks.x * bricks.y * bricks.z) / 8 +
           remembered_bricks * (sizeof(uint64_t) + vq::brick_voxels * sizeof(T));
  }
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
  static constexpr size_t values_count = (slots + PortableLanes::count) * slot_values;
  T* at(int32_t slot) { return values_.data() + int64_t{slot} * slot_values; }
  std::unique_ptr<BrickReader<T>> reader_;
  std::vector<T> values_;
  std::vector<int32_t> places_;
};

}  // namespace voxkit::render
