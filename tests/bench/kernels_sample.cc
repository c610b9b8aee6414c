// Samples of direct volume rendering: the eight voxels around a place, the value between them, its gradient.
#include <array>
#include <vector>

#include "formats/cpu.h"
#include "formats/hash.h"
#include "formats/volume/builtin.h"
#include "librender/dvr/dense_sampler.h"
#include "librender/dvr/dvr.h"
#include "librender/dvr/dvr_lanes.h"
#include "tests/bench/ceilings.h"
#include "tests/bench/kernels.h"
#include "tests/bench/thread_time.h"

namespace voxkit::bench {
namespace {

using namespace voxkit::render;

constexpr int lanes = PortableLanes::count;
constexpr int steps = 64;
constexpr float step = 0.25f, pixel = 0.5f;

/// Where a packet of rays begins, one sample a lane.
using Packet = std::array<Floats, 3>;

struct Samples {
  std::shared_ptr<const DenseGrid> grid;
  std::vector<Packet> along;      ///< neighbouring rays, each packet anywhere
  std::vector<Packet> scattered;  ///< every lane anywhere
  std::vector<Packet> same;       ///< all packets at one place
};

Result<std::shared_ptr<const Samples>> make_samples(int64_t side, size_t packets) {
  const auto source = marschner_lobb_source(side);
  auto made = std::make_shared<Samples>();
  VOX_TRY(made->grid, DenseGrid::read(*source, context()));
  // So far from the end that no ray leaves the volume.
  const float room = static_cast<float>(side) - 2 - steps * step - 4 * pixel;
  const auto anywhere = [&](int axis, size_t i) {
    return room * static_cast<float>(random64(static_cast<uint64_t>(axis), i) >> 40) * 0x1p-24f;
  };
  for (size_t p = 0; p < packets; ++p) {
    Packet along{}, scattered{}, same{};
    for (int i = 0; i < lanes; ++i)
      for (int a = 0; a < 3; ++a) {
        const float across = a == 0   ? pixel * static_cast<float>(i % 4)
                             : a == 1 ? pixel * static_cast<float>(i / 4)
                                      : 0;
        const auto axis = static_cast<size_t>(a);
        along[axis][i] = anywhere(a, p) + across;
        scattered[axis][i] = anywhere(a, p * lanes + static_cast<size_t>(i));
        same[axis][i] = across;
      }
    made->along.push_back(along);
    made->scattered.push_back(scattered);
    made->same.push_back(same);
  }
  return made;
}

enum class What { corners, value, gradient };

/// Follows packets for some steps along a diagonal.
template <class Lanes, What what>
[[gnu::always_inline]] inline float follow(const DenseSampler<uint16_t>& sampler,
                                           const std::vector<Packet>& packets) {
  const Ints all = Lanes::all(-1);
  Floats sum = Lanes::all(0.0f);
  for (const Packet& packet : packets)
    for (int k = 0; k < steps; ++k) {
      DvrPlaces<Lanes> place;
      Floats at[3], corners[8];
      for (size_t a = 0; a < 3; ++a) {
        at[a] = packet[a] + step * static_cast<float>(k);
        place.cell[a] = Lanes::to_int(at[a]);
      }
      sampler.template fetch<Lanes>(place, all, corners);
      if constexpr (what == What::corners) {
        for (const Floats& corner : corners) sum += corner;
        continue;
      }
      const Vec<Floats> within = {at[0] - Lanes::to_float(place.cell[0]),
                                  at[1] - Lanes::to_float(place.cell[1]),
                                  at[2] - Lanes::to_float(place.cell[2])};
      const Interpolated<Floats> found = interpolate<what == What::gradient>(corners, within);
      sum += found.value;
      if constexpr (what == What::gradient) sum += (found.gradient.x + found.gradient.y) + found.gradient.z;
    }
  float total = 0;
  for (int i = 0; i < lanes; ++i) total += sum[i];
  return total;
}

template <What what>
float follow_portable(const DenseSampler<uint16_t>& sampler, const std::vector<Packet>& packets) {
  return follow<PortableLanes, what>(sampler, packets);
}
#ifdef VOXKIT_DVR_AVX2
template <What what>
[[gnu::target("avx2")]] float follow_avx2(const DenseSampler<uint16_t>& sampler,
                                          const std::vector<Packet>& packets) {
  return follow<Avx2Lanes, what>(sampler, packets);
}
#else
template <What what>
float follow_avx2(const DenseSampler<uint16_t>& sampler, const std::vector<Packet>& packets) {
  return follow<PortableLanes, what>(sampler, packets);
}
#endif

template <What what>
float follow_all(const Samples& s, const std::vector<Packet>& packets) {
  const VolumeInfo& info = s.grid->info();
  const DenseSampler<uint16_t> sampler(s.grid->view().voxels, {info.dims.x, info.dims.y, info.dims.z});
  return has_avx2() ? follow_avx2<what>(sampler, packets) : follow_portable<what>(sampler, packets);
}

double samples_of(const std::vector<Packet>& packets) {
  return static_cast<double>(packets.size()) * steps * lanes;
}

template <What what>
void add_samples(const std::string& name, const std::shared_ptr<Lazy<Samples>>& input) {
  for (const bool scattered : {false, true})
    add("sample/" + name + (scattered ? "/scattered" : "/rays"), input,
        [scattered](benchmark::State& state, const Samples& s) {
          const std::vector<Packet>& packets = scattered ? s.scattered : s.along;
          for (auto _ : state) benchmark::DoNotOptimize(follow_all<what>(s, packets));
          state.SetBytesProcessed(static_cast<int64_t>(state.iterations()) *
                                  static_cast<int64_t>(samples_of(packets) * 8 * sizeof(uint16_t)));
          const auto seconds = fastest(5, [&]() -> Status {
            benchmark::DoNotOptimize(follow_all<What::corners>(s, s.same));
            return {};
          });
          report(state, samples_of(packets),
                 {seconds.value_or(0) / samples_of(s.same) * 1e9, "its eight voxels, in the nearest cache"});
        });
}

}  // namespace

void add_sample_kernels(bool quick) {
  const int64_t side = quick ? 32 : 256;
  const auto input = std::make_shared<Lazy<Samples>>([=] { return make_samples(side, quick ? 16 : 2048); });
  add_samples<What::corners>("corners", input);
  add_samples<What::value>("value", input);
  add_samples<What::gradient>("gradient", input);
  add("sample/draw", input, [=](benchmark::State& state, const Samples& s) {
    const auto draw = [&]() -> Status {
      VOX_TRY(DvrVolume volume, DvrVolume::open(s.grid, context()));
      VOX_TRY(const DvrScene scene,
              DvrScene::create(std::make_shared<const DvrVolume>(std::move(volume)),
                               *transfer_preset("gray", ValueRange{0, 65535}), context()));
      DvrOptions options;
      options.width = options.height = quick ? 32 : 256;
      Frame frame;
      uint64_t samples = 0;
      for (auto _ : state) {
        VOX_CHECK(scene.draw(Camera::orbit(30, 20, 1.8, 45), options, frame, context()));
        samples = frame.samples;
      }
      const auto seconds = fastest(5, [&]() -> Status {
        benchmark::DoNotOptimize(follow_all<What::corners>(s, s.same));
        return {};
      });
      report(state, static_cast<double>(samples),
             {seconds.value_or(0) / samples_of(s.same) * 1e9, "its eight voxels, in the nearest cache"});
      return {};
    };
    const Status status = draw();
    if (!status) give_up(state, status.error());
  })->Unit(benchmark::kMillisecond);
}

}  // namespace voxkit::bench
