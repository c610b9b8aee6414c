// The voxels of samples from an uncompressed volume, on the host or a device.
#pragma once

#include "librender/dvr/dvr_packet.h"

namespace voxkit::render {

/// Voxels as they are in memory, all of them within 2^31 voxels, at least two along each axis, with
/// DenseView's read_slack.
template <class T>
class DenseSampler {
 public:
  VOX_HD DenseSampler(const std::byte* voxels, const int64_t (&dims)[3])
      : voxels_(reinterpret_cast<const T*>(voxels)),
        row_(static_cast<int32_t>(dims[0])),
        slice_(static_cast<int32_t>(dims[0] * dims[1])) {}
  VOX_HD_HOT void begin() {}
  VOX_HD_HOT static uint32_t decoded() { return 0; }

  /// The corners of each lane's cell, where the lane is wanted.
  template <class Lanes>
  VOX_HD_HOT void fetch(const DvrPlaces<Lanes>& p, const typename Lanes::Mask& wanted,
                        typename Lanes::Real (&v)[8]) const {
    const typename Lanes::Int at = (p.cell[2] * slice_ + p.cell[1] * row_) + p.cell[0];
    Lanes::gather_pair(voxels_, at, wanted, v[0], v[1]);
    Lanes::gather_pair(voxels_ + row_, at, wanted, v[2], v[3]);
    Lanes::gather_pair(voxels_ + slice_, at, wanted, v[4], v[5]);
    Lanes::gather_pair(voxels_ + (row_ + slice_), at, wanted, v[6], v[7]);
  }

 private:
  const T* voxels_;
  int32_t row_, slice_;
};

}  // namespace voxkit::render
