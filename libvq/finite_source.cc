#include <cmath>

#include "formats/little_endian.h"
#include "libvq/vq.h"

namespace voxkit::vq {
namespace {

class FiniteSource : public VolumeSource {
 public:
  FiniteSource(VolumeSource& source, const ValueRange& range, bool keep_nan)
      : source_(source),
        lo_(static_cast<float>(range.lo)),
        hi_(static_cast<float>(range.hi)),
        keep_nan_(keep_nan) {
    info_ = source.info();
  }
  bool forward_only() const override { return source_.forward_only(); }
  Status read(const Box& box, VoxelSpan out) override {
    VOX_CHECK(source_.read(box, out));
    const Index3 size = box.size();
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y)
        for (int64_t x = 0; x < size.x; ++x) {
          std::byte* const voxel = out.row(y, z) + 4 * x;
          store_le(voxel, finite(load_le<float>(voxel)));
        }
    return {};
  }
  std::optional<Voxel> uniform(const Box& box) const override {
    const auto value = source_.uniform(box);
    return value ? std::optional(Voxel::of(finite(value->as<float>()))) : std::nullopt;
  }
  void expect(int64_t z0, int64_t z1) const override { source_.expect(z0, z1); }
  void release(int64_t z0, int64_t z1) const override { source_.release(z0, z1); }

 private:
  float finite(float v) const {
    return std::isfinite(v) || (keep_nan_ && std::isnan(v)) ? v : v > 0 ? hi_ : lo_;
  }

  VolumeSource& source_;
  float lo_, hi_;
  bool keep_nan_;
};

}  // namespace

std::unique_ptr<VolumeSource> finite_source(VolumeSource& source, const ValueRange& range, bool keep_nan) {
  return std::make_unique<FiniteSource>(source, range, keep_nan);
}

}  // namespace voxkit::vq
