// The voxels of samples from decoded bricks, on the host.
#pragma once

#include "librender/dvr/brick_cache.h"
#include "librender/dvr/dvr_packet.h"

namespace voxkit::render {

/// Voxels of decoded bricks, for packets of the host.
template <class T>
class BrickSampler {
 public:
  explicit BrickSampler(BrickCache<T>& cache) : cache_(cache) {}
  /// A packet begins: no lane holds a brick.
  VOX_HD_HOT void begin() { held_ = place_ = PortableLanes::all(-1); }

  template <class Lanes>
  VOX_HD_HOT void fetch(const DvrPlaces<Lanes>& p, const Ints& wanted, Floats (&v)[8]) {
    const unsigned moved = Lanes::bits((p.place != place_) & wanted);
    if (moved != 0) hold(moved, p.brick, p.place);
    const auto within = [&](int a) { return p.cell[a] & (dvr_brick - 1); };
    constexpr int row = slot_edge, slice = slot_edge * slot_edge;
    const Ints at = held_ * slot_values + (within(2) * slice + (within(1) * row + within(0)));
    const T* const values = cache_.values();
    Lanes::gather_pair(values, at, wanted, v[0], v[1]);
    Lanes::gather_pair(values + row, at, wanted, v[2], v[3]);
    Lanes::gather_pair(values + slice, at, wanted, v[4], v[5]);
    Lanes::gather_pair(values + (row + slice), at, wanted, v[6], v[7]);
  }

 private:
  void hold(unsigned moved, const Ints (&brick)[3], const Ints& place) {
    for (; moved != 0; moved &= moved - 1) {
      const int lane = __builtin_ctz(moved);
      // Often the lane before has come to the same brick.
      int same = -1;
      for (int i = 0; i < PortableLanes::count; ++i)
        if (place_[i] == place[lane] && held_[i] >= 0) same = i;
      held_[lane] = same >= 0 ? held_[same]
                              : cache_.find(place[lane], static_cast<uint32_t>(brick[0][lane]),
                                            static_cast<uint32_t>(brick[1][lane]),
                                            static_cast<uint32_t>(brick[2][lane]), lane, held_);
      place_[lane] = place[lane];
    }
  }
  BrickCache<T>& cache_;
  Ints held_ = PortableLanes::all(-1), place_ = PortableLanes::all(-1);
};

}  // namespace voxkit::render
