// librender's GridRay, with its exact decisions counted. For programs that link nothing of librender.
#pragma once

#include <cstdint>

#define ExactRay UncountedExactRay
#include "librender/cast/exact_ray.h"
#undef ExactRay

namespace voxkit::render {

inline thread_local int64_t exact_decisions = 0;

struct ExactRay : UncountedExactRay {
  double enter() {
    ++exact_decisions;
    return UncountedExactRay::enter();
  }
  double cross(double x, double y, double z) {
    ++exact_decisions;
    return UncountedExactRay::cross(x, y, z);
  }
};

}  // namespace voxkit::render

#include "librender/cast/ray.h"
