#include "libpage/fit.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace voxkit::page {
namespace {

/// Normal equations of one class, in differences from its rest tap. Sums are integers: their order does not
/// matter.
struct Equations {
  std::array<std::array<int64_t, tap_count>, tap_count> products{};
  std::array<int64_t, tap_count> targets{};
  int64_t weight = 0;
};

/// In parts of 4096: 1 / (4 + range^2 / 16).
int64_t equation_weight(int64_t range) {
  return (int64_t{1} << 16) / (64 + std::min<int64_t>(range, 1 << 12) * std::min<int64_t>(range, 1 << 12));
}

/// Solves a x = b for a symmetric positive definite matrix by its Cholesky factors, in one order of
/// operations. False where it is not definite.
bool solve(std::array<std::array<double, tap_count>, tap_count>& a, std::array<double, tap_count>& b, size_t n) {
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      double sum = a[i][j];
      for (size_t k = 0; k < j; ++k) sum -= a[i][k] * a[j][k];
      if (i == j) {
        if (!(sum > 0)) return false;
        a[i][i] = std::sqrt(sum);
      } else {
        a[i][j] = sum / a[j][j];
      }
    }
  }
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < i; ++k) b[i] -= a[i][k] * b[k];
    b[i] /= a[i][i];
  }
  for (size_t i = n; i-- > 0;) {
    for (size_t k = i + 1; k < n; ++k) b[i] -= a[k][i] * b[k];
    b[i] /= a[i][i];
  }
  return true;
}

Weights weights_of(const Equations& equations, int voxel_class, double noise) {
  Weights weights{};
  const int rest = rest_tap(voxel_class);
  if (rest < 0) return weights;
  weights[static_cast<size_t>(rest)] = weight_one;
  std::array<size_t, tap_count> taps;
  size_t n = 0;
  for (int t = 0; t < tap_count; ++t)
    if (t != rest && has_tap(voxel_class, t)) taps[n++] = static_cast<size_t>(t);
  if (n == 0 || equations.weight == 0) return weights;

  std::array<std::array<double, tap_count>, tap_count> a;
  std::array<double, tap_count> b;
  // The noise of two taps' differences from a third: twice that of one, and once in common.
  const double common = noise * static_cast<double>(equations.weight);
  for (size_t i = 0; i < n; ++i) {
    for (size_t j = 0; j <= i; ++j) {
      const auto [row, column] = std::minmax(taps[i], taps[j]);
      a[i][j] = static_cast<double>(equations.products[row][column]) + common + (i == j ? common : 0);
    }
    // Differences that hardly occur have no weight.
    a[i][i] += a[i][i] / 4096 + static_cast<double>(equations.weight) / 64 + 1;
    b[i] = static_cast<double>(equations.targets[taps[i]]) + common;
  }
  if (!solve(a, b, n)) return weights;
  int32_t left = weight_one, size = 0;
  Weights fitted{};
  for (size_t i = 0; i < n; ++i) {
    if (!(std::abs(b[i]) < 7)) return weights;
    const auto weight = static_cast<int32_t>(std::floor(b[i] * weight_one + 0.5));
    fitted[taps[i]] = static_cast<int16_t>(weight);
    left -= weight;
    size += std::abs(weight);
  }
  if (std::abs(left) > INT16_MAX || size + std::abs(left) > most_weight) return weights;
  fitted[static_cast<size_t>(rest)] = static_cast<int16_t>(left);
  return fitted;
}

}  // namespace

std::array<Weights, class_count> fit_weights(std::span<const FitPage> pages, double noise) {
  uint32_t greatest = 0;
  for (const FitPage& page : pages)
    for (const uint32_t sample : page.samples) greatest = std::max(greatest, sample);
  // Weights need no more than 20 bits of a sample.
  const int shift = std::max(0, static_cast<int>(std::bit_width(greatest)) - 20);
  for (int i = 0; i < shift; ++i) noise /= 4;

  std::vector<Equations> equations(class_count);
  for (const FitPage& page : pages) {
    const Extent e = page.extent;
    const auto sample = [&](int x, int y, int z) {
      const int cx = std::clamp(x, 0, e.nx - 1), cy = std::clamp(y, 0, e.ny - 1), cz = std::clamp(z, 0, e.nz - 1);
      return static_cast<int64_t>(page.decoded[static_cast<size_t>((cz * e.ny + cy) * e.nx + cx)] >> shift);
    };
    size_t at = 0;
    for (int z = 0; z < e.nz; ++z)
      for (int y = 0; y < e.ny; ++y)
        for (int x = 0; x < e.nx; ++x, ++at) {
          const int voxel_class = class_of(place(x, e.nx), place(y, e.ny), z > 0);
          const int rest = rest_tap(voxel_class);
          if (rest < 0) continue;
          std::array<int64_t, tap_count> taps;
          std::array<size_t, tap_count> used;
          size_t n = 0;
          for (int t = 0; t < tap_count; ++t) {
            if (!has_tap(voxel_class, t)) continue;
            taps[static_cast<size_t>(t)] = t == left_tap ? sample(x - 1, y, z)
                                           : t >= 9      ? sample(x + t - 10, y - 1, z)
                                                         : sample(x + t % 3 - 1, y + t / 3 - 1, z - 1);
            used[n++] = static_cast<size_t>(t);
          }
          const int64_t origin = taps[static_cast<size_t>(rest)];
          int64_t least = origin, greatest_tap = origin;
          for (size_t i = 0; i < n; ++i) {
            least = std::min(least, taps[used[i]]);
            greatest_tap = std::max(greatest_tap, taps[used[i]]);
          }
          const int64_t weight = equation_weight(greatest_tap - least);
          if (weight == 0) continue;
          const int64_t target = static_cast<int64_t>(page.samples[at] >> shift) - origin;
          Equations& sums = equations[static_cast<size_t>(voxel_class)];
          sums.weight += weight;
          for (size_t i = 0; i < n; ++i) {
            const int64_t weighted = weight * (taps[used[i]] - origin);
            sums.targets[used[i]] += weighted * target;
            for (size_t j = i; j < n; ++j) sums.products[used[i]][used[j]] += weighted * (taps[used[j]] - origin);
          }
        }
  }
  std::array<Weights, class_count> weights{};
  for (int c = 0; c < class_count; ++c)
    weights[static_cast<size_t>(c)] = weights_of(equations[static_cast<size_t>(c)], c, noise);
  return weights;
}

}  // namespace voxkit::page
