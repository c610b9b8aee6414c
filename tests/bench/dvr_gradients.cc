// bench_dvr_gradients: angles between the gradients that direct volume rendering lights with and those of the
// functions that the built-in volumes are samples of.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <random>
#include <vector>

#include "formats/volume/builtin.h"
#include "formats/volume/readers.h"
#include "librender/cast/grid.h"
#include "librender/dvr/dvr_kernel.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"

namespace voxkit::bench {
namespace {

using namespace voxkit::render;
using cli::Json;

struct Options {
  int64_t samples = 200000;
  double pixel = 0.4, step = 0.5;
};

void declare(cli::CommandLine& line, Options& o) {
  line.option("--samples", "N", "Samples of each volume (200000)",
              cli::integer(o.samples, 1000, int64_t{1} << 30));
  line.option("--pixel", "P", "From a ray to its neighbours, in voxels (0.4)",
              cli::number(o.pixel, 0.01, 10));
  line.option("--step", "S", "From depth to depth, in voxels (0.5)", cli::number(o.step, 0.01, 10));
}

/// The gradient of the function at a place in voxels; 0 where there is none to speak of.
using Function = std::function<glm::dvec3(const glm::dvec3&)>;

Function marschner_lobb_of(int64_t side) {
  return [side](const glm::dvec3& voxel) {
    const glm::dvec3 p = voxel * (2.0 / static_cast<double>(side - 1)) - 1.0;
    const auto g = marschner_lobb_gradient(p.x, p.y, p.z);
    const glm::dvec3 gradient(g[0], g[1], g[2]);
    constexpr double greatest = 6;  // about
    return glm::length(gradient) < greatest / 10 ? glm::dvec3(0) : gradient;
  };
}
/// Where the ball's edge, one voxel wide, is.
Function ball_of(int64_t side) {
  return [side](const glm::dvec3& voxel) {
    const glm::dvec3 from = voxel - static_cast<double>(side - 1) / 2;
    const double off = glm::length(from) - 0.4 * static_cast<double>(side);
    return std::abs(off) < 0.5 ? -glm::normalize(from) : glm::dvec3(0);
  };
}

Interpolated<float> sample(const DenseView& view, VoxelFormat format, const glm::dvec3& at) {
  const glm::dvec3 cell = glm::floor(at);
  float v[8];
  for (int i = 0; i < 8; ++i) {
    const Voxel voxel =
        view.at(static_cast<int64_t>(cell.x) + (i & 1), static_cast<int64_t>(cell.y) + (i >> 1 & 1),
                static_cast<int64_t>(cell.z) + (i >> 2));
    v[i] = format == VoxelFormat::float32 ? voxel.as<float>() : static_cast<float>(voxel.as<uint32_t>());
  }
  const glm::vec3 within(at - cell);
  return interpolate<true>(v, Vec<float>{within.x, within.y, within.z});
}

double degrees_between(const glm::dvec3& a, const Vec<float>& b) {
  const glm::dvec3 c(b.x, b.y, b.z);
  const double lengths = glm::length(a) * glm::length(c);
  if (lengths == 0) return 90;  // no direction is as good as any
  return std::acos(std::clamp(glm::dot(a, c) / lengths, -1.0, 1.0)) * 57.29577951308232;
}

struct Angles {
  std::vector<double> all;
  double mean() const {
    double sum = 0;
    for (const double a : all) sum += a;
    return sum / static_cast<double>(all.size());
  }
  double rare() {
    const size_t at = all.size() * 999 / 1000;
    std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(at), all.end());
    return all[at];
  }
};

/// Samples at random places, as rays from random sides take them.
Result<Json> measure(const std::string& name, const Function& gradient_of, const Options& o, Context& ctx) {
  VOX_TRY(const auto source, open_builtin(name));
  VOX_TRY(const auto grid, DenseGrid::read(*source, ctx));
  const DenseView view = grid->view();
  const VoxelFormat format = grid->info().format;
  const double side = static_cast<double>(grid->info().dims.x), margin = 2 + std::max(o.pixel, o.step);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(margin, side - 1 - margin), unit(-1, 1);
  Angles cell, neighbours;
  int64_t refused = 0;
  while (static_cast<int64_t>(cell.all.size()) < o.samples) {
    const glm::dvec3 at(place(random), place(random), place(random));
    const glm::dvec3 expected = gradient_of(at);
    if (expected == glm::dvec3(0)) continue;
    const Interpolated<float> here = sample(view, format, at);
    cell.all.push_back(degrees_between(expected, here.gradient));
    const glm::dvec3 ahead = glm::normalize(glm::dvec3(unit(random), unit(random), unit(random)) + 1e-3);
    const glm::dvec3 right = glm::normalize(glm::cross(ahead, glm::dvec3(0.3, 0.9, 0.1))),
                     down = glm::cross(ahead, right);
    const glm::dvec3 ways[3] = {right * o.pixel, down * o.pixel, ahead * o.step};
    Vec<float> way[3];
    float difference[3];
    for (int i = 0; i < 3; ++i) {
      way[i] = {static_cast<float>(ways[i].x), static_cast<float>(ways[i].y), static_cast<float>(ways[i].z)};
      difference[i] = sample(view, format, at + ways[i]).value - here.value;
    }
    const auto solved = solve_gradient<OneLane>(way, difference, 0);
    refused += !solved.accepted;
    neighbours.all.push_back(degrees_between(expected, solved.accepted ? solved.gradient : here.gradient));
  }
  Json json = Json::object();
  json.set("volume", name).set("samples", o.samples);
  json.set("analytic_mean", cell.mean()).set("analytic_999", cell.rare());
  json.set("neighbour_mean", neighbours.mean())
      .set("neighbour_999", neighbours.rare())
      .set("refused", refused);
  fmt::print(stderr, "| {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} |\n", name, cell.mean(), cell.rare(),
             neighbours.mean(), neighbours.rare());
  return json;
}

Result<int> work(const Options& o, cli::Run& run) {
  fmt::print(
      stderr,
      "| volume | cell, mean | 99.9 % | neighbours, mean | 99.9 % |\n| --- | ---: | ---: | ---: | ---: |\n");
  Json rows = Json::array();
  for (const int64_t side : {40, 80, 160, 320})
    for (const bool ball : {false, true}) {
      const std::string name = fmt::format("{}:{}", ball ? "sphere" : "marschner-lobb", side);
      VOX_TRY(Json row, measure(name, ball ? ball_of(side) : marschner_lobb_of(side), o, run.ctx));
      rows.push(std::move(row));
    }
  Json json = Json::result();
  json.set("pixel", o.pixel).set("step", o.step).set("rows", std::move(rows));
  if (run.options.json) VOX_CHECK(cli::print(json.text()));
  return 0;
}

}  // namespace
}  // namespace voxkit::bench

int main(int argc, char** argv) {
  using namespace voxkit::bench;
  Options options;
  return voxkit::cli::run_tool(
      argc, argv, "bench_dvr_gradients",
      "Angles between gradients and those of the functions sampled, in degrees.",
      "  bench_dvr_gradients\n  bench_dvr_gradients --pixel 0.2 --step 0.25\n",
      [&](voxkit::cli::CommandLine& line) { declare(line, options); },
      [&](voxkit::cli::Run& run) { return work(options, run); });
}
