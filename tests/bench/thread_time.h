// The time that a thread runs: what other programs take of its core is left out.
#pragma once

#include <time.h>

#include <algorithm>
#include <cstdint>

#include "formats/result.h"

namespace voxkit::bench {

/// Seconds that this thread has run.
inline double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

/// Seconds of the fastest of some rounds of `body() -> Status`.
template <class Body>
Result<double> fastest(int64_t rounds, Body body) {
  double best = 1e300;
  for (int64_t i = 0; i < rounds; ++i) {
    const double start = thread_seconds();
    VOX_CHECK(body());
    best = std::min(best, thread_seconds() - start);
  }
  return best;
}

}  // namespace voxkit::bench
