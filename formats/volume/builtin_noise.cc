// White noise: one hash for eight voxels.
#include <algorithm>
#include <cstdint>

#include "formats/hash.h"
#include "formats/volume/builtin.h"

namespace voxkit {
namespace {

class NoiseSource final : public VolumeSource {
 public:
  NoiseSource(int64_t side, uint64_t seed) : key_(mix64(seed)) {
    info_.dims = Index3(side);
    info_.format = VoxelFormat::density8;
  }

  Status read(const Box& box, VoxelSpan out) override {
    const int64_t side = info_.dims.x;
    for (int64_t z = box.lo.z; z < box.hi.z; ++z) {
      for (int64_t y = box.lo.y; y < box.hi.y; ++y) {
        const int64_t start = (z * side + y) * side;
        write_run(start + box.lo.x, start + box.hi.x, out.row(y - box.lo.y, z - box.lo.z));
      }
    }
    return {};
  }

 private:
  /// Voxel i of the volume is byte i % 8 of random number i / 8, least significant first.
  void write_run(int64_t from, int64_t to, std::byte* out) const {
    int64_t i = from;
    const auto bytes = [&](int64_t end) {
      const uint64_t word = random64(key_, static_cast<uint64_t>(i) / 8);
      for (; i < end; ++i) *out++ = static_cast<std::byte>(word >> (8 * (i % 8)));
    };
    if (i % 8 != 0) bytes(std::min(to, (i / 8 + 1) * 8));
    for (; i + 8 <= to; i += 8, out += 8) {
      const uint64_t word = random64(key_, static_cast<uint64_t>(i) / 8);
      for (int k = 0; k < 8; ++k) out[k] = static_cast<std::byte>(word >> (8 * k));
    }
    if (i < to) bytes(to);
  }

  uint64_t key_;
};

}  // namespace

std::unique_ptr<VolumeSource> noise_source(int64_t side, uint64_t seed) {
  return std::make_unique<NoiseSource>(side, seed);
}

}  // namespace voxkit
