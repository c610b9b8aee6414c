// What encoders promise about the greatest error of a voxel, at the limits of types.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/full_scale.h"
#include "libsvmm/svmm.h"
#include "libvq/layout.h"
#include "libvq/quantise.h"
#include "libvq/vq.h"
#include "tests/memory_volume.h"
#include "tests/stress/exact.h"
#include "tests/stress/report.h"
#include "tests/stress/search.h"

namespace voxkit::stress {
namespace {

using test::MemorySource;

std::string list(const Point& at) {
  std::string all;
  for (const int64_t v : at) all += fmt::format("{}{}", all.empty() ? "" : ",", v);
  return all;
}
std::shared_ptr<const Container> container_of(std::vector<std::byte> bytes) {
  const auto copy = std::make_shared<std::vector<std::byte>>(std::move(bytes));
  return must(Container::open(*copy, "memory", copy));
}
ByteSink append_to(std::vector<std::byte>& bytes) {
  return [&bytes](std::span<const std::byte> b) {
    bytes.insert(bytes.end(), b.begin(), b.end());
    return Status{};
  };
}

// --- vq-encode --max-error

/// Every value of an integer type, for bounds that are searched.
void integers(SampleType type, const char* name, const Effort& effort, Report& report) {
  VolumeInfo info = test::scalar_info({4, 4, 4}, type);
  const int64_t values = sample_bytes(type) == 1 ? 256 : 65536;
  // The bound in 1/16, so that some are no whole numbers, up to beyond what the type holds.
  const std::vector<Range> ranges = {{0, 16 * values + 100}};
  const Worst found = climb(ranges, {}, effort.share(100), effort.seed, [&](const Point& at) {
    vq::Options options;
    options.max_error = static_cast<double>(at[0]) / 16;
    const auto quantiser = must(vq::Quantiser::make(options, info));
    int64_t worst = 0;
    vq::Loss said;
    for (int64_t v = 0; v < values; ++v) {
      const Voxel voxel = Voxel::of(static_cast<uint32_t>(v));
      uint16_t code = 0;
      quantiser.codes(voxel.bytes.data(), 1, &code, said);
      const auto decoded = vq::voxel_of(code, info.format, quantiser.origin(), quantiser.step());
      worst = std::max(worst, std::abs(static_cast<int64_t>(decoded.as<uint32_t>()) - v));
    }
    // More than the bound, then as near to it as can be.
    const double beyond = static_cast<double>(worst) - *options.max_error;
    return said.greatest_error == static_cast<double>(worst) ? beyond : 1e9;
  });
  report.add({fmt::format("vq-encode --max-error E, {}, all values", name), "error - E at most 0",
              text(found.score), found.score <= 0, found.tried * values,
              fmt::format("E={}", static_cast<double>(found.at[0]) / 16)});
}

/// Floats: the range, a value in it, and a bound from the least that is possible on.
struct FloatCase {
  ValueRange range;
  float value;
  double bound;  ///< 0: none is asked for, floats get 65536 levels
};
FloatCase float_case(const Point& at, bool asked) {
  const int64_t lo = std::min(at[0], at[1]), hi = std::max(at[0], at[1]);
  FloatCase c{{static_cast<double>(float_of(lo)), static_cast<double>(float_of(hi))},
              float_of(lo + static_cast<int64_t>(static_cast<double>(hi - lo) *
                                                 (static_cast<double>(at[2]) * 0x1p-40))),
              0};
  c.value = std::clamp(c.value, static_cast<float>(c.range.lo), static_cast<float>(c.range.hi));
  if (at[3] != 0)
    c.value =
        static_cast<float>(c.range.lo + (c.range.hi - c.range.lo) * (static_cast<double>(at[2]) * 0x1p-40));
  if (asked) {
    const double rounding = std::ldexp(std::max({std::abs(c.range.lo), std::abs(c.range.hi), 0x1p-126}), -24);
    const double least = ((c.range.hi - c.range.lo) / 65534 / 2 + rounding) * (1 + 1e-9);
    c.bound = double_of(number_of(least) + at[4]);
  }
  return c;
}
void floats(bool asked, const Effort& effort, Report& report) {
  const std::vector<Range> ranges = {
      finite_floats, finite_floats, {0, int64_t{1} << 40}, {0, 1}, {0, int64_t{1} << 58}};
  VolumeInfo info = test::scalar_info({4, 4, 4}, SampleType::f32);
  const auto look = [&](const FloatCase& c, double* error) {
    vq::Options options;
    options.range = c.range;
    if (asked) options.max_error = c.bound;
    const auto quantiser = vq::Quantiser::make(options, info);
    if (!quantiser) return -1.0;  // the bound is too small
    uint16_t code = 0;
    vq::Loss said;
    const Voxel voxel = Voxel::of(c.value);
    quantiser->codes(voxel.bytes.data(), 1, &code, said);
    const auto decoded = vq::voxel_of(code, info.format, quantiser->origin(), quantiser->step()).as<float>();
    const Exact d = magnitude(Exact(decoded) - c.value);
    if (error != nullptr) *error = static_cast<double>(d);
    const Exact bound = asked ? c.bound : quantiser->bound();
    // Within: how near to the bound; beyond: by how much, as a number above 1.
    return std::isfinite(decoded) ? static_cast<double>(d / bound) + (d > bound ? 1e-9 : 0) : 1e9;
  };
  // Where the greatest value is a power of two, what is decoded above it is rounded twice as far; and bounds
  // that are just below a multiple of that.
  std::vector<Point> starts;
  for (const int exponent : {0, 100, -100})
    for (const double share : {0.0, 0.5, -1.0})
      for (const int units : {300, 1000, 12345}) {
        const double hi = std::ldexp(1.0, exponent);
        Point at = {number_of(static_cast<float>(hi * share)), number_of(static_cast<float>(hi)),
                    int64_t{1} << 40, 1, 0};
        const double bound = std::ldexp(hi, -23) * units, least = float_case(at, true).bound;
        if (bound > least) at[4] = number_of(bound) - number_of(least) - 1;
        starts.push_back(at);
      }
  const Worst found = climb(ranges, starts, effort.tries * 10, effort.seed,
                            [&](const Point& at) { return look(float_case(at, asked), nullptr); });
  const FloatCase c = float_case(found.at, asked);
  double error = 0;
  look(c, &error);
  report.add({asked ? "vq-encode --max-error E, floats" : "vq-encode, floats in 65536 levels",
              asked ? "error at most E" : "error at most what `error_bound` says",
              fmt::format("{:.12g} of the bound", found.score), found.score <= 1, found.tried,
              fmt::format("range {:a},{:a} value {:a} E {:a} error {:a}", c.range.lo, c.range.hi, c.value,
                          c.bound, error)});
}

/// A brick of any floats through the encoder and back: NaN and infinities in it.
void whole_file(const Effort& effort, Report& report) {
  // Two ranges of floats, and for each voxel where it is between them, or one of what is no number.
  std::vector<Range> ranges = {finite_floats, finite_floats, {0, int64_t{1} << 58}};
  for (int i = 0; i < 64; ++i) ranges.push_back({0, 1 << 20});
  VolumeInfo info = test::scalar_info({4, 4, 4}, SampleType::f32);
  Context ctx = stress_context();
  int64_t surprises = 0;
  const Worst found = climb(ranges, {}, effort.share(10), effort.seed, [&](const Point& at) {
    std::vector<float> values;
    double lo = std::numeric_limits<double>::infinity(), hi = -lo;
    for (size_t i = 3; i < ranges.size(); ++i) {
      const double share = static_cast<double>(at[i]) * 0x1p-20;
      const float v = at[i] == 1 << 20   ? std::numeric_limits<float>::quiet_NaN()
                      : at[i] == 0x80000 ? std::numeric_limits<float>::infinity()
                      : at[i] == 0x40000
                          ? -std::numeric_limits<float>::infinity()
                          : static_cast<float>(float_of(at[0]) * (1 - share) + float_of(at[1]) * share);
      values.push_back(v);
      if (std::isfinite(v)) lo = std::min<double>(lo, v), hi = std::max<double>(hi, v);
    }
    vq::Options options;
    options.range = lo <= hi ? ValueRange{lo, hi} : ValueRange{0, 0};
    const FloatCase like = float_case({number_of(static_cast<float>(options.range.lo)),
                                       number_of(static_cast<float>(options.range.hi)), 0, 0, at[2]},
                                      true);
    options.max_error = like.bound;
    MemorySource source(info, test::bytes_of(values));
    std::vector<std::byte> bytes;
    const auto report_of = vq::encode(source, options, append_to(bytes), ctx);
    if (!report_of) return -1.0;
    const auto volume = must(vq::Volume::open(container_of(std::move(bytes))));
    std::vector<float> decoded(64);
    must(volume->decode(info.box(),
                        packed(reinterpret_cast<std::byte*>(decoded.data()), info.dims, info.format)));
    Exact worst = 0;
    for (size_t i = 0; i < 64; ++i) {
      if (std::isfinite(values[i])) {
        worst = std::max(worst, magnitude(Exact(values[i]) - decoded[i]));
      } else {  // the ends of the range, as well as codes can
        const double end = values[i] > 0 ? options.range.hi : options.range.lo;
        surprises += !(magnitude(Exact(end) - decoded[i]) <= *options.max_error);
      }
    }
    return static_cast<double>(worst / *options.max_error) + 1e6 * static_cast<double>(surprises);
  });
  report.add({"vq-encode --max-error E, whole files of floats with NaN and infinities",
              "error of numbers at most E; others become ends of the range",
              fmt::format("{:.12g} of E, {} others", found.score, surprises), found.score <= 1, found.tried,
              list(found.at)});
}

// --- svmm-encode --delta

/// A volume of 4^3 voxels, twice side by side, so that there is a level between these and the root.
struct SvmmCase {
  VolumeInfo info;
  svmm::Params params;
  std::vector<std::byte> voxels;
};
constexpr int64_t edge = 4, voxels = edge * edge * edge;
const Index3 extent{2 * edge, edge, edge};

std::vector<Range> svmm_ranges(VoxelFormat f) {
  const Range value = f == VoxelFormat::float32     ? finite_floats
                      : f == VoxelFormat::density16 ? Range{0, 65535}
                      : f == VoxelFormat::bitmap    ? Range{0, 1}
                                                    : Range{0, 255};
  // Delta in units of 1/2^16 of the largest distance of two voxels, and a few ulps.
  std::vector<Range> ranges = {{0, 1 << 16}, {-3, 3}};
  for (int64_t i = 0; i < voxels * attributes(f); ++i) ranges.push_back(value);
  return ranges;
}
SvmmCase svmm_case(const Point& at, VoxelFormat f, svmm::Bound bound) {
  SvmmCase c;
  c.info = is_color(f) ? test::color_info(extent, f)
                       : test::scalar_info(extent, f == VoxelFormat::density8    ? SampleType::u8
                                                   : f == VoxelFormat::density16 ? SampleType::i16
                                                   : f == VoxelFormat::bitmap    ? SampleType::bit
                                                                                 : SampleType::f32);
  double lo = std::numeric_limits<double>::infinity(), hi = -lo;
  const int samples = attributes(f), bytes = is_color(f) ? 1 : voxel_bytes(f);
  for (int64_t i = 0; i < 2 * voxels * samples; ++i) {
    const int64_t row = i / samples / (2 * edge), x = i / samples % edge;
    const int64_t number = at[static_cast<size_t>(2 + (row * edge + x) * samples + i % samples)];
    const Voxel v =
        f == VoxelFormat::float32 ? Voxel::of(float_of(number)) : Voxel::of(static_cast<uint32_t>(number));
    const double value = f == VoxelFormat::float32 ? v.as<float>() : static_cast<double>(number);
    lo = std::min(lo, value), hi = std::max(hi, value);
    c.voxels.insert(c.voxels.end(), v.bytes.begin(), v.bytes.begin() + bytes);
  }
  c.params.full_scale = full_scale(c.info, {lo, hi});
  c.params.bound = bound;
  c.params.blockwidths = {2};
  c.params.rootwidth = 1;
  const double most = std::sqrt(static_cast<double>(attributes(f)));
  c.params.delta = static_cast<double>(at[0]) * 0x1p-16 * most;
  if (c.params.delta > 0) c.params.delta = double_of(number_of(c.params.delta) + at[1]);
  return c;
}

/// A voxel a distance above the mean of its block, and that mean as far above the mean of all: for the local
/// bound.
Point two_steps(VoxelFormat f) {
  const double full = f == VoxelFormat::density16 ? 65535 : f == VoxelFormat::float32 ? 1 : 255;
  const double delta = full / 4 * 0.98, base = full / 4;  // a little less, for rounding
  // The full scale of floats is their own range, 15/7 of delta.
  Point at = {f == VoxelFormat::float32 ? 65536 * 7 / 15 + 600 : 1 << 14, 0};
  for (int64_t i = 0; i < voxels; ++i) {
    const int64_t x = i % edge, y = i / edge % edge, z = i / (edge * edge);
    const bool first = x < 2 && y < 2 && z < 2;
    const double value = base + (i == 0 ? 2 * delta : first ? delta * 6 / 7 : -delta / 7);
    for (int k = 0; k < attributes(f); ++k)
      at.push_back(f == VoxelFormat::float32  ? number_of(static_cast<float>(value))
                   : f == VoxelFormat::bitmap ? value > base
                   : k == 3                   ? 255
                                              : static_cast<int64_t>(value));
  }
  return at;
}

/// The square of the greatest distance between the voxels of two memories, in units of stored values.
Exact greatest_square(const std::byte* a, const std::byte* b, VoxelFormat f) {
  Exact greatest = 0;
  for (int64_t i = 0; i < 2 * voxels; ++i) {
    Exact square = 0;
    const auto difference = [&](auto zero) {
      using T = decltype(zero);
      const Exact d = static_cast<Exact>(load_le<T>(a)) - static_cast<Exact>(load_le<T>(b));
      square += d * d;
      a += sizeof(T), b += sizeof(T);
    };
    for (int k = 0; k < attributes(f); ++k) {
      if (f == VoxelFormat::float32)
        difference(float{});
      else if (f == VoxelFormat::density16)
        difference(uint16_t{});
      else
        difference(uint8_t{});
    }
    greatest = std::max(greatest, square);
  }
  return greatest;
}

void svmm_bound(VoxelFormat f, svmm::Bound bound, const Effort& effort, Report& report) {
  Context ctx = stress_context();
  const auto ranges = svmm_ranges(f);
  const bool global = bound == svmm::Bound::global;
  // The local bound holds from level to level: here there are two steps from the root to the voxels.
  const int steps = global ? 1 : 2;
  int64_t stored = 0;
  const auto look = [&](const Point& at) {
    SvmmCase c = svmm_case(at, f, bound);
    MemorySource source(c.info, c.voxels);
    std::vector<std::byte> bytes;
    must(svmm::encode(source, c.params, append_to(bytes), ctx));
    stored = static_cast<int64_t>(bytes.size());
    const auto volume = must(svmm::Volume::open(container_of(std::move(bytes))));
    std::vector<std::byte> decoded(c.voxels.size());
    must(volume->decode(c.info.box(), 0, packed(decoded.data(), c.info.dims, f)));
    const Exact square = greatest_square(c.voxels.data(), decoded.data(), f);
    const Exact allowed = Exact(c.params.delta) * c.params.full_scale * steps;
    if (square == 0) return -static_cast<double>(stored) * 1e-9;
    if (allowed == 0) return 1e9;
    const double share = static_cast<double>(square / (allowed * allowed));
    // The product of delta and full scale is a double; and so is its square.
    return share;
  };
  const Worst found = climb(ranges, {two_steps(f)}, effort.share(4), effort.seed, look);
  const SvmmCase c = svmm_case(found.at, f, bound);
  const double share = found.score <= 0 ? 0 : std::sqrt(found.score);
  report.add(
      {fmt::format("svmm-encode --bound {}, {}", global ? "global" : "local", name(f)),
       global ? "error at most δ (1 + 2⁻⁵²)" : "error at most δ (1 + 2⁻⁵²) for each level",
       fmt::format("{:.12g} of it", share), share <= 1 + 0x1p-52, found.tried,
       fmt::format("delta {:a} voxels {}", c.params.delta, list({found.at.begin() + 2, found.at.end()}))});
}

void fill(const Effort& effort, Report& report) {
  integers(SampleType::u8, "u8", effort, report);
  integers(SampleType::i8, "i8", effort, report);
  integers(SampleType::u16, "u16", effort, report);
  integers(SampleType::i16, "i16", effort, report);
  floats(true, effort, report);
  floats(false, effort, report);
  whole_file(effort, report);
  for (const auto bound : {svmm::Bound::global, svmm::Bound::local})
    for (const auto f : {VoxelFormat::rgba32, VoxelFormat::rgb24, VoxelFormat::density8,
                         VoxelFormat::density16, VoxelFormat::float32, VoxelFormat::bitmap})
      svmm_bound(f, bound, effort, report);
}

}  // namespace
}  // namespace voxkit::stress

int main(int argc, char** argv) {
  return voxkit::stress::stress_main(argc, argv, "stress_bounds", "Error bounds of volumes", 200000,
                                     voxkit::stress::fill);
}
