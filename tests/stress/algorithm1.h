// Algorithm 1 of the thesis, as librender/cast/cast_kernel.h has it (`follow_baseline`), voxel by voxel and
// without a volume. tests/librender/ray_test.cc holds the two together.
#pragma once

#include <cmath>
#include <cstdint>

namespace voxkit::stress {

class Algorithm1 {
 public:
  /// False if it misses the grid.
  bool enter(const double (&origin)[3], const double (&direction)[3], const int64_t (&dims)[3]) {
    float o[3], d[3], t_enter = 0, t_leave = __builtin_inff();
    for (int a = 0; a < 3; ++a) {
      dims_[a] = dims[a];
      o[a] = static_cast<float>(origin[a]);
      d[a] = static_cast<float>(direction[a]);
      const float side = static_cast<float>(dims[a]);
      if (d[a] == 0 && (o[a] < 0 || o[a] >= side)) return false;
      if (d[a] == 0) continue;
      const float near = (d[a] < 0 ? side - o[a] : -o[a]) / d[a],
                  far = (d[a] < 0 ? -o[a] : side - o[a]) / d[a];
      t_enter = near > t_enter ? near : t_enter;
      t_leave = far < t_leave ? far : t_leave;
    }
    if (t_enter >= t_leave) return false;
    for (int a = 0; a < 3; ++a) {
      const float at = o[a] + d[a] * t_enter;
      const int64_t whole = static_cast<int64_t>(std::floor(at));
      voxel_[a] = whole < 0 ? 0 : whole >= dims[a] ? dims[a] - 1 : whole;
      step_[a] = d[a] < 0 ? -1 : 1;
      delta_[a] = d[a] == 0 ? __builtin_inff() : std::fabs(1 / d[a]);
      t_max_[a] =
          d[a] == 0 ? delta_[a] : t_enter + (static_cast<float>(voxel_[a] + (d[a] < 0 ? 0 : 1)) - at) / d[a];
    }
    t_ = t_enter;
    return true;
  }
  /// Moves to the next voxel; false if that leaves the grid.
  bool step() {
    const int axis =
        t_max_[0] <= t_max_[1] ? (t_max_[0] <= t_max_[2] ? 0 : 2) : (t_max_[1] <= t_max_[2] ? 1 : 2);
    t_ = t_max_[axis];
    t_max_[axis] += delta_[axis];
    voxel_[axis] += step_[axis];
    return voxel_[axis] >= 0 && voxel_[axis] < dims_[axis];
  }
  int64_t voxel(int a) const { return voxel_[a]; }
  /// When the current voxel was entered.
  float t() const { return t_; }

 private:
  float delta_[3], t_max_[3], t_ = 0;
  int64_t dims_[3], voxel_[3], step_[3];
};

}  // namespace voxkit::stress
