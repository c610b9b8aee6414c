// Rays through neighbouring pixels, side by side in vector registers, as far as they cross the same
// boxes: one box costs all of them hardly more than one. What doubles do not settle is left to each ray
// alone, so that every ray meets the voxels, and the times, that it meets alone.
#pragma once

#include "librender/cast/cast_kernel.h"

namespace voxkit::render {

/// `lanes` doubles (GCC's and Clang's vector extension).
template <int lanes>
struct VectorOf {
  typedef double Real __attribute__((vector_size(lanes * 8)));
};

/// How the rays through a number of pixels are mirrored, and what they meet.
class Mirror {
 public:
  Mirror(const CastParams& params, const Mirrored& mirrored)
      : mirrored_(mirrored), side_(static_cast<double>(params.start.mask) + 1) {}
  const Mirrored& mirrored() const { return mirrored_; }

  /// A box as the rays see it: begin <= v < end.
  struct Box {
    double begin[3], end[3];
  };
  [[gnu::always_inline]] Box operator()(const uint32_t (&lo)[3], const uint32_t (&hi)[3]) const {
    Box box;
    for (int a = 0; a < 3; ++a) {
      box.begin[a] = mirrored_.axis[a] ? side_ - hi[a] : lo[a];
      box.end[a] = mirrored_.axis[a] ? side_ - lo[a] : hi[a];
    }
    return box;
  }
  /// A voxel that they see, as it is.
  [[gnu::always_inline]] uint32_t voxel(int a, double v) const {
    return static_cast<uint32_t>(static_cast<int64_t>(mirrored_.axis[a] ? side_ - 1 - v : v));
  }

 private:
  Mirrored mirrored_;
  double side_;  ///< of the grid, about the middle of which rays are mirrored
};

/// The rays through a block of pixels, of which (x, y) is the first, row by row. All are mirrored alike.
template <int width, int height>
class RayPacket {
  static constexpr int lanes = width * height;
  using Real = typename VectorOf<lanes>::Real;
  using Motion = RayMotion<Real, Real, double>;
  using Lanes = Mask<Real>;

 public:
  [[gnu::always_inline]] RayPacket(const CastParams& params, const Mirror& mirror, int x, int y)
      : rays_(params.start, approach(params, mirror.mirrored(), x, y), mirror.mirrored()) {
    gone_ = ~rays_.may_enter();
    const Lanes unclear = rays_.enter();
    entered_ = gone_ | ~unclear;
    moving_ = entered_ & ~gone_;
  }

  /// Moves those rays that are in a box out of it. False if none is there.
  [[gnu::always_inline]] bool leave(const Mirror::Box& box) {
    Lanes inside = moving_;
    Real plane[3], next[3], when;
    for (int a = 0; a < 3; ++a) {
      inside &= (rays_.voxel[a] >= box.begin[a]) & (rays_.voxel[a] < box.end[a]);
      plane[a] = Real{} + box.end[a];
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
  /// Then: whether it has missed the grid, or left it; how many boxes it has passed; the (mirrored) voxel in
  /// which it is now, unless it is gone; when it entered that.
  [[gnu::always_inline]] bool moving(int lane) const { return moving_[lane] != 0; }
  [[gnu::always_inline]] bool gone(int lane) const { return gone_[lane] != 0; }
  [[gnu::always_inline]] uint32_t passed(int lane) const { return static_cast<uint32_t>(passed_[lane]); }
  [[gnu::always_inline]] double voxel(int lane, int a) const { return rays_.voxel[a][lane]; }
  [[gnu::always_inline]] double t(int lane) const { return rays_.t[lane]; }

 private:
  [[gnu::always_inline]] static Approach<Real> approach(const CastParams& params, const Mirrored& mirrored,
                                                        int x, int y) {
    Real u{}, v{};
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
  Lanes entered_;   ///< or missed, by what is clear
  Lanes gone_;      ///< missed or left
  Lanes moving_;    ///< in the grid, by what is clear
  Lanes passed_{};  ///< boxes
};

}  // namespace voxkit::render
