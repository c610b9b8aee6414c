#include "libmetrics/ssim.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "formats/cpu.h"
#include "formats/parallel.h"

namespace voxkit {
namespace {

constexpr int max_taps = 11;
constexpr std::array<double, 5> scale_weights{0.0448, 0.2856, 0.3001, 0.2363, 0.1333};

/// A normalised Gaussian of sigma 1.5, as long as fits a side.
struct Gaussian {
  explicit Gaussian(int64_t side) : taps(static_cast<int>(std::min<int64_t>(side, max_taps))) {
    double sum = 0;
    for (int i = 0; i < taps; ++i) {
      const double x = i - 0.5 * (taps - 1);
      weights[static_cast<size_t>(i)] = std::exp(-x * x / (2 * 1.5 * 1.5));
      sum += weights[static_cast<size_t>(i)];
    }
    for (double& w : weights) w /= sum;
  }
  int taps;
  std::array<double, max_taps> weights{};
};

/// Inner loops are part of the functions that call them, which are compiled for different machines. Without
/// contraction, and with sums in one order, all of them give the same bits, one by one or several side by
/// side.
#define VOXKIT_INLINE [[gnu::always_inline]] inline
#define VOXKIT_LAMBDA __attribute__((always_inline))

typedef double Doubles __attribute__((vector_size(32)));
constexpr int64_t lanes = 4;
template <class Real>
VOXKIT_INLINE Real load(const double* from) {
  Real x;
  std::memcpy(&x, from, sizeof x);
  return x;
}
template <class Real>
VOXKIT_INLINE void store(double* to, const Real& x) {
  std::memcpy(to, &x, sizeof x);
}
/// Calls `body(i, Real{})` for all of 0 .. n - 1, as many at a time as Real holds.
template <class Body>
VOXKIT_INLINE void for_each_lane(int64_t n, const Body& body) {
  int64_t i = 0;
  for (; i + lanes <= n; i += lanes) body(i, Doubles{});
  for (; i < n; ++i) body(i, double{});
}

/// Rows under the filter.
using Rows = std::array<const double*, max_taps>;

/// The sum of weight k times what row k has at i. Rows of equal weight are added first.
template <class Real, int taps>
VOXKIT_INLINE Real weighted(const Rows& rows, const std::array<double, max_taps>& weights, int64_t i) {
  Real sum{};
#pragma GCC unroll 5
  for (size_t k = 0; k < taps / 2; ++k)
    sum += weights[k] * (load<Real>(rows[k] + i) + load<Real>(rows[taps - 1 - k] + i));
  if (taps % 2 != 0) sum += weights[taps / 2] * load<Real>(rows[taps / 2] + i);
  return sum;
}
/// The same for rows of n values.
VOXKIT_INLINE void filter(const Gaussian& g, const Rows& rows, int64_t n, double* out) {
  if (g.taps == max_taps) {
    const Rows at = rows;
    const std::array<double, max_taps> weights = g.weights;
    for_each_lane(n, [&](int64_t i, auto real) VOXKIT_LAMBDA {
      store(out + i, weighted<decltype(real), max_taps>(at, weights, i));
    });
    return;
  }
  for (int64_t i = 0; i < n; ++i) {
    double sum = 0;
    const auto taps = static_cast<size_t>(g.taps);
    for (size_t k = 0; k < taps / 2; ++k) sum += g.weights[k] * (rows[k][i] + rows[taps - 1 - k][i]);
    if (taps % 2 != 0) sum += g.weights[taps / 2] * rows[taps / 2][i];
    out[i] = sum;
  }
}
template <class Real>
VOXKIT_INLINE Real greater(const Real& a, const Real& b) {
  return a < b ? b : a;  // as std::max: a NaN in a passes through
}
template <class Real>
VOXKIT_INLINE Real lesser(const Real& a, const Real& b) {
  return b < a ? b : a;
}

struct Sums {
  double ssim = 0, contrast_structure = 0;
};

/// The sums over a block of windows, small enough that the rows under the filter stay in the cache.
class Block {
 public:
  static constexpr int64_t width = 128, height = 64;

  Block(const Gaussian& gx, const Gaussian& gy, double c1, double c2) : gx_(gx), gy_(gy), c1_(c1), c2_(c2) {}

  /// The windows whose upper left samples are (x0, y0) .. (x1, y1), half open.
  VOXKIT_INLINE Sums sums(const Image& a, const Image& b, int64_t x0, int64_t y0, int64_t x1, int64_t y1) {
    const int64_t n = x1 - x0;
    std::fill_n(ssim_, n, 0.0);
    std::fill_n(contrast_structure_, n, 0.0);
    for (int64_t y = y0; y < y1 + gy_.taps - 1; ++y) {
      filter_row(a.row(y) + x0, b.row(y) + x0, n, filtered_[y % gy_.taps]);
      const int64_t top = y - (gy_.taps - 1);
      if (top >= y0) add_windows(a, b, x0, top, n);
    }
    Sums sums;
    for (int64_t i = 0; i < n; ++i) {
      sums.ssim += ssim_[i];
      sums.contrast_structure += contrast_structure_[i];
    }
    return sums;
  }

 private:
  /// The moments whose means SSIM is made of. It needs no more of the squares than their sum.
  enum Moment { mean_a, mean_b, squares, product, moments };
  using Row = double[width];

  VOXKIT_INLINE void filter_row(const float* a, const float* b, int64_t n, Row* out) {
    const int64_t samples = n + gx_.taps - 1;
    for (int64_t i = 0; i < samples; ++i) {
      const double va = a[i], vb = b[i];
      moments_[mean_a][i] = va;
      moments_[mean_b][i] = vb;
      moments_[squares][i] = va * va + vb * vb;
      moments_[product][i] = va * vb;
    }
    for (int m = 0; m < moments; ++m) {
      Rows rows{};
      for (int k = 0; k < gx_.taps; ++k) rows[static_cast<size_t>(k)] = moments_[m] + k;
      filter(gx_, rows, n, out[m]);
    }
  }

  VOXKIT_INLINE void add_windows(const Image& image_a, const Image& image_b, int64_t left, int64_t top,
                                 int64_t n) {
    for (int m = 0; m < moments; ++m) {
      Rows rows{};
      for (int k = 0; k < gy_.taps; ++k) rows[static_cast<size_t>(k)] = filtered_[(top + k) % gy_.taps][m];
      filter(gy_, rows, n, means_[m]);
    }
    for_each_lane(n, [&](int64_t i, auto real) VOXKIT_LAMBDA {
      using Real = decltype(real);
      const Real a = load<Real>(means_[mean_a] + i), b = load<Real>(means_[mean_b] + i);
      const Real ab = a * b, aa_bb = a * a + b * b;
      store(variances_ + i, greater(Real(load<Real>(means_[squares] + i) - aa_bb), Real{}));
      store(covariances2_ + i, Real(2 * (load<Real>(means_[product] + i) - ab)));
    });
    bool any = false;
    for (int64_t i = 0; i < n; ++i) any |= is_cancelled(i);
    if (any) spread_again(image_a, image_b, left, top, n);
    for_each_lane(n, [&](int64_t i, auto real) VOXKIT_LAMBDA {
      using Real = decltype(real);
      const Real a = load<Real>(means_[mean_a] + i), b = load<Real>(means_[mean_b] + i);
      const Real ab = a * b, aa_bb = a * a + b * b, variances = load<Real>(variances_ + i);
      // Rounding could break |2 covariance| <= sum of variances; a NaN passes through.
      const Real covariance2 = lesser(greater(load<Real>(covariances2_ + i), Real(-variances)), variances);
      const Real contrast_structure = (covariance2 + c2_) / (variances + c2_);
      const Real luminance = (2 * ab + c1_) / (aa_bb + c1_);
      store(contrast_structure_ + i, Real(load<Real>(contrast_structure_ + i) + contrast_structure));
      store(ssim_ + i, Real(load<Real>(ssim_ + i) + luminance * contrast_structure));
    });
  }

  /// Whether samples are so large beside their differences that the means of their squares say little about
  /// these: of 53 bits less than 27 are left. Integers of 8 and 16 bits stay below.
  VOXKIT_INLINE bool is_cancelled(int64_t i) const {
    return means_[squares][i] > 0x1p26 * (variances_[i] + c2_);
  }
  /// Variances and covariances of these windows, from each one's middle sample on.
  [[gnu::noinline]] void spread_again(const Image& a, const Image& b, int64_t left, int64_t top, int64_t n) {
    for (int64_t w = 0; w < n; ++w) {
      if (!is_cancelled(w) || !std::isfinite(means_[squares][w])) continue;
      const int64_t x = left + w, mx = x + gx_.taps / 2, my = top + gy_.taps / 2;
      const double a0 = a.row(my)[mx], b0 = b.row(my)[mx];
      double sum_a = 0, sum_b = 0, sum_squares = 0, sum_product = 0;
      for (int j = 0; j < gy_.taps; ++j)
        for (int i = 0; i < gx_.taps; ++i) {
          const double weight = gx_.weights[static_cast<size_t>(i)] * gy_.weights[static_cast<size_t>(j)];
          const double va = a.row(top + j)[x + i] - a0, vb = b.row(top + j)[x + i] - b0;
          sum_a += weight * va;
          sum_b += weight * vb;
          sum_squares += weight * (va * va + vb * vb);
          sum_product += weight * (va * vb);
        }
      variances_[w] = std::max(sum_squares - (sum_a * sum_a + sum_b * sum_b), 0.0);
      covariances2_[w] = 2 * (sum_product - sum_a * sum_b);
    }
  }

  const Gaussian &gx_, &gy_;
  double c1_, c2_;
  double moments_[moments][width + max_taps - 1];
  Row filtered_[max_taps][moments];  ///< along x; row y is at y % taps
  Row means_[moments];
  Row variances_, covariances2_;   ///< sums of both; twice the covariance
  Row ssim_, contrast_structure_;  ///< summed along y
};

/// The windows of a block whose upper left samples are (x0, y0) .. (x1, y1), half open.
struct Windows {
  const Image &a, &b;
  int64_t x0, y0, x1, y1;
};
Sums sums_generic(Block& block, const Windows& w) {
  return block.sums(w.a, w.b, w.x0, w.y0, w.x1, w.y1);
}
#ifdef VOXKIT_AVX2
VOXKIT_AVX2_CODE Sums sums_avx2(Block& block, const Windows& w) {
  return block.sums(w.a, w.b, w.x0, w.y0, w.x1, w.y1);
}
#else
constexpr auto sums_avx2 = sums_generic;
#endif

/// The means over all windows of one scale.
Result<Sums> mean_ssim(const Image& a, const Image& b, double peak, const Context& ctx) {
  const double c1 = 0.01 * peak * (0.01 * peak), c2 = 0.03 * peak * (0.03 * peak);
  const Gaussian gx(a.width()), gy(a.height());
  const int64_t width = a.width() - gx.taps + 1, height = a.height() - gy.taps + 1;
  const int64_t across = (width + Block::width - 1) / Block::width;
  const int64_t blocks = across * ((height + Block::height - 1) / Block::height);
  std::vector<Sums> parts(static_cast<size_t>(blocks));
  VOX_CHECK(parallel_for(ctx, blocks, [&](int64_t i) -> Status {
    const int64_t x = i % across * Block::width, y = i / across * Block::height;
    Block block(gx, gy, c1, c2);
    const Windows windows{a, b, x, y, std::min(x + Block::width, width), std::min(y + Block::height, height)};
    parts[static_cast<size_t>(i)] = has_avx2() ? sums_avx2(block, windows) : sums_generic(block, windows);
    return {};
  }));
  Sums total;
  for (const Sums& part : parts) {
    total.ssim += part.ssim;
    total.contrast_structure += part.contrast_structure;
  }
  const double windows = static_cast<double>(width) * static_cast<double>(height);
  return Sums{total.ssim / windows, total.contrast_structure / windows};
}

/// Calls `body(y)` for every row, several at once.
template <class Body>
Status for_rows(int64_t height, const Context& ctx, const Body& body) {
  constexpr int64_t rows_at_once = 32;
  return parallel_for(ctx, (height + rows_at_once - 1) / rows_at_once, [&](int64_t i) -> Status {
    for (int64_t y = i * rows_at_once; y < std::min((i + 1) * rows_at_once, height); ++y) body(y);
    return {};
  });
}

Result<Image> halved(const Image& image, Context& ctx) {
  VOX_TRY(Image half,
          Image::create((image.width() + 1) / 2, (image.height() + 1) / 2, 1, SampleType::f32, ctx));
  VOX_CHECK(for_rows(half.height(), ctx, [&](int64_t y) {
    const float *p = image.row(2 * y), *q = image.row(std::min(2 * y + 1, image.height() - 1));
    float* out = half.row(y);
    const auto mean = [](double s, double t, double u, double v) {
      return static_cast<float>(0.25 * ((s + t) + (u + v)));
    };
    const int64_t pairs = image.width() / 2;
    for (int64_t x = 0; x < pairs; ++x) out[x] = mean(p[2 * x], p[2 * x + 1], q[2 * x], q[2 * x + 1]);
    if (pairs < half.width()) out[pairs] = mean(p[2 * pairs], p[2 * pairs], q[2 * pairs], q[2 * pairs]);
  }));
  return half;
}

}  // namespace

Result<Ssim> ssim(const Image& a, const Image& b, std::optional<double> peak, Context& ctx) {
  if (a.channels() != 1 || b.channels() != 1 || a.type() != b.type() || a.width() != b.width() ||
      a.height() != b.height())
    return bad_usage(fmt::format(
        "SSIM of {} x {} x {} and {} x {} x {} samples: expected one channel of the same size and type",
        a.width(), a.height(), a.channels(), b.width(), b.height(), b.channels()));
  const double scale = peak ? *peak : a.peak();
  const int64_t side = std::min(a.width(), a.height());
  Ssim result;
  result.scales = 1;
  const int most = static_cast<int>(scale_weights.size());
  while (result.scales < most && (int64_t{max_taps} << result.scales) <= side) ++result.scales;

  std::array<double, scale_weights.size()> terms{};
  std::optional<Image> half_a, half_b;
  for (int s = 0; s < result.scales; ++s) {
    if (s > 0) {
      VOX_TRY(half_a, halved(half_a ? *half_a : a, ctx));
      VOX_TRY(half_b, halved(half_b ? *half_b : b, ctx));
    }
    VOX_TRY(const Sums means, mean_ssim(half_a ? *half_a : a, half_b ? *half_b : b, scale, ctx));
    if (s == 0) result.ssim = means.ssim;
    terms[static_cast<size_t>(s)] = s + 1 < result.scales ? means.contrast_structure : means.ssim;
  }
  double weights = 0;
  for (int s = 0; s < result.scales; ++s) weights += scale_weights[static_cast<size_t>(s)];
  result.ms_ssim = 1;
  for (size_t s = 0; s < static_cast<size_t>(result.scales); ++s)
    result.ms_ssim *= std::pow(std::max(terms[s], 0.0), scale_weights[s] / weights);
  return result;
}

Result<Image> luma(const Image& image, Context& ctx) {
  if (image.colors() == 1) return channel(image, 0, ctx);
  VOX_TRY(Image out, Image::create(image.width(), image.height(), 1, image.type(), ctx));
  const int64_t channels = image.channels();
  VOX_CHECK(for_rows(image.height(), ctx, [&](int64_t y) {
    const float* in = image.row(y);
    for (int64_t x = 0; x < image.width(); ++x, in += channels) {
      const double r = in[0], g = in[1], b = in[2];
      out.row(y)[x] = static_cast<float>(0.2126 * r + 0.7152 * g + 0.0722 * b);
    }
  }));
  return out;
}

Result<Image> channel(const Image& image, int index, Context& ctx) {
  if (index < 0 || index >= image.channels())
    return bad_usage(fmt::format("channel {}: expected 0 to {}", index, image.channels() - 1));
  VOX_TRY(Image out, Image::create(image.width(), image.height(), 1, image.type(), ctx));
  const int64_t channels = image.channels();
  VOX_CHECK(for_rows(image.height(), ctx, [&](int64_t y) {
    const float* in = image.row(y) + index;
    for (int64_t x = 0; x < image.width(); ++x) out.row(y)[x] = in[x * channels];
  }));
  return out;
}

}  // namespace voxkit
