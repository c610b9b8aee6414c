// Averages of many voxels, as levels of a sparse voxel mip-map have them, beside exact ones.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "libsvmm/moments.h"
#include "tests/stress/exact.h"
#include "tests/stress/report.h"
#include "tests/stress/search.h"

namespace voxkit::stress {
namespace {

using svmm::Criterion;
using svmm::Moments;
using svmm::Params;
using Wide = unsigned __int128;

/// The same sums as Moments, in 128 bits or 113.
struct Reference {
  Wide count = 0, sum[4] = {}, weighted[3] = {};
  Exact real = 0, finite = 0;
};

/// A volume as a tree: at each level, `mask` says which of the eight children are the one that is built from
/// below, and which are a block of one value, as many voxels.
struct Step {
  uint8_t mask;
  Voxel value;
};

template <VoxelFormat F>
Reference reference_of(const Voxel& v, Wide n) {
  Reference r;
  r.count = n;
  if constexpr (F == VoxelFormat::float32) {
    const float x = v.as<float>();
    if (std::isfinite(x)) r.real = Exact(x) * static_cast<Exact>(n), r.finite = static_cast<Exact>(n);
  } else if constexpr (is_color(F)) {
    for (size_t k = 0; k < 4; ++k) r.sum[k] = n * std::to_integer<uint32_t>(v.bytes[k]);
    for (size_t k = 0; k < 3; ++k) r.weighted[k] = r.sum[k] * std::to_integer<uint32_t>(v.bytes[3]);
  } else {
    r.sum[0] = n * v.as<uint32_t>();
  }
  return r;
}
void add(Reference& r, const Reference& o) {
  r.count += o.count;
  for (size_t k = 0; k < 4; ++k) r.sum[k] += o.sum[k];
  for (size_t k = 0; k < 3; ++k) r.weighted[k] += o.weighted[k];
  r.real += o.real;
  r.finite += o.finite;
}
Wide rounded(Wide a, Wide b) {
  return b == 0 ? 0 : (2 * a + b) / (2 * b);
}

/// How far the average is from the exact one: integers in units of the stored value; floats in units of the
/// greatest magnitude of a voxel times 2^-53.
template <VoxelFormat F>
double error_of(const Moments<F>& m, const Reference& r, const Criterion& criterion, double greatest) {
  if (m.count != static_cast<uint64_t>(r.count)) return 1e9;
  const Voxel is = m.value(criterion);
  if (is_color(F) && m.uniform()) {  // of equal voxels, that voxel: its colour, too, where alpha is 0
    for (size_t k = 0; k < static_cast<size_t>(attributes(F)); ++k)
      if (rounded(r.sum[k], r.count) != std::to_integer<uint32_t>(is.bytes[k])) return 1e9;
    return 0;
  }
  if constexpr (F == VoxelFormat::float32) {
    if (r.finite == 0) return 0;
    const Exact mean = r.real / r.finite;
    const float value = is.as<float>();
    // What rounding to a float may add is no fault of the sums.
    const float magnitude_of = std::abs(static_cast<float>(mean));
    const Exact half_ulp =
        (Exact(std::nextafter(magnitude_of, std::numeric_limits<float>::infinity())) - Exact(magnitude_of)) /
        2;
    const Exact beyond = magnitude(Exact(value) - mean) - half_ulp;
    return greatest == 0 ? 0 : std::max(0.0, to_double(beyond / (Exact(greatest) * Exact(0x1p-53))));
  } else if constexpr (is_color(F)) {
    double worst = 0;
    const auto look = [&](size_t k, Wide expected) {
      worst = std::max(worst, std::abs(static_cast<double>(std::to_integer<int>(is.bytes[k])) -
                                       static_cast<double>(expected)));
    };
    for (size_t k = 0; k < 3; ++k)
      look(k, criterion.alpha_weight ? rounded(r.weighted[k], r.sum[3]) : rounded(r.sum[k], r.count));
    if (F == VoxelFormat::rgba32) look(3, rounded(r.sum[3], r.count));
    return worst;
  } else {
    const Wide sum = F == VoxelFormat::bitmap ? r.sum[0] * 255 : r.sum[0];
    return std::abs(static_cast<double>(is.as<uint32_t>()) - static_cast<double>(rounded(sum, r.count)));
  }
}

/// `levels` of eight children each: 8^levels voxels.
template <VoxelFormat F>
void average(int levels, const Effort& effort, Report& report) {
  const Range value = F == VoxelFormat::float32     ? finite_floats
                      : F == VoxelFormat::density16 ? Range{0, 65535}
                      : F == VoxelFormat::bitmap    ? Range{0, 1}
                      : is_color(F)                 ? Range{0, 0xffffffff}
                                                    : Range{0, 255};
  std::vector<Range> ranges = {value};
  for (int i = 0; i < levels; ++i) ranges.insert(ranges.end(), {value, {0, 255}});
  Params params;
  const Criterion criterion(params, F);
  const auto voxel_of = [](int64_t number) {
    return F == VoxelFormat::float32 ? Voxel::of(float_of(number)) : Voxel::of(static_cast<uint32_t>(number));
  };
  const auto look = [&](const Point& at) {
    Moments<F> m;
    Voxel first = voxel_of(at[0]);
    m.add(first.bytes.data(), 1, criterion);
    Reference r = reference_of<F>(first, 1);
    double greatest = F == VoxelFormat::float32 ? std::abs(first.as<float>()) : 0;
    uint64_t n = 1;
    for (size_t level = 0; level < static_cast<size_t>(levels); ++level, n *= 8) {
      const Voxel other = voxel_of(at[1 + 2 * level]);
      const auto mask = static_cast<uint64_t>(at[2 + 2 * level]);
      if (F == VoxelFormat::float32 && mask != 255)
        greatest = std::max<double>(greatest, std::abs(other.as<float>()));
      Moments<F> parent, uniform;
      uniform.add_uniform(other, n, criterion);
      Reference sums;
      for (int i = 0; i < 8; ++i) {
        parent.add(mask >> i & 1 ? m : uniform);
        add(sums, mask >> i & 1 ? r : reference_of<F>(other, n));
      }
      m = parent;
      r = sums;
    }
    // Where nothing is wrong, towards larger sums.
    const Wide largest = std::max({r.weighted[0], r.weighted[1], r.weighted[2], r.sum[0]});
    return error_of(m, r, criterion, greatest) +
           (F == VoxelFormat::float32 ? 0 : 1e-3 * std::log2(static_cast<double>(largest) + 1));
  };
  const Worst found = climb(ranges, {}, effort.tries, effort.seed, look);
  std::string input;
  for (const int64_t v : found.at) input += fmt::format("{}{}", input.empty() ? "" : ",", v);
  const int bits = 3 * levels;
  if (F == VoxelFormat::float32) {
    const int chain = 8 * levels;
    report.add({fmt::format("average of 2^{} voxels, {}", bits, name(F)),
                fmt::format("off by {} · 2⁻⁵³ of the greatest voxel, and rounding to a float", chain),
                fmt::format("{:.3g} · 2⁻⁵³", found.score), found.score <= chain, found.tried, input});
  } else {
    report.add({fmt::format("average of 2^{} voxels, {}", bits, name(F)), "exact, rounded once: off by 0",
                fmt::format("{:.0f}; sums of {:.2f} bits", std::floor(found.score),
                            1000 * (found.score - std::floor(found.score))),
                found.score < 1, found.tried, input});
  }
}

template <VoxelFormat F>
void averages(const Effort& effort, Report& report) {
  for (const int levels : {1, 11, 16}) average<F>(levels, effort, report);
}

void fill(const Effort& effort, Report& report) {
  averages<VoxelFormat::rgba32>(effort, report);
  averages<VoxelFormat::rgb24>(effort, report);
  averages<VoxelFormat::density8>(effort, report);
  averages<VoxelFormat::density16>(effort, report);
  averages<VoxelFormat::bitmap>(effort, report);
  averages<VoxelFormat::float32>(effort, report);
}

}  // namespace
}  // namespace voxkit::stress

int main(int argc, char** argv) {
  return voxkit::stress::stress_main(argc, argv, "stress_averages", "Averages of mip-map levels", 300000,
                                     voxkit::stress::fill);
}
