// Points of a file, in runs, as the readers of point clouds hand them on.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "formats/context.h"
#include "formats/mapped_file.h"
#include "formats/mesh/point_cloud.h"

namespace voxkit {

/// Lets bytes of a mapped file that were read leave this process.
class ReadBytes {
 public:
  explicit ReadBytes(std::span<const std::byte> bytes) : bytes_(bytes) {}
  /// All before byte `end`.
  void release(size_t end) {
    if (end > released_) release_bytes(bytes_.subspan(released_, end - released_));
    released_ = end;
  }

 private:
  std::span<const std::byte> bytes_;
  size_t released_ = 0;
};

/// Calls `sink` with `count` points of a file in runs, without those that PointCloud::read leaves out.
/// `next(i, point)` makes point i of `blank`, and says whether the file counts it; `done(i)` is called after
/// a run that ends before point i. Points below `least_alpha` are left out.
template <class Next, class Done>
Status read_in_runs(uint64_t count, const CloudPoint& blank, const PointCloud::Sink& sink, const Next& next,
                    const Done& done, uint8_t least_alpha = 128) {
  constexpr uint64_t most = 1 << 14;
  std::vector<CloudPoint> run;
  run.reserve(most);
  for (uint64_t i = 0; i < count; ++i) {
    CloudPoint& point = run.emplace_back(blank);
    VOX_TRY(bool there, next(i, point));
    there &= point.alpha >= least_alpha;
    for (int a = 0; a < 3; ++a)
      if (constexpr double large = 3.5e38; !(std::abs(point.at[a]) <= large)) there = false;
    if (!there) run.pop_back();
    if (i % most + 1 < most && i + 1 < count) continue;
    VOX_CHECK(check_interrupt());
    VOX_CHECK(sink(run));
    run.clear();
    done(i + 1);
  }
  return {};
}

}  // namespace voxkit
