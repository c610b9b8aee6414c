// Walking through whole volumes with little memory: slab by slab, tile by tile, passing over what is known.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "formats/reservation.h"
#include "formats/source.h"

namespace voxkit {

/// The order in which a large box is walked: slabs in z, each of tiles. It depends on nothing but the box,
/// the bytes of a voxel and the memory limit, so results that are merged in this order are the same for any
/// number of threads.
class Slabs {
 public:
  /// Slabs of `box` that take up to `target` bytes, and at least one slice, where a voxel takes
  /// `bytes_per_voxel`. They end at multiples of 32 voxels, or where a slice is large, of a smaller power of
  /// two.
  Slabs(const Box& box, int bytes_per_voxel, uint64_t target);

  int64_t count() const;
  Box slab(int64_t index) const;
  /// Bytes that hold the largest slab.
  uint64_t bytes() const { return bytes_; }

  /// Tiles of a slab: up to 512 x 64 x 32 voxels, ordered by z, then y, then x.
  static int64_t tiles(const Box& slab);
  static Box tile(const Box& slab, int64_t index);

 private:
  Box box_;
  int64_t thickness_ = 1;
  uint64_t bytes_ = 0;
};

/// Slabs of this size keep a walk fast; less where --max-memory is small.
uint64_t slab_target(const Context& ctx);

/// Memory that counts against ctx.memory while it lives.
class Buffer {
 public:
  /// Fails with ErrorCode::limit, naming `what`.
  static Result<std::unique_ptr<Buffer>> allocate(uint64_t bytes, const std::string& what, Context& ctx);
  std::byte* data() const { return data_.get(); }

 private:
  explicit Buffer(Reservation reservation) : reservation_(std::move(reservation)) {}
  Reservation reservation_;
  std::unique_ptr<std::byte[]> data_;
};

/// Splits a tile into what `known` deals with (it returns true where it needs no voxels, for the whole tile
/// or for cubes of 32 voxels) and what has to be read, in boxes as wide as possible.
Status walk_tile(const Box& tile, const std::function<bool(const Box&)>& known,
                 const std::function<Status(const Box&)>& read);

/// Reads a slab (full width and height where the source is forward-only) on ctx.threads threads; uniform
/// boxes are filled without being read.
Status read_slab(VolumeSource& source, const Box& slab, VoxelSpan out, Context& ctx);

/// Copies `box` of a source to a sink whose volume has the size of the box; the caller finishes the sink. One
/// slab is written while the next is read. `box` must have the source's width and height where that is
/// forward-only.
Status copy_volume(VolumeSource& source, const Box& box, VolumeSink& sink, Context& ctx);

/// Calls `visit` with all voxels, in parts of any shape, from any of ctx.threads threads; of a part that is
/// known to have one value, with one voxel, which stands for `times` of them. A forward-only source is used
/// up.
using VisitVoxels = std::function<void(ConstVoxelSpan voxels, Index3 size, int64_t times)>;
Status visit_voxels(VolumeSource& source, const VisitVoxels& visit, Context& ctx);

/// The least and greatest stored value of a scalar volume; its fill value, NaN and infinities are not
/// counted, and a volume of nothing else has the range 0..0. A forward-only source is used up.
Result<ValueRange> measure_range(VolumeSource& source, Context& ctx);

}  // namespace voxkit
