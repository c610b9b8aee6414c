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
  for (int c = 0; c < classes.count(); ++c) {
    ClassTaps& known = class_taps_[static_cast<size_t>(c)];
    known.rest = classes.rest(c);
    for (int t = 0; t < tap_count; ++t) known.mask[static_cast<size_t>(t)] = classes.has(c, t) ? -1 : 0;
  }
}

namespace {

/// A page's samples as integers, with those of its faces twice beyond them, so that taps are at fixed places.
class Surroundings {
 public:
  Surroundings(const FitPage& page, int shift) {
    const Extent e = page.extent;
    const auto decoded = [&](int x, int y, int z) {
      const int cx = std::clamp(x, 0, e.nx - 1), cy = std::clamp(y, 0, e.ny - 1), cz = std::max(z, 0);
      return static_cast<int32_t>(page.decoded[static_cast<size_t>((cz * e.ny + cy) * e.nx + cx)] >> shift);
    };
    for (int z = -reach; z < e.nz; ++z)
      for (int y = -reach; y <= e.ny; ++y)
        for (int x = -reach; x <= e.nx; ++x) decoded_[at(x, y, z)] = decoded(x, y, z);
    if (page.parent.samples.empty()) return;
    const Parent<uint32_t>& p = page.parent;
    for (int z = -1; z <= (e.nz + 1) / 2; ++z)
      for (int y = -1; y <= (e.ny + 1) / 2; ++y)
        for (int x = -1; x <= (e.nx + 1) / 2; ++x) {
          const int cx = std::clamp(p.x + x, 0, p.extent.nx - 1),
                    cy = std::clamp(p.y + y, 0, p.extent.ny - 1),
                    cz = std::clamp(p.z + z, 0, p.extent.nz - 1);
          parents_[parent_at(x, y, z)] = static_cast<int32_t>(
              p.samples[static_cast<size_t>((cz * p.extent.ny + cy) * p.extent.nx + cx)] >> shift);
        }
  }

  /// The taps of a voxel; without parents the first ones.
  [[gnu::always_inline]] inline void taps(int x, int y, int z, bool parents,
                                          std::array<int32_t, Fit::row_width>& out) const {
    const int32_t* const here = &decoded_[at(x, y, z)];
    for (int t = 0; t < causal_taps; ++t)
      out[static_cast<size_t>(t)] = here[causal_offsets[static_cast<size_t>(t)]];
    if (!parents) return;
    const int32_t* const parent = &parents_[parent_at(x / 2, y / 2, z / 2)];
    const int dy = toward(y) * parent_row, dz = toward(z) * parent_plane;
    int32_t* const to = &out[parent_tap];
    for (int dx = -1; dx <= 1; ++dx) {
      to[1 + dx] = parent[dx];
      to[4 + dx] = parent[dx + dy];
      to[7 + dx] = parent[dx + dz];
      to[10 + dx] = parent[dx + dy + dz];
    }
    to[12] = parent[-dy];
    to[13] = parent[-dz];
  }

 private:
  static constexpr int reach = 2, row = max_side + reach + 1, plane = row * row;
  static constexpr int parent_row = parent_side, parent_plane = parent_row * parent_row;
  static constexpr std::array<int, causal_taps> causal_offsets = [] {
    std::array<int, causal_taps> offsets{};
    for (int t = 0; t < 9; ++t) offsets[static_cast<size_t>(t)] = t % 3 - 1 + (t / 3 - 1) * row - plane;
    for (int t = 9; t < 12; ++t) offsets[static_cast<size_t>(t)] = t - 10 - row;
    offsets[left_tap] = -1;
    offsets[second_left_tap] = -2;
    offsets[second_above_tap] = -2 * row;
    offsets[second_behind_tap] = -2 * plane;
    return offsets;
  }();
  static size_t at(int x, int y, int z) {
    return static_cast<size_t>(((z + reach) * row + y + reach) * row + x + reach);
  }
  static size_t parent_at(int x, int y, int z) {
    return static_cast<size_t>(((z + 1) * parent_row + y + 1) * parent_row + x + 1);
  }
  std::array<int32_t, static_cast<size_t>((max_side + reach) * plane)> decoded_;
  std::array<int32_t, static_cast<size_t>(parent_side* parent_plane)> parents_;
};

}  // namespace

/// Equations of a class that are added together, one after the other.
struct Fit::Batch {
  static constexpr size_t most = 4;
  size_t count = 0;
  alignas(64) std::array<Row, most> taps;
  std::array<double, most> weight, target;

  /// To `sums`, of the first `known` taps. Each sum is of its own, so that vectors change nothing.
  template <size_t equations>
  [[gnu::always_inline]] inline void add_all(Equations& sums, size_t known) const {
    constexpr size_t width = 4;
    for (size_t i = 0; i < known; ++i) {
      double weighted[equations];
      for (size_t e = 0; e < equations; ++e) weighted[e] = weight[e] * taps[e][i];
      for (size_t e = 0; e < equations; ++e) sums.targets[i] += weighted[e] * target[e];
      auto& row = sums.products[i];
      for (size_t j = i / width * width; j < known; j += width)
        for (size_t k = 0; k < width; ++k) {
          double sum = row[j + k];
          for (size_t e = 0; e < equations; ++e) sum += weighted[e] * taps[e][j + k];
          row[j + k] = sum;
        }
    }
  }
  [[gnu::always_inline]] inline void add_to(Equations& sums, size_t known) {
    switch (count) {
      case 4:
        add_all<4>(sums, known);
        break;
      case 3:
        add_all<3>(sums, known);
        break;
      case 2:
        add_all<2>(sums, known);
        break;
      case 1:
        add_all<1>(sums, known);
    }
    count = 0;
  }
};

[[gnu::always_inline]] inline void Fit::add_page(const FitPage& page, int share, int turn,
                                                 std::vector<Equations>& all,
                                                 std::vector<Batch>& batches) const {
  const Extent e = page.extent;
  const Surroundings around(page, shift_);
  const auto count = static_cast<size_t>(taps_of(classes_.parents));
  size_t at = 0;
  for (int z = 0; z < e.nz; ++z)
    for (int y = 0; y < e.ny; ++y)
      for (int x = 0; x < e.nx; ++x, ++at) {
        if (page.mask ? !page.mask->solid(x, y, z) : (x / 2 + y / 2 + z / 2 + turn) % share != 0) continue;
        const auto voxel_class =
            static_cast<size_t>(classes_.of(classes_.along(x, e.nx), classes_.along(y, e.ny), z));
        const ClassTaps& known = class_taps_[voxel_class];
        if (known.rest < 0) continue;
        alignas(64) std::array<int32_t, row_width> taps;
        around.taps(x, y, z, classes_.parents, taps);
        const int32_t origin = taps[static_cast<size_t>(known.rest)];
        int32_t least = 0, greatest = 0;
        for (size_t t = 0; t < count; ++t) {
          taps[t] = (taps[t] - origin) & known.mask[t];
          least = std::min(least, taps[t]);
          greatest = std::max(greatest, taps[t]);
        }
        const double range = static_cast<double>(greatest - least),
                     weight = quiet_ / (quiet_ + range * range);
        Equations& sums = all[voxel_class];
        sums.weight += weight;
        if (range == 0) continue;
        Batch& batch = batches[voxel_class];
        Row& row = batch.taps[batch.count];
        for (size_t t = 0; t < count; ++t) row[t] = static_cast<double>(taps[t]);
        for (size_t t = count; t < row_width; ++t) row[t] = 0;
        batch.weight[batch.count] = weight;
        batch.target[batch.count] =
            static_cast<double>(static_cast<int32_t>(page.samples[at] >> shift_) - origin);
        if (++batch.count == Batch::most) batch.add_to(sums, count);
      }
}

[[gnu::always_inline]] inline void Fit::add_pages(std::span<const FitPage> pages,
                                                  std::vector<Equations>& sums,
                                                  std::vector<Batch>& batches) const {
  // Of many pages, some of their cubes of 2^3 voxels give equations enough.
  const int share = pages.size() < 256 ? 1 : pages.size() < 384 ? 2 : 3;
  int turn = 0;
  for (const FitPage& page : pages) add_page(page, share, turn++, sums, batches);
  for (size_t c = 0; c < sums.size(); ++c)
    batches[c].add_to(sums[c], static_cast<size_t>(taps_of(classes_.parents)));
}
void Fit::add_pages_anywhere(std::span<const FitPage> pages, std::vector<Equations>& sums,
                             std::vector<Batch>& batches) const {
  add_pages(pages, sums, batches);
}
#ifdef VOXKIT_AVX2
VOXKIT_AVX2_CODE void Fit::add_pages_avx2(std::span<const FitPage> pages, std::vector<Equations>& sums,
                                          std::vector<Batch>& batches) const {
  add_pages(pages, sums, batches);
}
#endif

void Fit::add(std::span<const FitPage> pages, double noise) {
  for (int i = 0; i < shift_; ++i) noise /= 4;
  std::vector<Equations> sums(equations_.size());
  std::vector<Batch> batches(equations_.size());
#ifdef VOXKIT_AVX2
  if (has_avx2())
    add_pages_avx2(pages, sums, batches);
  else
#endif
    add_pages_anywhere(pages, sums, batches);
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
