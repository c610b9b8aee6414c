// Blocks of colours: whether any decoded colour is beyond the threshold, and what that costs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "libcolor/blocks/block_encode.h"
#include "libcolor/blocks/block_fit.h"
#include "libcolor/blocks/lab_colors.h"
#include "libcolor/palette/palette.h"
#include "libcolor/textures/bc1.h"
#include "libsvmm/base_block.h"
#include "tests/stress/exact.h"
#include "tests/stress/report.h"
#include "tests/stress/search.h"

namespace voxkit::stress {
namespace {

using namespace color;

constexpr size_t count = 24, samples = 3 * count;

std::string list(const std::vector<Rgb>& colors) {
  std::string all;
  for (const Rgb c : colors)
    all += fmt::format("{}{:02x}{:02x}{:02x}", all.empty() ? "" : " ", c.r, c.g, c.b);
  return all;
}
std::vector<Rgb> colors_of(const Point& at, size_t first) {
  std::vector<Rgb> colors;
  for (size_t i = first; i + 2 < at.size(); i += 3)
    colors.push_back(
        {static_cast<uint8_t>(at[i]), static_cast<uint8_t>(at[i + 1]), static_cast<uint8_t>(at[i + 2])});
  return colors;
}
/// Where colours are known to be hard: of the kinds that books name, behind `before`.
std::vector<Point> hard_colors(const Point& before) {
  std::vector<Point> all;
  const auto add = [&](auto color) {
    Point at = before;
    for (int i = 0; i < static_cast<int>(count); ++i)
      for (int c = 0; c < 3; ++c) at.push_back(std::clamp(color(i, c), 0, 255));
    all.push_back(at);
  };
  add([](int, int) { return 128; });                                 // one
  add([](int i, int) { return i % 2 * 255; });                       // two
  add([](int i, int c) { return i % 2 * (c == 1); });                // one step apart
  add([](int i, int c) { return i * (c + 1) * 3; });                 // collinear
  add([](int i, int c) { return i * (c + 1) * 3 + (i % 3 == c); });  // nearly
  add([](int i, int c) { return (i >> c & 1) * 255; });              // corners of the cube
  add([](int i, int c) { return 100 + (i >> c & 1); });              // those of a cell
  add([](int i, int c) { return c == 0 ? i * 10 : 7; });             // along an axis
  add([](int i, int c) { return c == i % 3 ? 255 : 0; });            // primary
  add([](int i, int c) { return i == 11 ? 255 - c : 4 * c; });       // one of its own
  return all;
}

// --- thresholds

/// L*, a* and b* by the formulas, with the library's powers.
struct LabReference {
  std::array<long double, 3> operator()(Rgb c) const {
    const auto linear = [](uint8_t v) {
      const long double s = v / 255.0L;
      return s <= 0.04045L ? s / 12.92L : std::pow((s + 0.055L) / 1.055L, 2.4L);
    };
    const long double r = linear(c.r), g = linear(c.g), b = linear(c.b);
    const auto curve = [](long double t) {
      constexpr long double d = 6.0L / 29;
      return t > d * d * d ? std::cbrt(t) : t / (3 * d * d) + 4.0L / 29;
    };
    const long double x = curve((0.4124L * r + 0.3576L * g + 0.1805L * b) / 0.9505L),
                      y = curve(0.2126L * r + 0.7152L * g + 0.0722L * b),
                      z = curve((0.0193L * r + 0.1192L * g + 0.9505L * b) / 1.0890L);
    return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
  }
};
/// Squared.
long double distance_of(Rgb a, Rgb b, ErrorSpace space) {
  long double sum = 0;
  if (space == ErrorSpace::lab) {
    const auto p = LabReference{}(a), q = LabReference{}(b);
    for (size_t k = 0; k < 3; ++k) sum += (p[k] - q[k]) * (p[k] - q[k]);
  } else {
    for (const int d : {a.r - b.r, a.g - b.g, a.b - b.b}) sum += d * d;
  }
  return sum;
}

struct Coded {
  EncodedPart part;
  std::vector<Rgb> decoded;
};
Coded code(const std::vector<Rgb>& colors, const BlockOptions& options) {
  Coded coded{encode_part(colors, options), {}};
  const PartView view(coded.part.bytes.data(), coded.part.bytes.size(), static_cast<uint32_t>(colors.size()),
                      endpoints_for(options.threshold, options.space));
  if (!view.valid()) must_not_happen("a part that is not valid");
  for (uint32_t i = 0; i < colors.size(); ++i) coded.decoded.push_back(view.color(i));
  return coded;
}

/// Thresholds from 1/2 on: in 1/1024, or roots of whole numbers, where distances can be equal to them, and
/// beside these.
double threshold_of(int64_t number, int64_t ulps) {
  const double t = number % 2 == 0 ? static_cast<double>(number / 2) / 1024
                                   : std::sqrt(static_cast<double>(number / 2 % 200000));
  return t > 0 ? double_of(number_of(t) + ulps) : 0;
}

void thresholds(ErrorSpace space, int weight_bits, const char* name, const Effort& effort, Report& report) {
  std::vector<Range> ranges = {{1024, 920000}, {-2, 2}, {1, 9}};
  ranges.insert(ranges.end(), samples, Range{0, 255});
  std::vector<Point> starts;
  for (const double t : {0.5, 1.0, 2.3, 5.34, 6.12, 6.14, 9.56, 25.5, 442.0})
    for (const Point& at : hard_colors({static_cast<int64_t>(t * 2048), 0, 3})) starts.push_back(at);
  const auto options_of = [&](const Point& at) {
    BlockOptions options;
    options.threshold = threshold_of(at[0], at[1]);
    options.weight_bits = weight_bits;
    options.effort = static_cast<int>(at[2]);
    options.space = space;
    return options;
  };
  int64_t said_less = 0;
  const Worst found = climb(ranges, starts, effort.tries, effort.seed, [&](const Point& at) {
    const BlockOptions options = options_of(at);
    const std::vector<Rgb> colors = colors_of(at, 3);
    const Coded coded = code(colors, options);
    long double worst = 0;
    uint64_t squared = 0;
    for (size_t i = 0; i < colors.size(); ++i) {
      worst = std::max(worst, distance_of(colors[i], coded.decoded[i], space));
      squared += static_cast<uint64_t>(distance_of(colors[i], coded.decoded[i], ErrorSpace::rgb));
    }
    said_less += squared != coded.part.squared_error;
    // An ulp of the threshold is what its square may round.
    return static_cast<double>(std::sqrt(worst) / options.threshold / (1 + 0x1p-52L));
  });
  const BlockOptions options = options_of(found.at);
  report.add({name, "within the threshold (1 + 2⁻⁵²); errors are those said",
              fmt::format("{:.9g} of it, at {:.5g}; {} others", found.score, options.threshold, said_less),
              found.score <= 1 && said_less == 0, found.tried,
              fmt::format("threshold {:a} effort {} colours {}", options.threshold, options.effort,
                          list(colors_of(found.at, 3)))});
}

void lossless(const Effort& effort, Report& report) {
  std::vector<Range> ranges = {{0, 4}, {1, 9}, {0, 1}};
  ranges.insert(ranges.end(), samples, Range{0, 255});
  const Worst found =
      climb(ranges, hard_colors({0, 3, 0}), effort.share(2), effort.seed, [&](const Point& at) {
        const BlockOptions options{0, static_cast<int>(at[0]), static_cast<int>(at[1]),
                                   at[2] != 0 ? ErrorSpace::lab : ErrorSpace::rgb};
        const std::vector<Rgb> colors = colors_of(at, 3);
        const Coded coded = code(colors, options);
        int64_t lost = 0;
        for (size_t i = 0; i < colors.size(); ++i) lost += !(colors[i] == coded.decoded[i]);
        // Colours as they are take 24 bits each: towards what is coded in blocks.
        return static_cast<double>(lost) +
               (coded.part.blocks > 0 ? 1e-3 / static_cast<double>(coded.part.blocks) : 0);
      });
  report.add({"threshold 0", "every colour as it was", fmt::format("{:.0f} others", std::floor(found.score)),
              found.score < 1, found.tried, list(colors_of(found.at, 3))});
}

// --- sizes

/// Optimal parsing beside greedy merging.
void sizes(ErrorSpace space, bool promised, const Effort& effort, Report& report) {
  std::vector<Range> ranges = {{1024, 920000}, promised ? Range{greedy_too, 9} : Range{2, greedy_too - 1}};
  ranges.insert(ranges.end(), samples, Range{0, 255});
  std::vector<Point> starts;
  for (const double t : {1.0, 6.38, 9.56, 25.5})
    for (const Point& at : hard_colors({static_cast<int64_t>(t * 2048), promised ? greedy_too : 3}))
      starts.push_back(at);
  const auto bytes = [&](const Point& at, int own_effort) {
    BlockOptions options;
    options.threshold = threshold_of(at[0], 0);
    options.effort = own_effort;
    options.space = space;
    return static_cast<double>(encode_part(colors_of(at, 2), options).bytes.size());
  };
  const Worst found = climb(ranges, starts, effort.share(2), effort.seed, [&](const Point& at) {
    const double optimal = bytes(at, static_cast<int>(at[1])), greedy = bytes(at, 1);
    return optimal - greedy;
  });
  report.add({fmt::format("optimal parsing, effort {}, {}", promised ? "4 to 9" : "2 and 3",
                          space == ErrorSpace::rgb ? "RGB" : "CIELAB"),
              promised ? "no more bytes than with effort 1" : "", fmt::format("{:+.0f} bytes", found.score),
              !promised || found.score <= 0, found.tried,
              fmt::format("threshold {:a} effort {} colours {}", threshold_of(found.at[0], 0), found.at[1],
                          list(colors_of(found.at, 2)))});
}

// --- kernels

/// The fits of all machines are the same.
void kernels(const Effort& effort, Report& report) {
  std::vector<Range> ranges = {{0, 4}, {0, 200000}};
  ranges.insert(ranges.end(), 6, Range{0, 255});
  ranges.insert(ranges.end(), samples, Range{0, 255});
  std::vector<Point> starts;
  for (const Point& at : hard_colors({3, 1000, 0, 0, 0, 255, 255, 255})) starts.push_back(at);
  int64_t unequal = 0;
  Point unequal_at;
  double most = 0;
  const Worst found = climb(ranges, starts, effort.tries, effort.seed, [&](const Point& at) {
    const MacroColors colors(colors_of(at, 8));
    const ColorRun run{{colors.channel(0), colors.channel(1), colors.channel(2)}, colors.size()};
    std::array<float, 3> a{}, b{};
    for (size_t k = 0; k < 3; ++k) a[k] = static_cast<float>(at[2 + k]), b[k] = static_cast<float>(at[5 + k]);
    const int weights = at[0] == 0 ? 1 : (1 << at[0]) - 1;
    std::array<std::array<uint8_t, count + 32>, 2> own{};
    std::array<Distances, 2> d;
    std::array<Extent, 2> e;
    for (const bool native : {false, true}) {
      const BlockKernels& k = block_kernels(native);
      d[native] = k.distances(run, a, b, weights, static_cast<uint32_t>(at[1]), own[native].data());
      e[native] = k.extent(run, a);
    }
    // They may end early at other colours: then what is too far is all that they say.
    const auto allowed = static_cast<uint32_t>(at[1]);
    const bool far = d[0].most > allowed;
    const bool same = far ? d[1].most > allowed
                          : d[0].most == d[1].most && d[0].sum == d[1].sum &&
                                std::equal(own[0].begin(), own[0].begin() + count, own[1].begin());
    if (!same || e[0].least != e[1].least || e[0].most != e[1].most) {
      ++unequal;
      unequal_at = at;
    }
    // What is nearest along the line may not be the nearest: how much further off is it?
    double worst = 0;
    for (size_t i = 0; i < count && !far; ++i) {
      const Rgb color = colors.color(static_cast<uint32_t>(i));
      const auto at_step = [&](uint32_t w) {
        const Rgb p{static_cast<uint8_t>(at[2]), static_cast<uint8_t>(at[3]), static_cast<uint8_t>(at[4])},
            q{static_cast<uint8_t>(at[5]), static_cast<uint8_t>(at[6]), static_cast<uint8_t>(at[7])};
        return std::sqrt(static_cast<double>(
            distance_of(color, mix(p, q, w, static_cast<uint32_t>(weights)), ErrorSpace::rgb)));
      };
      double nearest = 1e9;
      for (uint32_t w = 0; w <= static_cast<uint32_t>(weights); ++w) nearest = std::min(nearest, at_step(w));
      worst = std::max(worst, at_step(own[0][i]) - nearest);
    }
    most = std::max(most, worst);
    return worst;
  });
  report.add({"weights of a block, AVX2 beside portable", "0 others", fmt::format("{} others", unequal),
              unequal == 0, found.tried, unequal == 0 ? "" : list(colors_of(unequal_at, 8))});
  report.add({"nearest along the line, beside the nearest", "further by less than 1.74 (two roundings)",
              fmt::format("{:.4g}", most), most < 1.74, found.tried,
              fmt::format("bits {} ends {:02x}{:02x}{:02x} {:02x}{:02x}{:02x} colours {}", found.at[0],
                          found.at[2], found.at[3], found.at[4], found.at[5], found.at[6], found.at[7],
                          list(colors_of(found.at, 8)))});
}

/// CIELAB from tables, beside the formulas: all colours on a lattice, then searched.
void lab(const Effort& effort, Report& report) {
  const std::vector<Range> ranges(6, Range{0, 255});
  const Worst found = climb(ranges, {}, effort.tries * 4, effort.seed, [&](const Point& at) {
    const auto two = colors_of(at, 0);
    long double fast = 0;
    const LabPoint p = lab_colors().point(two[0]), q = lab_colors().point(two[1]);
    for (size_t k = 0; k < 3; ++k) {
      const long double d = (static_cast<long double>(p[k]) - q[k]) / lab_scale;
      fast += d * d;
    }
    return static_cast<double>(
        std::abs(std::sqrt(fast) - std::sqrt(distance_of(two[0], two[1], ErrorSpace::lab))));
  });
  report.add({"distances in CIELAB, from tables", fmt::format("off by at most {:.4g}", lab_precision),
              fmt::format("{:.4g}", found.score), found.score <= lab_precision, found.tried,
              list(colors_of(found.at, 0))});
}

// --- textures and palettes

/// BC1 beside the best single colour of 16 bits, which every block can have.
void bc1(const Effort& effort, Report& report) {
  const std::vector<Range> ranges(48, Range{0, 255});
  std::vector<Point> starts;
  for (Point at : hard_colors({})) at.resize(48), starts.push_back(at);
  const Worst found = climb(ranges, starts, effort.share(10), effort.seed, [&](const Point& at) {
    const std::vector<Rgb> colors = colors_of(at, 0);
    Pixels16 pixels, decoded;
    std::copy(colors.begin(), colors.end(), pixels.begin());
    std::array<std::byte, bc1_block_bytes> block;
    encode_bc1(pixels, 3, block.data());
    decode_bc1(block.data(), decoded);
    double error = 0, single = 0;
    const auto channel = [&](uint8_t Rgb::*c, uint32_t steps) {
      double best = 1e18;
      for (uint32_t v = 0; v <= steps; ++v) {
        double sum = 0;
        const int is = steps == 31 ? from_5_bits(v) : from_6_bits(v);
        for (const Rgb p : pixels) sum += (p.*c - is) * (p.*c - is);
        best = std::min(best, sum);
      }
      return best;
    };
    single = channel(&Rgb::r, 31) + channel(&Rgb::g, 63) + channel(&Rgb::b, 31);
    for (size_t i = 0; i < 16; ++i)
      error += static_cast<double>(distance_of(pixels[i], decoded[i], ErrorSpace::rgb));
    return error - single;
  });
  report.add({"BC1 of surfaces", "squared error no more than of the best single colour",
              fmt::format("{:+.4g}", found.score), found.score <= 0, found.tried,
              list(colors_of(found.at, 0))});
}

/// Base levels of sparse voxel mip-maps that are lossy: what they promise of each voxel.
void base(svmm::Base kind, const char* name, const Effort& effort, Report& report) {
  constexpr int64_t voxels = 64;
  std::vector<Range> ranges;
  for (int64_t i = 0; i < voxels; ++i) ranges.insert(ranges.end(), {{0, 255}, {0, 255}, {0, 255}, {0, 255}});
  double void_broken = 0;
  const Worst found = climb(ranges, {}, effort.share(10), effort.seed, [&](const Point& at) {
    std::vector<std::byte> in, out, back(4 * voxels);
    for (const int64_t v : at) in.push_back(static_cast<std::byte>(v));
    const Index3 size(4);
    svmm::encode_base_block(in.data(), size, VoxelFormat::rgba32, kind, svmm::Layout::plain, out);
    out.resize(out.size() + 8);  // what decoders may read beyond
    svmm::decode_base_block(out.data(), size, VoxelFormat::rgba32, kind, svmm::Layout::plain, {},
                            back.data());
    double worst = 0;
    for (size_t s = 0; s < voxels; s += 8) {
      int sum[3] = {}, occupied = 0;
      for (size_t i = s; i < s + 8; ++i)
        if (in[4 * i + 3] != std::byte{0})
          for (size_t k = 0; k < 3; ++k) sum[k] += std::to_integer<int>(in[4 * i + k]), occupied += k == 0;
      for (size_t i = s; i < s + 8; ++i) {
        const bool is_void = in[4 * i + 3] == std::byte{0};
        if (is_void != (back[4 * i + 3] == std::byte{0})) void_broken = 1;
        if (is_void) continue;
        const auto was = [&](size_t k) { return std::to_integer<int>(in[4 * i + k]); };
        for (size_t k = 0; k < 3; ++k) {
          const double is = std::to_integer<int>(back[4 * i + k]);
          if (kind == svmm::Base::gray)
            worst = std::max(
                worst, std::abs(is - std::max(1.0, 0.2126 * was(0) + 0.7152 * was(1) + 0.0722 * was(2))));
          else if (kind == svmm::Base::bc1)
            worst = std::max(worst, std::abs(is - was(k)));
          else
            worst = std::max(worst, std::abs(is - static_cast<double>(sum[k]) / occupied));
        }
      }
    }
    return worst + 1e6 * void_broken;
  });
  const bool bounded = kind != svmm::Base::bc1;
  const double most = kind == svmm::Base::gray ? 0.502 : 0.5;
  std::string input;
  for (const int64_t v : found.at) input += fmt::format("{:02x}", v);
  report.add(
      {fmt::format("svmm-encode --base {}", name),
       kind == svmm::Base::gray ? "void stays void, and nothing else is; luma off by 0.502"
       : bounded                ? "void stays void, and nothing else is; the mean off by 0.5"
                                : "void stays void, and nothing else is",
       bounded ? fmt::format("{:.4g}", found.score) : fmt::format("a channel off by {:.0f}", found.score),
       void_broken == 0 && (!bounded || found.score <= most), found.tried, input});
}

void palette(const Effort& effort, Report& report) {
  Context ctx = stress_context();
  std::vector<Range> ranges = {{1, 24}, {1, 9}};
  ranges.insert(ranges.end(), samples, Range{0, 255});
  std::vector<Point> starts;
  for (const Point& at : hard_colors({4, 3})) starts.push_back(at);
  int64_t not_nearest = 0, lost = 0;
  const Worst found = climb(ranges, starts, effort.share(200), effort.seed, [&](const Point& at) {
    const std::vector<Rgb> colors = colors_of(at, 2);
    std::vector<Rgb> different;
    for (const Rgb c : colors)
      if (std::find(different.begin(), different.end(), c) == different.end()) different.push_back(c);
    const Palette chosen =
        must(Palette::choose(colors, static_cast<uint32_t>(at[0]), static_cast<int>(at[1]), ctx));
    double error = 0;
    for (const Rgb c : colors) {
      const auto to = [&](Rgb p) { return distance_of(c, p, ErrorSpace::rgb); };
      const long double own = to(chosen.colors()[chosen.index_of(c)]);
      for (const Rgb p : chosen.colors()) not_nearest += to(p) < own;
      error += static_cast<double>(own);
    }
    const bool all = different.size() <= static_cast<size_t>(at[0]);
    lost += all && error != 0;
    lost += chosen.colors().size() > static_cast<size_t>(at[0]);
    return error + 1e9 * static_cast<double>(lost + not_nearest);
  });
  report.add({"palettes", "each colour gets the nearest; all colours where there is room",
              fmt::format("{} others, {} lost", not_nearest, lost), not_nearest + lost == 0, found.tried,
              fmt::format("colours {} of {}", found.at[0], list(colors_of(found.at, 2)))});
}

void fill(const Effort& effort, Report& report) {
  thresholds(ErrorSpace::rgb, 0, "vws, RGB", effort, report);
  thresholds(ErrorSpace::lab, 0, "vws, CIELAB", effort, report);
  for (const int bits : {1, 2, 3, 4})
    thresholds(ErrorSpace::rgb, bits, fmt::format("fws, {} bits, RGB", bits).c_str(), effort, report);
  thresholds(ErrorSpace::lab, 3, "fws, 3 bits, CIELAB", effort, report);
  lossless(effort, report);
  for (const bool promised : {true, false})
    for (const auto space : {ErrorSpace::rgb, ErrorSpace::lab}) sizes(space, promised, effort, report);
  kernels(effort, report);
  lab(effort, report);
  bc1(effort, report);
  base(svmm::Base::bitmap, "bitmap", effort, report);
  base(svmm::Base::alpha, "alpha", effort, report);
  base(svmm::Base::gray, "gray", effort, report);
  base(svmm::Base::bc1, "bc1", effort, report);
  palette(effort, report);
}

}  // namespace
}  // namespace voxkit::stress

int main(int argc, char** argv) {
  return voxkit::stress::stress_main(argc, argv, "stress_blocks", "Colours in blocks", 100000,
                                     voxkit::stress::fill);
}
