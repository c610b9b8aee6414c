// How long something took.
#pragma once

#include <chrono>

namespace voxkit {

/// Goes on evenly, whatever is done to the time of day.
using Clock = std::chrono::steady_clock;

/// Seconds of wall time from `start` to now.
inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace voxkit
