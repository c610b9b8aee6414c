// Surfaces that are made cube by cube, on several threads, and read in order.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "formats/parallel.h"
#include "formats/reservation.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// Voxels as they are made, and their attributes.
struct VoxelBatch {
  std::vector<SurfaceVoxel> voxels;
  std::vector<std::byte> attributes;
  void clear() {
    voxels.clear();
    attributes.clear();
  }
};

struct BatchSizes {
  int cube_bits = 0;           ///< a cube has 2^cube_bits voxels a side
  int all_bits = 0;            ///< and so has everything
  uint64_t thread_bytes = 0;   ///< what a thread works with
  size_t attribute_bytes = 0;  ///< of a voxel
};

/// Calls `next(job)`, which tells whether there was another, for the cubes in Morton order, and
/// `make(job, batch)`, from ctx.threads threads, which appends the voxels of a cube in Morton order. A batch
/// of cubes is made while the one before is handed to `sink`. Batches are as large as ctx.memory has room.
template <class Job, class Next, class Make>
Status read_in_batches(const BatchSizes& sizes, const SurfaceSource::Sink& sink, Context& ctx,
                       const Next& next, const Make& make) {
  const uint64_t cube_bytes = (sizeof(SurfaceVoxel) + sizes.attribute_bytes) << (3 * sizes.cube_bits);
  const auto threads = static_cast<uint64_t>(ctx.threads);
  uint64_t batch = std::clamp(ctx.memory->limit() / 8 / cube_bytes, uint64_t{1}, 32 * threads);
  Result<Reservation> hold;
  for (;; batch /= 2) {
    hold = Reservation::take(threads * sizes.thread_bytes + 2 * batch * cube_bytes, "voxelising", ctx);
    if (hold || batch == 1) break;
  }
  if (!hold) return tl::unexpected<Error>(hold.error());

  std::vector<Job> jobs;
  std::vector<VoxelBatch> ready, made;
  uint64_t last_place = 0;
  const auto hand_over = [&]() -> Status {
    for (const VoxelBatch& cube : ready)
      if (!cube.voxels.empty()) {
        VOX_CHECK(sink({cube.voxels, cube.attributes}));
        last_place = cube.voxels.back().place;
      }
    return {};
  };
  for (bool more = true; more || !ready.empty();) {
    jobs.clear();
    while (more && jobs.size() < batch) {
      Job job;
      VOX_TRY(more, next(job));
      if (more) jobs.push_back(std::move(job));
    }
    // Those of two batches ago keep their memory.
    made.resize(jobs.size());
    for (VoxelBatch& cube : made) cube.clear();
    VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(jobs.size()) + 1, [&](int64_t i) -> Status {
      if (i == 0) return hand_over();
      return make(jobs[static_cast<size_t>(i - 1)], made[static_cast<size_t>(i - 1)]);
    }));
    ctx.progress(std::ldexp(static_cast<double>(last_place), -3 * sizes.all_bits));
    std::swap(ready, made);
  }
  return {};
}

}  // namespace voxkit::color
