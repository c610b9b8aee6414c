// Samples and gradients of direct volume rendering on voxels that are hard for floats, beside exact ones; and
// whole pictures of such volumes.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "librender/dvr/dvr.h"
#include "librender/dvr/dvr_kernel.h"
#include "tests/memory_volume.h"
#include "tests/stress/exact.h"
#include "tests/stress/report.h"
#include "tests/stress/search.h"

namespace voxkit::stress {
namespace {

using namespace render;

// --- one cell

/// Eight voxels within ±2^125, whose differences of differences are floats, and a place between them.
constexpr int64_t most_voxel = (int64_t{125 + 127} << 23);
std::vector<Range> cell_ranges() {
  std::vector<Range> ranges(8, Range{-most_voxel, most_voxel});
  ranges.insert(ranges.end(), 3, Range{0, int64_t{1} << 24});
  return ranges;
}
struct Cell {
  float v[8];
  Vec<float> at;
};
Cell cell_of(const Point& p) {
  Cell cell;
  for (size_t i = 0; i < 8; ++i) cell.v[i] = float_of(p[i]);
  const auto share = [&](size_t i) { return static_cast<float>(p[8 + i]) * 0x1p-24f; };
  cell.at = {share(0), share(1), share(2)};
  return cell;
}
struct ExactSample {
  Exact value, gradient[3];
};
ExactSample exact_of(const Cell& cell) {
  const Exact at[3] = {cell.at.x, cell.at.y, cell.at.z};
  ExactSample s{0, {0, 0, 0}};
  for (int i = 0; i < 8; ++i) {
    const Exact v = cell.v[i];
    Exact weight[3];
    for (int a = 0; a < 3; ++a) weight[a] = i >> a & 1 ? at[a] : 1 - at[a];
    s.value += v * weight[0] * weight[1] * weight[2];
    for (int a = 0; a < 3; ++a)
      s.gradient[a] += (i >> a & 1 ? v : -v) * weight[(a + 1) % 3] * weight[(a + 2) % 3];
  }
  return s;
}
Exact greatest(const Cell& cell) {
  Exact most = 0;
  for (const float v : cell.v) most = std::max(most, magnitude(Exact(v)));
  return most;
}
std::string text_of(const Cell& cell) {
  std::string all = "voxels";
  for (const float v : cell.v) all += fmt::format(" {:a}", v);
  return all + fmt::format(" at {:a} {:a} {:a}", cell.at.x, cell.at.y, cell.at.z);
}
/// Alternating, steep, and nearly equal voxels.
std::vector<Point> hard_cells() {
  std::vector<Point> all;
  const int64_t one = number_of(1.0f), half = int64_t{1} << 23;
  for (const int64_t big : {one, most_voxel, number_of(1e-42f)}) {
    const auto add = [&](auto value) {
      Point p;
      for (int i = 0; i < 8; ++i) p.push_back(value(i));
      for (const int64_t at : {half, half + 1, half - 1}) p.push_back(at);
      all.push_back(p);
    };
    add([&](int i) { return std::popcount(static_cast<unsigned>(i)) & 1 ? big : -big; });
    add([&](int i) { return i & 1 ? big : big - 1; });
    add([&](int i) { return i == 7 ? big : 0; });
  }
  return all;
}

/// A search for the greatest of what `error` says of a cell, in units of 2^-24 of the greatest voxel.
template <class Error>
void cell_row(const std::string& what, const std::string& promise, double most, const Effort& effort,
              Report& report, const Error& error) {
  const auto ranges = cell_ranges();
  const Worst found = climb(ranges, hard_cells(), effort.tries * 2, effort.seed, [&](const Point& p) {
    const Cell cell = cell_of(p);
    const auto is = interpolate<true>(cell.v, cell.at);
    const Exact unit = greatest(cell) * Exact(0x1p-24);
    if (unit == 0) return 0.0;
    if (!std::isfinite(is.value)) return 1e9;
    // Of the tiniest floats a rounding is 2^-150, whatever their size.
    return to_double(error(cell, is, exact_of(cell)) / std::max(unit, Exact(0x1p-148)));
  });
  report.add({what, promise, fmt::format("{:.4g} · 2⁻²⁴", found.score), found.score <= most, found.tried,
              text_of(cell_of(found.at))});
}

void cells(const Effort& effort, Report& report) {
  cell_row("trilinear value", "off by 15 · 2⁻²⁴ of the greatest voxel", 15, effort, report,
           [](const Cell&, const Interpolated<float>& is, const ExactSample& exact) {
             return magnitude(Exact(is.value) - exact.value);
           });
  cell_row("trilinear gradient, along an axis", "off by 24 · 2⁻²⁴ of the greatest voxel", 24, effort, report,
           [](const Cell&, const Interpolated<float>& is, const ExactSample& exact) {
             const float g[3] = {is.gradient.x, is.gradient.y, is.gradient.z};
             Exact worst = 0;
             for (int a = 0; a < 3; ++a) worst = std::max(worst, magnitude(Exact(g[a]) - exact.gradient[a]));
             return worst;
           });
  // Where nothing can be seen is skipped: what samples may have is known from the voxels, but for this.
  cell_row("value beyond its voxels", "within the 16 · 2⁻²⁴ that skipping allows for", 16, effort, report,
           [](const Cell& cell, const Interpolated<float>& is, const ExactSample&) {
             const auto [lo, hi] = std::minmax_element(cell.v, cell.v + 8);
             return std::max({Exact(0), Exact(is.value) - Exact(*hi), Exact(*lo) - Exact(is.value)});
           });
}

// --- gradients from neighbouring rays

void neighbours(const Effort& effort, Report& report) {
  // Three ways and three differences, floats of any size; ways of up to 2^20 voxels.
  const int64_t far = number_of(0x1p20f), large = number_of(0x1p100f);
  std::vector<Range> ranges(9, Range{-far, far});
  ranges.insert(ranges.end(), 3, Range{-large, large});
  Point unit(12, 0), thin;
  for (const size_t i : {0, 4, 8, 9, 10, 11}) unit[i] = number_of(1.0f);
  thin = unit;
  thin[2] = thin[6] = number_of(0.999f);
  thin[8] = number_of(1.0f);
  const auto look = [&](const Point& p) {
    Vec<float> way[3];
    float difference[3];
    Exact w[3][3], d[3];
    for (size_t i = 0; i < 3; ++i) {
      way[i] = {float_of(p[3 * i]), float_of(p[3 * i + 1]), float_of(p[3 * i + 2])};
      w[i][0] = way[i].x, w[i][1] = way[i].y, w[i][2] = way[i].z;
      difference[i] = float_of(p[9 + i]);
      d[i] = difference[i];
    }
    const auto solved = solve_gradient<OneLane>(way, difference, 0x1p-16f);
    if (!solved.accepted) return -1.0;
    const float g[3] = {solved.gradient.x, solved.gradient.y, solved.gradient.z};
    if (!(std::isfinite(g[0]) && std::isfinite(g[1]) && std::isfinite(g[2]))) return 2.0;
    // The residual: what the gradient says of the three differences, beside these. Scaled by what the
    // gradient makes of a way at most.
    Exact worst = 0;
    Exact length = 0;
    for (const float x : g) length += Exact(x) * Exact(x);
    length = root(length);
    for (size_t i = 0; i < 3; ++i) {
      const Exact is = w[i][0] * g[0] + w[i][1] * g[1] + w[i][2] * g[2];
      const Exact way_length = root(w[i][0] * w[i][0] + w[i][1] * w[i][1] + w[i][2] * w[i][2]);
      // Renderers take differences in a unit near the width of the transfer function: 2^-100 is nothing.
      const Exact scale = way_length * length + magnitude(d[i]) + Exact(0x1p-100);
      if (!(scale > 0)) continue;
      worst = std::max(worst, magnitude(is - d[i]) / scale);
    }
    return to_double(worst);
  };
  const Worst found = climb(ranges, {unit, thin}, effort.tries * 2, effort.seed, look);
  std::string input;
  for (const int64_t v : found.at) input += fmt::format("{}{:a}", input.empty() ? "" : " ", float_of(v));
  report.add({"gradient from neighbouring rays, where it is accepted",
              "a difference off by 2⁻⁹ of way times gradient, or 2⁻¹⁰⁰",
              fmt::format("{:.4g} (2^{:.1f})", found.score, std::log2(found.score)), found.score <= 0x1p-9,
              found.tried, input});
}

// --- pictures

constexpr int64_t edge = 6;

std::shared_ptr<const DvrVolume> volume_of(const std::vector<float>& values, Context& ctx) {
  const VolumeInfo info = test::scalar_info(Index3(edge), SampleType::f32);
  test::MemorySource source(info, test::bytes_of(values));
  return std::make_shared<const DvrVolume>(must(DvrVolume::open(must(DenseGrid::read(source, ctx)), ctx)));
}
struct Look {
  DvrOptions options;
  std::optional<TransferFunction> transfer;
};
std::vector<Pixel> draw(const std::shared_ptr<const DvrVolume>& volume, const Look& look, Context& ctx) {
  const TransferFunction transfer =
      look.transfer ? *look.transfer : *transfer_preset("gray", volume->ranges().all());
  const DvrScene scene = must(DvrScene::create(volume, transfer, ctx));
  Frame frame;
  must(scene.draw(Camera::orbit(30, 20, 1.5, 40), look.options, frame, ctx));
  return frame.pixels;
}
bool same(const std::vector<Pixel>& a, const std::vector<Pixel>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Pixel)) == 0;
}
bool all_numbers(const std::vector<Pixel>& pixels) {
  return std::all_of(pixels.begin(), pixels.end(), [](const Pixel& p) {
    return std::all_of(p.color, p.color + 4, [](float c) { return c >= 0 && c <= 1.0001f; });
  });
}
DvrOptions small(int64_t kind) {
  DvrOptions options;
  options.width = 24, options.height = 16;
  options.step = 0.5;
  options.gradient = kind & 1 ? Gradient::neighbour : Gradient::analytic;
  options.modulate = kind & 2 ? 2 : 0;
  return options;
}

/// The same volume in other units: times a power of two, the picture is the same, bit by bit.
void units(const Effort& effort, Report& report) {
  std::vector<Range> ranges = {{-100, 100}, {0, 3}};
  ranges.insert(ranges.end(), edge * edge * edge, Range{-1024, 1024});
  Context ctx = stress_context();
  int64_t others = 0;
  const Worst found = climb(ranges, {}, effort.share(100), effort.seed, [&](const Point& p) {
    std::vector<float> plain, scaled;
    for (size_t i = 2; i < p.size(); ++i) {
      plain.push_back(static_cast<float>(p[i]));
      scaled.push_back(std::ldexp(static_cast<float>(p[i]), static_cast<int>(p[0])));
    }
    const Look look{small(p[1]), {}};
    const auto a = draw(volume_of(plain, ctx), look, ctx), b = draw(volume_of(scaled, ctx), look, ctx);
    int64_t different = 0;
    for (size_t i = 0; i < a.size(); ++i) different += std::memcmp(&a[i], &b[i], sizeof(Pixel)) != 0;
    others += different > 0;
    return static_cast<double>(different) + 1e-3 * static_cast<double>(std::abs(p[0]));
  });
  report.add({"a volume times 2^-100 … 2^100, drawn", "the same pixels",
              fmt::format("{:.0f} others", std::floor(found.score)), others == 0, found.tried,
              fmt::format("power {} kind {}", found.at[0], found.at[1])});
}

/// Voxels that are no numbers, or huge: skipping and vectors change nothing, and pixels are numbers.
void odd_voxels(const Effort& effort, Report& report) {
  std::vector<Range> ranges = {{0, 3}, {-1100, 1100}, {-1100, 1100}};
  ranges.insert(ranges.end(), edge * edge * edge, Range{0, 2200});
  Context ctx = stress_context();
  int64_t others = 0, no_numbers = 0;
  const Worst found = climb(ranges, {}, effort.share(50), effort.seed, [&](const Point& p) {
    std::vector<float> values;
    for (size_t i = 3; i < p.size(); ++i) {
      constexpr float inf = std::numeric_limits<float>::infinity(), most = std::numeric_limits<float>::max();
      const int64_t v = p[i];
      values.push_back(v == 2200   ? std::numeric_limits<float>::quiet_NaN()
                       : v == 2199 ? inf
                       : v == 2198 ? -inf
                       : v == 2197 ? most
                       : v == 2196 ? -most
                       : v == 2195 ? 1e-45f
                       : v == 2194 ? -0.0f
                                   : static_cast<float>(v) - 1100);
    }
    // Opaque between two values, so that bricks can be left out.
    const double lo = static_cast<double>(std::min(p[1], p[2])),
                 hi = static_cast<double>(std::max(p[1], p[2]));
    Look look{small(p[0]),
              TransferFunction({{lo, {1, 1, 1, 0}}, {hi, {1, 1, 1, 0.5}}, {hi + 1, {1, 1, 1, 0}}})};
    const auto volume = volume_of(values, ctx);
    const auto a = draw(volume, look, ctx);
    look.options.skip = false;
    const auto b = draw(volume, look, ctx);
    look.options.native = false;
    const auto c = draw(volume, look, ctx);
    look.transfer.reset();
    const auto d = draw(volume, look, ctx);
    const bool unequal = !same(a, b) || !same(b, c), odd = !all_numbers(a) || !all_numbers(d);
    others += unequal;
    no_numbers += odd;
    int64_t seen = 0;
    for (const Pixel& pixel : a) seen += pixel.color[3] > 0;
    return 1e6 * (unequal + odd) + static_cast<double>(seen);
  });
  std::string input;
  for (const int64_t v : found.at) input += fmt::format("{}{}", input.empty() ? "" : ",", v);
  report.add({"NaN, infinities, greatest and least floats, drawn",
              "pixels are numbers; the same without skipping, and without AVX2",
              fmt::format("{} no numbers, {} others", no_numbers, others), others + no_numbers == 0,
              found.tried, input});
}

void fill(const Effort& effort, Report& report) {
  cells(effort, report);
  neighbours(effort, report);
  units(effort, report);
  odd_voxels(effort, report);
}

}  // namespace
}  // namespace voxkit::stress

int main(int argc, char** argv) {
  return voxkit::stress::stress_main(argc, argv, "stress_gradients", "Samples and gradients", 400000,
                                     voxkit::stress::fill);
}
