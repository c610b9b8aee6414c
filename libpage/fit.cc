#include "libpage/fit.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "formats/cpu.h"
#include "libpage/parent_rows.h"

namespace voxkit::page {
namespace {

/// Solves a x = b for a symmetric positive definite matrix by its Cholesky factors, in one order of
/// operations. False where it is not definite.
template <class Row>
bool solve_definite(std::array<Row, tap_count>& a, Row& b, size_t n) {
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

/// From fractions of one, with what they leave as that of the rest tap. False, and nothing changed, where
/// they are larger than a model can hold.
bool round_weights(std::span<const size_t> taps, std::span<const double> fractions, int rest, Weights& out) {
  int32_t left = weight_one, size = 0;
  Weights fitted{};
  for (size_t i = 0; i < taps.size(); ++i) {
    if (!(std::abs(fractions[i]) < 7)) return false;
    const auto weight = static_cast<int32_t>(std::floor(fractions[i] * weight_one + 0.5));
    fitted[taps[i]] = static_cast<int16_t>(weight);
    left -= weight;
    size += std::abs(weight);
  }
  if (std::abs(left) > INT16_MAX || size + std::abs(left) > most_weight) return false;
  fitted[static_cast<size_t>(rest)] = static_cast<int16_t>(left);
  out = fitted;
  return true;
}

}  // namespace

Fit::Fit(Classes classes, uint32_t greatest, uint32_t max_error)
    : classes_(classes),
      // Weights need no more than 20 bits of a sample.
      shift_(std::max(0, static_cast<int>(std::bit_width(greatest)) - 20)),
      equations_(static_cast<size_t>(classes.count())) {
  const double error = static_cast<double>(max_error >> shift_);
  quiet_ = 16 * (16 + error * error);
}

void Fit::add(std::span<const FitPage> pages, double noise) {
  for (int i = 0; i < shift_; ++i) noise /= 4;
  std::vector<Equations> sums(equations_.size());
  for (const FitPage& page : pages) add_page(page, sums);
  for (size_t c = 0; c < sums.size(); ++c) {
    Equations& total = equations_[c];
    const double own = noise * sums[c].weight;
    // Of two taps' differences from a third, the noise is twice that of one, and once in common.
    const double common = classes_.parents ? 0 : own;
    for (size_t i = 0; i < tap_count; ++i) {
      for (size_t j = i; j < tap_count; ++j)
        total.products[i][j] =
            total.products[i][j] / 2 + sums[c].products[i][j] + common + (i == j && i < parent_tap ? own : 0);
      total.targets[i] = total.targets[i] / 2 + sums[c].targets[i] + common;
    }
    total.weight = total.weight / 2 + sums[c].weight;
  }
}

namespace {

template <class Equations, class Row>
[[gnu::always_inline]] inline void add_all(Equations& sums, const Row& taps, size_t count, double weight,
                                           double target) {
  constexpr size_t width = 4;
  for (size_t i = 0; i < count; ++i) {
    const double weighted = weight * taps[i];
    sums.targets[i] += weighted * target;
    auto& row = sums.products[i];
    for (size_t j = i / width * width; j < count; j += width)
      for (size_t k = 0; k < width; ++k) row[j + k] += weighted * taps[j + k];
  }
}

}  // namespace

void Fit::add_products_anywhere(Equations& sums, const Row& taps, size_t count, double weight,
                                double target) {
  add_all(sums, taps, count, weight, target);
}
#ifdef VOXKIT_AVX2
VOXKIT_AVX2_CODE void Fit::add_products_avx2(Equations& sums, const Row& taps, size_t count, double weight,
                                             double target) {
  add_all(sums, taps, count, weight, target);
}
#endif

void Fit::add_page(const FitPage& page, std::vector<Equations>& all) const {
#ifdef VOXKIT_AVX2
  const bool vectors = has_avx2();
#endif
  const Extent e = page.extent;
  const auto decoded = [&](int x, int y, int z) {
    const int cx = std::clamp(x, 0, e.nx - 1), cy = std::clamp(y, 0, e.ny - 1), cz = std::max(z, 0);
    return static_cast<double>(page.decoded[static_cast<size_t>((cz * e.ny + cy) * e.nx + cx)] >> shift_);
  };
  const auto parent = [&](int x, int y, int z) {
    const Parent<uint32_t>& p = page.parent;
    const int cx = std::clamp(p.x + x, 0, p.extent.nx - 1), cy = std::clamp(p.y + y, 0, p.extent.ny - 1),
              cz = std::clamp(p.z + z, 0, p.extent.nz - 1);
    return static_cast<double>(p.samples[static_cast<size_t>((cz * p.extent.ny + cy) * p.extent.nx + cx)] >>
                               shift_);
  };
  size_t at = 0;
  for (int z = 0; z < e.nz; ++z)
    for (int y = 0; y < e.ny; ++y)
      for (int x = 0; x < e.nx; ++x, ++at) {
        if (page.mask && !page.mask->solid(x, y, z)) continue;
        const int voxel_class = classes_.of(classes_.along(x, e.nx), classes_.along(y, e.ny), z);
        const int rest = classes_.rest(voxel_class);
        if (rest < 0) continue;
        Row taps{};
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx)
            taps[static_cast<size_t>(3 * dy + dx + 4)] = decoded(x + dx, y + dy, z - 1);
        for (int dx = -1; dx <= 1; ++dx) taps[static_cast<size_t>(dx + 10)] = decoded(x + dx, y - 1, z);
        taps[left_tap] = decoded(x - 1, y, z);
        taps[second_left_tap] = decoded(x - 2, y, z);
        taps[second_above_tap] = decoded(x, y - 2, z);
        taps[second_behind_tap] = decoded(x, y, z - 2);
        if (classes_.parents) {
          const int px = x / 2, py = y / 2, pz = z / 2, dy = toward(y), dz = toward(z);
          for (int dx = -1; dx <= 1; ++dx) {
            const auto at_dx = static_cast<size_t>(parent_tap + 1 + dx);
            taps[at_dx] = parent(px + dx, py, pz);
            taps[at_dx + 3] = parent(px + dx, py + dy, pz);
            taps[at_dx + 6] = parent(px + dx, py, pz + dz);
            taps[at_dx + 9] = parent(px + dx, py + dy, pz + dz);
          }
          taps[parent_tap + 12] = parent(px, py - dy, pz);
          taps[parent_tap + 13] = parent(px, py, pz - dz);
        }
        const double origin = taps[static_cast<size_t>(rest)];
        double least = 0, greatest = 0;
        for (int t = 0; t < tap_count; ++t) {
          double& tap = taps[static_cast<size_t>(t)];
          tap = classes_.has(voxel_class, t) ? tap - origin : 0;
          least = std::min(least, tap);
          greatest = std::max(greatest, tap);
        }
        const double range = greatest - least, weight = quiet_ / (quiet_ + range * range);
        const double target = static_cast<double>(page.samples[at] >> shift_) - origin;
        Equations& sums = all[static_cast<size_t>(voxel_class)];
        sums.weight += weight;
        if (range == 0) continue;
        const auto count = static_cast<size_t>(taps_of(classes_.parents));
#ifdef VOXKIT_AVX2
        if (vectors)
          add_products_avx2(sums, taps, count, weight, target);
        else
#endif
          add_products_anywhere(sums, taps, count, weight, target);
      }
}

std::array<Weights, most_classes> Fit::weights() const {
  std::array<Weights, most_classes> weights{};
  for (int c = 0; c < classes_.count(); ++c)
    weights[static_cast<size_t>(c)] = solve(equations_[static_cast<size_t>(c)], c);
  return weights;
}

Weights Fit::solve(const Equations& equations, int voxel_class) const {
  Weights weights{};
  const int rest = classes_.rest(voxel_class);
  if (rest < 0) return weights;
  weights[static_cast<size_t>(rest)] = weight_one;
  std::array<size_t, tap_count> taps;
  size_t n = 0;
  for (int t = 0; t < tap_count; ++t)
    if (t != rest && classes_.has(voxel_class, t)) taps[n++] = static_cast<size_t>(t);
  if (n == 0 || equations.weight == 0) return weights;

  // Differences that hardly occur have no weight. Where weights are too large for their bits, as that of the
  // parent of noise may be, all are held back more; without parents, such are of no use.
  const double most_damping = classes_.parents ? 1 : 1.0 / 4096;
  for (double damping = 1.0 / 4096; damping <= most_damping; damping *= 4) {
    std::array<Row, tap_count> a;
    Row b;
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = 0; j <= i; ++j) {
        const auto [row, column] = std::minmax(taps[i], taps[j]);
        a[i][j] = equations.products[row][column];
      }
      a[i][i] += a[i][i] * damping + equations.weight / 1024 + 1e-3;
      b[i] = equations.targets[taps[i]];
    }
    if (!solve_definite(a, b, n)) continue;
    if (round_weights(std::span(taps).first(n), b, rest, weights)) break;
  }
  return weights;
}

}  // namespace voxkit::page
