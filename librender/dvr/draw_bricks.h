// Drawing from decoded bricks of values of one type: draw_bricks_*.cc has it for each, since each takes long
// to compile.
#pragma once

#include <bit>
#include <mutex>

#include "librender/dvr/brick_sampler.h"
#include "librender/dvr/dvr_tile.h"

namespace voxkit::render {

template <class T>
Status draw_bricks(const DvrVolume& volume, const DvrJob& job, Frame& frame, Context& ctx) {
  using Sampler = BrickSampler<T>;
  const auto draw = chosen<Sampler>(job);
  std::mutex mutex;
  std::vector<std::unique_ptr<BrickCache<T>>> idle;  // as many as threads
  Reservation memory(*ctx.memory);
  const auto take = [&]() -> Result<std::unique_ptr<BrickCache<T>>> {
    {
      const std::lock_guard lock(mutex);
      if (!idle.empty()) {
        auto cache = std::move(idle.back());
        idle.pop_back();
        return cache;
      }
      VOX_CHECK(memory.add(BrickCache<T>::bytes(volume.ranges().bricks()), "a cache of bricks"));
    }
    return std::make_unique<BrickCache<T>>(volume.vq()       ? brick_reader<T>(volume.vq(), job.shown)
                                           : volume.svmm()   ? brick_reader<T>(volume.svmm())
                                           : volume.packed() ? brick_reader<T>(volume.packed())
                                                             : brick_reader<T>(volume.dense()));
  };
  VOX_CHECK(over_tiles(job.params, frame, ctx, [&](const DvrTile& tile, DvrCounts& count) -> Status {
    VOX_TRY(auto cache, take());
    cache->forget();  // what a tile costs depends on nothing else
    const uint64_t before = cache->reader().decoded();
    Sampler sampler(*cache);
    draw(job.params, sampler, tile, frame, job.details, count);
    VOX_CHECK(cache->reader().status());
    count.decoded = cache->reader().decoded() - before;
    const std::lock_guard lock(mutex);
    idle.push_back(std::move(cache));
    return {};
  }));
  for (size_t word = 0; !idle.empty() && word < idle[0]->reader().places().size(); ++word) {
    uint64_t places = 0;
    for (const auto& cache : idle) places |= cache->reader().places()[word];
    frame.bricks_decoded += static_cast<uint64_t>(std::popcount(places));
  }
  return {};
}

}  // namespace voxkit::render
