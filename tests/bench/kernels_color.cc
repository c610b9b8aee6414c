// Blocks of colours: the best line for a run, and whole parts.
#include <algorithm>
#include <vector>

#include "formats/hash.h"
#include "libcolor/blocks/block_encode.h"
#include "libcolor/blocks/block_fit.h"
#include "libcolor/blocks/block_plan.h"
#include "libcolor/terrain/terrain.h"
#include "tests/bench/ceilings.h"
#include "tests/bench/kernels.h"
#include "tests/bench/thread_time.h"

namespace voxkit::bench {
namespace {

using namespace voxkit::color;

constexpr double threshold = 9.56;
constexpr uint32_t allowed = 91;  // its square, as a whole number
constexpr int effort = 3;

struct Colors {
  std::vector<Rgb> all;
};

/// Those of a built-in scene, in the order of its voxels.
Result<std::shared_ptr<const Colors>> make_colors(const std::string& name) {
  VOX_TRY(const auto source, open_terrain(name));
  auto made = std::make_shared<Colors>();
  VOX_CHECK(source->read(context(), [&](std::span<const SurfaceVoxel> run) -> Status {
    for (const SurfaceVoxel& voxel : run) made->all.push_back(voxel.color);
    return {};
  }));
  if (made->all.size() < macro_block_colors) return fail(ErrorCode::input, name, "too few colours");
  return made;
}
/// A macro block from the middle.
std::span<const Rgb> some(const Colors& c) {
  return std::span(c.all).subspan((c.all.size() - macro_block_colors) / 2, macro_block_colors);
}

/// Decoding a colour and measuring its distance, for one pair of ends, all colours in one run.
double distance_ns(std::span<const Rgb> colors) {
  const MacroColors macro(colors);
  const BlockKernels& kernels = block_kernels(true);
  const ColorRun run{{macro.channel(0), macro.channel(1), macro.channel(2)}, macro.size()};
  constexpr int calls = 50;
  const auto seconds = fastest(5, [&]() -> Status {
    for (int i = 0; i < calls; ++i)
      benchmark::DoNotOptimize(kernels.distances(run, {20, 30, 40}, {200, 190, 180}, 7, 1 << 20, nullptr));
    return {};
  });
  return seconds.value_or(0) / calls / static_cast<double>(colors.size()) * 1e9;
}

struct Run {
  uint32_t first, last;
  int bits;
};

/// The blocks that an encoder makes of them: without weights, and with.
std::vector<Run> planned(const MacroColors& macro, bool weights) {
  const Fitter fitter(macro, Endpoints::rgb565, allowed, effort);
  std::vector<Run> runs;
  PlanMemory memory;
  for (const PlannedBlock& block : parse_optimally(macro, fitter, Endpoints::rgb565, effort, memory))
    if ((block.bits > 0) == weights) runs.push_back({block.first, block.last, block.bits});
  return runs;
}
/// Runs of 64 colours that no line is near enough to.
std::vector<Run> hopeless(const MacroColors& macro) {
  const Fitter fitter(macro, Endpoints::rgb565, allowed, effort);
  std::vector<Run> runs;
  for (uint32_t first = 0; first + 64 <= macro.size(); first += 64)
    if (!fitter.fit(first, first + 64, 3).feasible) runs.push_back({first, first + 64, 3});
  return runs;
}

template <class Choose>
void add_fit(const std::string& name, const std::shared_ptr<Lazy<Colors>>& input, Choose choose) {
  add("fit/" + name, input, [choose](benchmark::State& state, const Colors& c) {
    const MacroColors macro(some(c));
    const std::vector<Run> runs = choose(macro);
    if (runs.empty()) return give_up(state, Error{ErrorCode::input, {}, "no such blocks"});
    const Fitter fitter(macro, Endpoints::rgb565, allowed, effort);
    for (auto _ : state)
      for (const Run& run : runs) benchmark::DoNotOptimize(fitter.fit(run.first, run.last, run.bits));
    double colors = 0;
    for (const Run& run : runs) colors += run.last - run.first;
    state.counters["colors_a_block"] = colors / static_cast<double>(runs.size());
    report(state, colors, {distance_ns(some(c)), "one pass over the colours"});
  });
}

void add_parts(const std::string& name, const std::shared_ptr<Lazy<Colors>>& input,
               const BlockOptions& options) {
  add("blocks/" + name, input, [=](benchmark::State& state, const Colors& c) {
    const std::span<const Rgb> colors = some(c);
    uint64_t bytes = 0;
    for (auto _ : state) bytes = encode_part(colors, options).bytes.size();
    state.SetBytesProcessed(static_cast<int64_t>(state.iterations() * colors.size() * sizeof(Rgb)));
    state.counters["percent"] =
        100 * static_cast<double>(bytes) / static_cast<double>(colors.size() * sizeof(Rgb));
    report(state, static_cast<double>(colors.size()), {distance_ns(colors), "one pass over the colours"});
  })->Unit(benchmark::kMillisecond);
}

}  // namespace

void add_color_kernels(bool quick) {
  const auto input =
      std::make_shared<Lazy<Colors>>([=] { return make_colors(quick ? "terrain:128" : "terrain:512"); });
  add_fit("single", input, [](const MacroColors& macro) { return planned(macro, false); });
  add_fit("line", input, [](const MacroColors& macro) { return planned(macro, true); });
  add_fit("refused", input, hopeless);
  add_parts("fws/effort_1", input, {threshold, 3, 1});
  add_parts("vws/effort_1", input, {threshold, 0, 1});
  add_parts("vws/effort_3", input, {threshold, 0, effort});
}

}  // namespace voxkit::bench
