#include "libpage/fit.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "formats/cpu.h"
#include "formats/parallel.h"
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

/// Equations of a class that are added together, one after the other, to sums of floats, and these after so
/// many, while they are as good as exact, to sums of doubles.
struct Fit::Pending {
  static constexpr size_t most = 4;
  static constexpr int most_batches = 64;
  size_t count = 0;
  int batches = 0;
  alignas(64) std::array<Row<float>, most> taps;
  std::array<float, most> weight;
  Sums<float> sums;

  /// Of `known` taps and the sample. Each sum is of its own, so that vectors change nothing.
  template <size_t equations, size_t known>
  [[gnu::always_inline]] inline void add_all() {
    constexpr size_t width = 8;
    for (size_t i = 0; i < known; ++i) {
      float weighted[equations];
      for (size_t e = 0; e < equations; ++e) weighted[e] = weight[e] * taps[e][i];
      auto& row = sums.products[i];
      for (size_t j = i / width * width; j < known + 1; j += width)
        for (size_t k = 0; k < width; ++k) {
          float sum = row[j + k];
          for (size_t e = 0; e < equations; ++e) sum += weighted[e] * taps[e][j + k];
          row[j + k] = sum;
        }
    }
  }
  template <size_t known>
  [[gnu::always_inline]] inline void add_batch(Equations& total) {
    if (count == most)
      add_all<most, known>();
    else
      for (size_t e = 0; e < count; ++e) {
        std::swap(taps[0], taps[e]);
        std::swap(weight[0], weight[e]);
        add_all<1, known>();
      }
    count = 0;
    if (++batches == most_batches) flush(total);
  }
  void flush(Equations& total) {
    for (size_t i = 0; i < tap_count; ++i)
      for (size_t j = 0; j < row_width; ++j) total.products[i][j] += static_cast<double>(sums.products[i][j]);
    sums = {};
    batches = 0;
  }
};

template <bool parents>
[[gnu::always_inline]] inline void Fit::add_page(const FitPage& page, int share, int turn,
                                                 std::vector<Equations>& all,
                                                 std::vector<Pending>& pending) const {
  const Extent e = page.extent;
  const Surroundings around(page, shift_);
  constexpr auto count = static_cast<size_t>(taps_of(parents));
  constexpr Classes classes{parents};
  size_t at = 0;
  for (int z = 0; z < e.nz; ++z)
    for (int y = 0; y < e.ny; ++y)
      for (int x = 0; x < e.nx; ++x, ++at) {
        if (page.mask ? !page.mask->solid(x, y, z) : (x / 2 + y / 2 + z / 2 + turn) % share != 0) continue;
        const auto voxel_class =
            static_cast<size_t>(classes.of(classes.along(x, e.nx), classes.along(y, e.ny), z));
        const ClassTaps& known = class_taps_[voxel_class];
        if (known.rest < 0) continue;
        alignas(64) std::array<int32_t, row_width> taps;
        around.taps(x, y, z, parents, taps);
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
        Pending& batch = pending[voxel_class];
        Row<float>& row = batch.taps[batch.count];
        for (size_t t = 0; t < count; ++t) row[t] = static_cast<float>(taps[t]);
        row[count] = static_cast<float>(static_cast<int32_t>(page.samples[at] >> shift_) - origin);
        for (size_t t = count + 1; t < row_width; ++t) row[t] = 0;
        batch.weight[batch.count] = static_cast<float>(weight);
        if (++batch.count == Pending::most) batch.add_batch<count>(sums);
      }
}

template <bool parents>
[[gnu::always_inline]] inline void Fit::add_pages(std::span<const FitPage> all, size_t first, size_t last,
                                                  std::vector<Equations>& sums) const {
  // Of many pages, some of their cubes of 2^3 voxels give equations enough.
  const int share = all.size() < 256 ? 1 : all.size() < 384 ? 2 : 3;
  std::vector<Pending> pending(sums.size());
  for (size_t i = first; i < last; ++i) add_page<parents>(all[i], share, static_cast<int>(i), sums, pending);
  for (size_t c = 0; c < sums.size(); ++c) {
    pending[c].add_batch<static_cast<size_t>(taps_of(parents))>(sums[c]);
    pending[c].flush(sums[c]);
  }
}
void Fit::add_pages_anywhere(std::span<const FitPage> all, size_t first, size_t last,
                             std::vector<Equations>& sums) const {
  classes_.parents ? add_pages<true>(all, first, last, sums) : add_pages<false>(all, first, last, sums);
}
#ifdef VOXKIT_AVX2
VOXKIT_AVX2_CODE void Fit::add_pages_avx2(std::span<const FitPage> all, size_t first, size_t last,
                                          std::vector<Equations>& sums) const {
  classes_.parents ? add_pages<true>(all, first, last, sums) : add_pages<false>(all, first, last, sums);
}
#endif

Status Fit::add(std::span<const FitPage> pages, double noise, const Context& ctx) {
  for (int i = 0; i < shift_; ++i) noise /= 4;
  constexpr size_t parts = 8;
  std::array<std::vector<Equations>, parts> sums;
  VOX_CHECK(parallel_for(ctx, parts, [&](int64_t i) -> Status {
    const auto part = static_cast<size_t>(i);
    const size_t first = pages.size() * part / parts, last = pages.size() * (part + 1) / parts;
    if (first == last) return {};
    sums[part].resize(equations_.size());
#ifdef VOXKIT_AVX2
    if (has_avx2()) {
      add_pages_avx2(pages, first, last, sums[part]);
      return {};
    }
#endif
    add_pages_anywhere(pages, first, last, sums[part]);
    return {};
  }));
  const auto sample = static_cast<size_t>(taps_of(classes_.parents));
  for (size_t c = 0; c < equations_.size(); ++c) {
    Equations& total = equations_[c];
    const auto add = [&](auto member) {
      double sum = 0;
      for (const std::vector<Equations>& part : sums)
        if (!part.empty()) sum += member(part[c]);
      return sum;
    };
    const double weight = add([](const Equations&part) { return part.weight; }), own = noise * weight;
    // Of two taps' differences from a third, the noise is twice that of one, and once in common.
    const double common = classes_.parents ? 0 : own;
    for (size_t i = 0; i < sample; ++i)
      for (size_t j = i; j <= sample; ++j)
        total.products[i][j] = total.products[i][j] / 2 +
                               add([&](const Equations& part) { return part.products[i][j]; }) + common +
                               (i == j && i < parent_tap ? own : 0);
    total.weight = total.weight / 2 + weight;
  }
  return {};
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
    std::array<Row<double>, tap_count> a;
    Row<double> b;
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = 0; j <= i; ++j) {
        const auto [row, column] = std::minmax(taps[i], taps[j]);
        a[i][j] = equations.products[row][column];
      }
      a[i][i] += a[i][i] * damping + equations.weight / 1024 + 1e-3;
      b[i] = equations.products[taps[i]][static_cast<size_t>(taps_of(classes_.parents))];
    }
    if (!solve_definite(a, b, n)) continue;
    if (round_weights(std::span(taps).first(n), b, rest, weights)) break;
  }
  return weights;
}

}  // namespace voxkit::page
