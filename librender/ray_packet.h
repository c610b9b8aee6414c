// Rays through neighbouring pixels of a row, side by side in vector registers, as far as they cross the same
// boxes: one box costs all of them hardly more than one. What doubles do not settle is left to each ray
// alone, so that every ray meets the voxels, and the times, that it meets alone.
#pragma once

#include "librender/cast_kernel.h"

namespace voxkit::render {

/// `lanes` doubles (GCC's and Clang's vector extension).
template <int lanes>
struct VectorOf {
  typedef double Real __attribute__((vector_size(lanes * 8)));
};

/// The rays through a block of pixels, of which (x, y) is the first, row by row.
template <int width, int height>
class RayPacket {
  static constexpr int lanes = width * height;
  using Real = typename VectorOf<lanes>::Real;
  using Motion = RayMotion<Real, Real, double>;
  using Lanes = Mask<Real>;

 public:
  [[gnu::always_inline]] RayPacket(const CastParams& params, int x, int y)
      : RayPacket(params, Mirrored(ray_through(params, x, y).direction), x, y) {}

  /// Moves those rays that are in the box lo <= v < hi out of it. False if none is there.
  [[gnu::always_inline]] bool leave(const uint32_t (&lo)[3], const uint32_t (&hi)[3]) {
    Lanes inside = moving_;
    Real plane[3], next[3], when;
    for (int a = 0; a < 3; ++a) {
      const double begin = mirrored_.axis[a] ? side_ - hi[a] : lo[a],
                   beyond = mirrored_.axis[a] ? side_ - lo[a] : hi[a];
      inside &= (rays_.voxel[a] >= begin) & (rays_.voxel[a] < beyond);
      plane[a] = Real{} + beyond;
    }
    if (!any(inside)) return false;
    const Lanes unclear = rays_.cross(plane, true, next, when);
    moving_ &= ~(inside & unclear);  // goes on alone, from where it is
    inside &= ~unclear;
    rays_.t = inside ? when : rays_.t;
    Lanes in_grid = moving_;
    for (int a = 0; a < 3; ++a) {
      rays_.voxel[a] = inside ? next[a] : rays_.voxel[a];
      in_grid &= rays_.voxel[a] < rays_.far[a];
    }
    gone_ |= moving_ & ~in_grid;
    moving_ = in_grid;
    passed_ -= inside;
    return true;
  }

  /// Whether it is known where a ray enters the grid, if it does.
  [[gnu::always_inline]] bool entered(int lane) const { return entered_[lane] != 0; }
  /// Then: whether it has missed the grid, or left it; how many boxes it has passed; the voxel in which it is
  /// now, unless it is gone; when it entered that.
  [[gnu::always_inline]] bool moving(int lane) const { return moving_[lane] != 0; }
  [[gnu::always_inline]] bool gone(int lane) const { return gone_[lane] != 0; }
  [[gnu::always_inline]] uint32_t passed(int lane) const { return static_cast<uint32_t>(passed_[lane]); }
  [[gnu::always_inline]] uint32_t voxel(int lane, int a) const {
    const double v = rays_.voxel[a][lane];
    return static_cast<uint32_t>(static_cast<int64_t>(mirrored_.axis[a] ? side_ - 1 - v : v));
  }
  [[gnu::always_inline]] double t(int lane) const { return rays_.t[lane]; }

 private:
  [[gnu::always_inline]] RayPacket(const CastParams& params, const Mirrored& mirrored, int x, int y)
      : rays_(params.start, approach(params, mirrored, x, y), mirrored),
        mirrored_(mirrored),
        side_(static_cast<double>(params.start.mask) + 1) {
    bool alike = true;  // so are those between
    for (int corner = 1; corner < 4; ++corner) {
      const Mirrored other(
          ray_through(params, corner % 2 ? x + width - 1 : x, corner / 2 ? y + height - 1 : y).direction);
      for (int a = 0; a < 3; ++a) alike &= mirrored.axis[a] == other.axis[a];
    }
    gone_ = ~rays_.may_enter();
    const Lanes unclear = rays_.enter();
    entered_ = alike ? gone_ | ~unclear : Lanes{};
    moving_ = entered_ & ~gone_;
  }
  [[gnu::always_inline]] static Approach<Real> approach(const CastParams& params, const Mirrored& mirrored,
                                                        int x, int y) {
    Real u, v;
    for (int i = 0; i < lanes; ++i) u[i] = x + i % width + 0.5, v[i] = y + i / width + 0.5;
    Real towards[3];
    for (int a = 0; a < 3; ++a) towards[a] = params.corner[a] + (params.across[a] * u + params.down[a] * v);
    return {params.start, towards, mirrored};
  }
  [[gnu::always_inline]] static bool any(const Lanes& mask) {
    int64_t sum = 0;
    for (int i = 0; i < lanes; ++i) sum |= mask[i];
    return sum != 0;
  }

  Motion rays_;
  Mirrored mirrored_;
  double side_;     ///< of the grid, about the middle of which rays are mirrored
  Lanes entered_;   ///< or missed, by what is clear
  Lanes gone_;      ///< missed or left
  Lanes moving_;    ///< in the grid, by what is clear
  Lanes passed_{};  ///< boxes
};

}  // namespace voxkit::render
