// What a ray found, and what it sees in a voxel.
#pragma once

#include <cstdint>

#include "formats/volume.h"

namespace voxkit::render {

/// What a ray found.
struct Pixel {
  float color[4] = {};                ///< R, G, B times opacity, and opacity; 0..1
  float distance = __builtin_inff();  ///< from the eye to the first voxel that is not void, world units
};
/// More about it.
struct PixelDetail {
  int32_t voxel[3] = {-1, -1, -1};  ///< the first that is not void; of a coarser cell the one entered
  uint32_t cells = 0;               ///< cells looked at
};
/// What the first voxel that is not void has beside its colour, as far as it is known.
struct PixelTraits {
  float emissive[3] = {};  ///< light, as a display shows it; of all that the ray came through, times opacity
  float opacity = 0;
  float normal[3] = {};  ///< a unit vector in the world; 0: there is none
  float rm[2] = {};      ///< roughness and metalness, 0..1
  uint32_t id = 0;
};
/// A cell that a ray sees, where it may see several: of surfaces with levels of detail.
struct Glimpse {
  int32_t voxel[3];  ///< one of it
  int16_t log2_edge;
  int16_t ninths;  ///< of the pixel, that it hides; 0: there are no more of them
};
/// What it cost, beside its cells: blocks entered, bytes of links and values looked at.
struct PixelCost {
  uint32_t blocks, bytes;
};

struct Color {
  float rgb[3], alpha;
};

/// The colour and opacity of a voxel. RGBA32: its own. RGB24: opaque, black is void. Scalars: d from 0 to 1
/// over a range, the colour being (d, d, d) and the opacity d (thesis section 4.1); NaN is void.
class ColorOf {
 public:
  /// `range`: stored values of a scalar volume; BITMAP: 0 and 1, whatever it says.
  VOX_HD_HOT ColorOf(VoxelFormat format, const ValueRange& range)
      : format_(format),
        lo_(format == VoxelFormat::bitmap ? 0 : range.lo),
        scale_(format == VoxelFormat::bitmap ? 1
               : range.hi > range.lo         ? 1 / (range.hi - range.lo)
                                             : 0),
        void_shift_(format == VoxelFormat::rgba32 ? 24 : 0),
        void_most_(0) {
    // Of integers those up to lo are void: all or none where that is beyond them.
    if (!is_color(format))
      void_most_ = scale_ <= 0 || lo_ >= 65535 ? 65535 : lo_ < 0 ? -1 : static_cast<int64_t>(lo_);
  }

  VOX_HD_HOT Color operator()(const Voxel& v) const {
    const auto byte = [bits = v.as<uint32_t>()](int k) {
      return static_cast<float>(static_cast<double>(bits >> (8 * k) & 255u) * (1.0 / 255));
    };
    switch (format_) {
      case VoxelFormat::rgba32:
        return {{byte(0), byte(1), byte(2)}, byte(3)};
      case VoxelFormat::rgb24:
        return {{byte(0), byte(1), byte(2)}, v.as<uint32_t>() == 0 ? 0.0f : 1.0f};
      case VoxelFormat::float32:
        return grey(static_cast<double>(v.as<float>()));
      default:
        return grey(static_cast<double>(v.as<uint32_t>()));
    }
  }
  /// Whether a voxel is void, which costs less than its colour.
  VOX_HD_HOT bool is_void(const Voxel& v) const {
    if (format_ == VoxelFormat::float32) return !(scale_ > 0 && static_cast<double>(v.as<float>()) > lo_);
    return v.as<uint32_t>() >> void_shift_ <= void_most_;
  }

 private:
  VOX_HD_HOT Color grey(double value) const {
    const double x = (value - lo_) * scale_;
    const float d = static_cast<float>(x > 0 ? (x < 1 ? x : 1) : 0);
    return {{d, d, d}, d};
  }
  VoxelFormat format_;
  double lo_, scale_;
  int void_shift_;     ///< to what tells, of the bits of a voxel
  int64_t void_most_;  ///< greatest that is void
};

}  // namespace voxkit::render
