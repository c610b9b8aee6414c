// SSIM and MS-SSIM of two pictures.
#include "formats/hash.h"
#include "formats/volume/builtin.h"
#include "libmetrics/ssim.h"
#include "tests/bench/ceilings.h"
#include "tests/bench/kernels.h"

namespace voxkit::bench {
namespace {

struct Pair {
  Image a, b;
};

/// A section of a built-in volume, and the same with noise of some grey levels.
Result<std::shared_ptr<const Pair>> make_pair(int64_t side) {
  const auto source = membrane_source({side, side, 1}, 1);
  std::vector<std::byte> voxels(static_cast<size_t>(side * side));
  VOX_CHECK(
      source->read(source->info().box(), packed(voxels.data(), source->info().dims, source->info().format)));
  VOX_TRY(Image a, Image::create(side, side, 1, SampleType::u8, context()));
  VOX_TRY(Image b, Image::create(side, side, 1, SampleType::u8, context()));
  for (int64_t y = 0; y < side; ++y)
    for (int64_t x = 0; x < side; ++x) {
      const auto at = static_cast<size_t>(y * side + x);
      const int grey = std::to_integer<int>(voxels[at]), noise = static_cast<int>(random64(1, at) % 17) - 8;
      a.row(y)[x] = static_cast<float>(grey);
      b.row(y)[x] = static_cast<float>(std::clamp(grey + noise, 0, 255));
    }
  return std::make_shared<const Pair>(Pair{std::move(a), std::move(b)});
}

/// Additions and multiplications of doubles a pixel that the definition asks for, with windows that are
/// symmetric and separable: four moments, each filtered along both axes, and the quotients; a third more for
/// the smaller scales.
constexpr double operations = (4 + 4 * 2 * 17 + 20) * 4 / 3.0;

}  // namespace

void add_image_kernels(bool quick) {
  const int64_t side = quick ? 64 : 1024;
  const auto input = std::make_shared<Lazy<Pair>>([=] { return make_pair(side); });
  add("ms_ssim/" + std::to_string(side), input, [](benchmark::State& state, const Pair& pair) {
    for (auto _ : state) {
      const auto found = ssim(pair.a, pair.b, std::nullopt, context());
      if (!found) return give_up(state, found.error());
      benchmark::DoNotOptimize(found->ms_ssim);
    }
    const double pixels = static_cast<double>(pair.a.pixels());
    state.counters["ms_a_megapixel"] =
        benchmark::Counter(static_cast<double>(state.iterations()) * pixels * 1e-6 * 1e-3,
                           benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
    report(state, pixels,
           {operations / double_operations_per_s() * 1e9, "its additions and multiplications"});
  })->Unit(benchmark::kMillisecond);
}

}  // namespace voxkit::bench
