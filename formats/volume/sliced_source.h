// A volume whose slices are separate pictures: decoded one by one, the most recent ones kept.
#pragma once

#include <algorithm>
#include <cstring>
#include <list>
#include <memory>
#include <mutex>
#include <vector>

#include "formats/reservation.h"
#include "formats/source.h"

namespace voxkit {

/// Turns "decode these rows of slice z" into random access. Readers of small boxes would decode a slice again
/// and again, so whole slices are kept while the memory budget has room for some; slices too large for that
/// are read by rows.
class SlicedSource : public VolumeSource {
 public:
  Status read(const Box& box, VoxelSpan out) override {
    const int bytes = voxel_bytes(info_.format);
    const int64_t row_bytes = info_.dims.x * bytes;
    for (int64_t z = box.lo.z; z < box.hi.z; ++z) {
      std::vector<std::byte> own;
      std::shared_ptr<const Slice> kept;
      const std::byte* rows = nullptr;
      if (slots_ > 0) {
        VOX_TRY(kept, slice(z));
        rows = kept->voxels.data() + box.lo.y * row_bytes;
      } else {
        own.resize(static_cast<size_t>(box.size().y * row_bytes));
        VOX_CHECK(read_rows(z, box.lo.y, box.hi.y, own.data()));
        rows = own.data();
      }
      for (int64_t y = 0; y < box.size().y; ++y)
        std::memcpy(out.row(y, z - box.lo.z), rows + y * row_bytes + box.lo.x * bytes,
                    static_cast<size_t>(box.size().x * bytes));
    }
    return {};
  }

 protected:
  /// Writes the rows y0 .. y1 (half open) of slice z to `rows`, without gaps. Called from any number of
  /// threads.
  virtual Status read_rows(int64_t z, int64_t y0, int64_t y1, std::byte* rows) = 0;

  /// Once info_ is known: decides how many slices to keep, at most an eighth of the memory budget and 64
  /// slices.
  void keep_slices(Context& ctx) {
    const uint64_t slice_bytes =
        static_cast<uint64_t>(info_.dims.x * info_.dims.y * voxel_bytes(info_.format));
    // A thread may hold a slice that others have already pushed out.
    const uint64_t held = static_cast<uint64_t>(std::max(ctx.threads, 1));
    const uint64_t room = ctx.memory->limit() / 8 / slice_bytes;
    if (room <= held) return;
    const uint64_t slots = std::min({room - held, uint64_t{64}, static_cast<uint64_t>(info_.dims.z)});
    auto memory = Reservation::take((slots + held) * slice_bytes, "keeping slices", ctx);
    if (!memory) return;
    memory_ = std::move(*memory);
    slots_ = slots;
  }

 private:
  struct Slice {
    int64_t z = 0;
    std::mutex decoding;
    bool decoded = false;
    std::vector<std::byte> voxels;
  };

  /// The decoded slice. Threads that want the same one wait for a single decoding; different slices decode
  /// side by side.
  Result<std::shared_ptr<const Slice>> slice(int64_t z) {
    std::shared_ptr<Slice> found;
    {
      std::lock_guard lock(mutex_);
      const auto it = std::find_if(recent_.begin(), recent_.end(), [&](const auto& s) { return s->z == z; });
      if (it != recent_.end()) {
        recent_.splice(recent_.begin(), recent_, it);
      } else {
        recent_.push_front(std::make_shared<Slice>());
        recent_.front()->z = z;
        if (recent_.size() > slots_) recent_.pop_back();
      }
      found = recent_.front();
    }
    std::lock_guard lock(found->decoding);
    if (!found->decoded) {
      found->voxels.resize(static_cast<size_t>(info_.dims.x * info_.dims.y * voxel_bytes(info_.format)));
      VOX_CHECK(read_rows(z, 0, info_.dims.y, found->voxels.data()));
      found->decoded = true;
    }
    return found;
  }

  Reservation memory_;
  uint64_t slots_ = 0;
  std::mutex mutex_;
  std::list<std::shared_ptr<Slice>> recent_;  ///< most recent first
};

}  // namespace voxkit
