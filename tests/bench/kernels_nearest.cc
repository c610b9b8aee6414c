// The search for the nearest codeword of each brick: what k-means spends its time with.
#include <algorithm>
#include <bit>
#include <vector>

#include "formats/hash.h"
#include "formats/volume/builtin.h"
#include "libvq/nearest_centre.h"
#include "tests/bench/bricks.h"
#include "tests/bench/ceilings.h"
#include "tests/bench/kernels.h"
#include "tests/bench/thread_time.h"

namespace voxkit::bench {
namespace {

using namespace voxkit::vq;

struct Search {
  std::vector<Brick> bricks, centres;
  std::unique_ptr<KeySpace> space;
};

/// The bricks of a volume, all different, and one of 16 as centres.
Result<std::shared_ptr<const Search>> make_search(int64_t side) {
  const auto source = membrane_source(Index3(side), 1);
  auto made = std::make_shared<Search>();
  VOX_TRY(made->bricks, bricks_of(*source, context()));
  std::sort(made->bricks.begin(), made->bricks.end());
  made->bricks.erase(std::unique(made->bricks.begin(), made->bricks.end()), made->bricks.end());
  // In an order that has nothing to do with what they are.
  for (size_t i = made->bricks.size(); i > 1; --i)
    std::swap(made->bricks[i - 1], made->bricks[random64(5, i) % i]);
  made->centres.assign(made->bricks.begin(),
                       made->bricks.begin() + static_cast<std::ptrdiff_t>(made->bricks.size() / 16));
  made->space = std::make_unique<KeySpace>(made->bricks);
  return made;
}

/// In ever larger groups, as seeding finds them: what was found narrows what is looked for.
Status assign_all(NearestCentres& nearest, const Search& s) {
  for (size_t first = 0, count = 0; first < s.centres.size(); first += count) {
    count = std::min(std::clamp<size_t>(first / 4, 1, QueryBlock::most), s.centres.size() - first);
    VOX_CHECK(nearest.add(std::span(s.centres).subspan(first, count), static_cast<uint32_t>(first), *s.space,
                          context()));
  }
  return {};
}

/// Counts what the kernels are asked for, and asks them.
struct Counted {
  static inline const Kernels* kernels = nullptr;
  static inline uint64_t boxes = 0, keys = 0, distances = 0;

  static void near_box(const KeyBox& box, int32_t reach, const QueryRows& in, QueryRows& out) {
    boxes += in.size;
    kernels->near_box(box, reach, in, out);
  }
  static void near_bricks(const Leaf& leaf, const uint32_t* edges, const QueryKey* queries,
                          const uint32_t* numbers, size_t count, uint32_t* masks) {
    keys += count * leaf_bricks;
    kernels->near_bricks(leaf, edges, queries, numbers, count, masks);
  }
  static void measure(const Brick* bricks, uint32_t mask, const Brick& brick, uint64_t* out) {
    distances += static_cast<uint64_t>(std::popcount(mask));
    kernels->distances(bricks, mask, brick, out);
  }
};

/// Distances that lie in the nearest cache, all 32 of a leaf each time.
double distance_ns(const Search& s) {
  const Kernels& kernels = search_kernels(true, s.space->narrow());
  std::vector<uint64_t> found(leaf_bricks);
  constexpr int calls = 20000;
  const auto seconds = fastest(5, [&]() -> Status {
    for (int i = 0; i < calls; ++i) {
      kernels.distances(s.bricks.data(), ~0u, s.centres[0], found.data());
      benchmark::DoNotOptimize(found.data());
      benchmark::ClobberMemory();
    }
    return {};
  });
  return seconds.value_or(0) / calls / leaf_bricks * 1e9;
}

void add_assign(const std::string& name, const std::shared_ptr<Lazy<Search>>& input, bool native) {
  add(name, input, [native](benchmark::State& state, const Search& s) {
    const auto assign = [&](bool count) -> Status {
      VOX_TRY(NearestCentres nearest, NearestCentres::build(s.bricks, *s.space, native, context()));
      static const Kernels counting{Counted::near_box, Counted::near_bricks, Counted::measure};
      if (count) {
        Counted::boxes = Counted::keys = Counted::distances = 0;
        Counted::kernels = nearest.kernels;
        nearest.kernels = &counting;
      } else {
        state.ResumeTiming();
      }
      const Status status = assign_all(nearest, s);
      if (!count) state.PauseTiming();
      return status;
    };
    for (auto _ : state) {
      state.PauseTiming();
      const Status status = assign(false);
      state.ResumeTiming();
      if (!status) return give_up(state, status.error());
    }
    const Status status = assign(true);
    if (!status) return give_up(state, status.error());
    const double bricks = static_cast<double>(s.bricks.size()),
                 computed = static_cast<double>(Counted::distances) / bricks;
    state.counters["centres"] = static_cast<double>(s.centres.size());
    state.counters["keys"] = static_cast<double>(Counted::keys) / bricks;
    state.counters["computed"] = computed;
    state.counters["pruned_percent"] = 100 * (1 - computed / static_cast<double>(s.centres.size()));
    report(state, bricks, {computed * distance_ns(s), "the distances computed, in the nearest cache"});
  })->Unit(benchmark::kMillisecond);
}

}  // namespace

void add_nearest_kernels(bool quick) {
  const auto input = std::make_shared<Lazy<Search>>([=] { return make_search(quick ? 24 : 160); });
  add_assign("nearest/assign", input, true);
  add_assign("nearest/assign_portable", input, false);
  add("nearest/distance", input, [](benchmark::State& state, const Search& s) {
    const Kernels& kernels = search_kernels(true, s.space->narrow());
    std::vector<uint64_t> found(leaf_bricks);
    const size_t leaves = s.bricks.size() / leaf_bricks;
    for (auto _ : state)
      for (size_t leaf = 0; leaf < leaves; ++leaf) {
        kernels.distances(&s.bricks[leaf * leaf_bricks], ~0u, s.centres[0], found.data());
        benchmark::DoNotOptimize(found.data());
        benchmark::ClobberMemory();
      }
    const double distances = static_cast<double>(leaves * leaf_bricks);
    state.SetBytesProcessed(static_cast<int64_t>(state.iterations() * leaves * leaf_bricks * sizeof(Brick)));
    report(
        state, distances,
        {sizeof(Brick) / read_bytes_per_s(1, s.bricks.size() * sizeof(Brick)) * 1e9, "reading the bricks"});
  });
}

}  // namespace voxkit::bench
