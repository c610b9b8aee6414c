// Rays: steps through a grid, and pictures of compressed volumes without shading.
#include <array>
#include <cmath>
#include <vector>

#include "formats/hash.h"
#include "formats/volume/builtin.h"
#include "libcolor/color.h"
#include "libcolor/terrain/terrain.h"
#include "librender/cast/ray_cast.h"
#include "tests/bench/ceilings.h"
#include "tests/bench/kernels.h"
#include "tests/bench/thread_time.h"
#include "tests/stress/algorithm1.h"

namespace voxkit::bench {
namespace {

using namespace voxkit::render;

struct Ray {
  double origin[3], direction[3];
};

/// Rays from a sphere around a grid to anywhere within it.
struct Rays {
  int64_t side;
  std::vector<Ray> rays;
};

Rays make_rays(int64_t side, size_t count) {
  Rays made{side, {}};
  const auto unit = [](uint64_t key, uint64_t i) {
    return static_cast<double>(random64(key, i) >> 11) * 0x1p-53;
  };
  for (size_t i = 0; i < count; ++i) {
    const double z = 2 * unit(0, i) - 1, turn = 6.283185307179586 * unit(1, i), flat = std::sqrt(1 - z * z);
    const double around[3] = {flat * std::cos(turn), flat * std::sin(turn), z};
    Ray ray{};
    for (int a = 0; a < 3; ++a) {
      ray.origin[a] = (0.5 + 1.5 * around[a]) * static_cast<double>(side);
      const double target = unit(static_cast<uint64_t>(2 + a), i) * static_cast<double>(side);
      ray.direction[a] = target - ray.origin[a];
    }
    made.rays.push_back(ray);
  }
  return made;
}

/// Follows all rays through a grid without voxels, over cells of edge 2^log2_edge; returns the steps.
uint64_t march(const Rays& rays, int log2_edge) {
  const int64_t dims[3] = {rays.side, rays.side, rays.side};
  uint64_t steps = 0;
  for (const Ray& one : rays.rays) {
    GridRay ray(RayOrigin(one.origin, dims), one.direction);
    for (bool inside = ray.enter(); inside; inside = ray.leave(log2_edge)) {
      benchmark::DoNotOptimize(ray.voxel(0) + ray.voxel(1) + ray.voxel(2));
      ++steps;
    }
  }
  return steps;
}
uint64_t march_as_published(const Rays& rays) {
  const int64_t dims[3] = {rays.side, rays.side, rays.side};
  uint64_t steps = 0;
  for (const Ray& one : rays.rays) {
    stress::Algorithm1 ray;
    for (bool inside = ray.enter(one.origin, one.direction, dims); inside; inside = ray.step()) {
      benchmark::DoNotOptimize(ray.voxel(0) + ray.voxel(1) + ray.voxel(2));
      ++steps;
    }
  }
  return steps;
}

/// ns a step of Algorithm 1 of the thesis, which is not exact.
double published_step_ns(const Rays& rays) {
  uint64_t steps = 0;
  const auto seconds = fastest(3, [&]() -> Status {
    steps = march_as_published(rays);
    return {};
  });
  return seconds.value_or(0) / static_cast<double>(steps) * 1e9;
}

void add_march(const std::shared_ptr<Lazy<Rays>>& input) {
  for (const int log2_edge : {0, 3})
    add(log2_edge == 0 ? "march/voxels" : "march/cells_of_8", input,
        [log2_edge](benchmark::State& state, const Rays& rays) {
          uint64_t steps = 0;
          for (auto _ : state) steps = march(rays, log2_edge);
          report(state, static_cast<double>(steps),
                 {published_step_ns(rays), "a step of Algorithm 1, in floats"});
        });
}

template <class Grid>
struct Scene {
  std::shared_ptr<const Grid> grid;
  uint64_t finest_bytes;  ///< of what the last voxel of a way is in
};

/// A picture of 512 x 512 of each of four sides. Boxes of void are known after the first round, as they are
/// after the first pictures of a path.
template <class Grid>
void add_cast(const std::string& name, const std::shared_ptr<Lazy<Scene<Grid>>>& input, int width) {
  add("cast/" + name, input, [width](benchmark::State& state, const Scene<Grid>& scene) {
    CastOptions options;
    options.width = options.height = width;
    Frame frame;
    uint64_t rays = 0, hit = 0, cells = 0, blocks = 0;
    for (auto _ : state) {
      rays = hit = cells = blocks = 0;
      for (const double azimuth : {20, 110, 200, 290}) {
        const Status status =
            cast(*scene.grid, Camera::orbit(azimuth, 20, 1.8, 45), options, frame, context());
        if (!status) return give_up(state, status.error());
        rays += frame.rays, hit += frame.rays_hit, cells += frame.cells_visited,
            blocks += frame.blocks_touched;
      }
    }
    const double all = static_cast<double>(rays), share = static_cast<double>(hit) / all;
    state.counters["hit"] = share;
    state.counters["cells"] = static_cast<double>(cells) / all;
    state.counters["blocks"] = static_cast<double>(blocks) / all;
    report(state, all, {share * scattered_load_ns(scene.finest_bytes), "a load for each ray that hits"});
  })->Unit(benchmark::kMillisecond);
}

Result<std::shared_ptr<const Scene<SvmmGrid>>> make_sponge(int level) {
  VOX_TRY(const auto volume, lossless_svmm(menger_source(level), "menger"));
  const svmm::Level& base = volume->levels()[0];
  return std::make_shared<const Scene<SvmmGrid>>(
      Scene<SvmmGrid>{std::make_shared<const SvmmGrid>(volume), base.blocks * base.block_bytes});
}

Result<std::shared_ptr<const Scene<DagGrid>>> make_hills(const std::string& name) {
  VOX_TRY(const auto source, color::open_terrain(name));
  VOX_TRY(const auto container, contain(name, [&](const ByteSink& sink) -> Status {
            VOX_TRY(const auto encoded, color::encode(*source, {}, sink, context()));
            (void)encoded;
            return {};
          }));
  VOX_TRY(const auto volume, color::Volume::open(container));
  return std::make_shared<const Scene<DagGrid>>(
      Scene<DagGrid>{std::make_shared<const DagGrid>(volume), volume->params().color_bytes});
}

}  // namespace

void add_march_kernels(bool quick) {
  add_march(std::make_shared<Lazy<Rays>>(
      [=] { return std::make_shared<const Rays>(make_rays(1000, quick ? 4 : 256)); }));
  const int width = quick ? 32 : 512, level = quick ? 2 : 5;
  const std::string hills = quick ? "terrain:64" : "terrain:1024";
  add_cast("svmm/menger:" + std::to_string(level),
           std::make_shared<Lazy<Scene<SvmmGrid>>>([=] { return make_sponge(level); }), width);
  add_cast("dag/" + hills, std::make_shared<Lazy<Scene<DagGrid>>>([=] { return make_hills(hills); }), width);
}

}  // namespace voxkit::bench
