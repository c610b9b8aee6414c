#include "libvq/nearest_axes.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace voxkit::vq {
namespace {

using Matrix = std::array<Axis, brick_voxels>;

/// One step of Jacobi's method: rotates rows and columns p and q of a symmetric matrix so that (p, q) becomes
/// nought, and rows p and q of `axes` along; does nothing where it nearly is.
void rotate(Matrix& m, Matrix& axes, size_t p, size_t q, double negligible) {
  if (std::abs(m[p][q]) <= negligible) return;
  const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
  const double t = std::copysign(1, theta) / (std::abs(theta) + std::sqrt(theta * theta + 1));
  const double c = 1 / std::sqrt(t * t + 1), s = t * c;
  const auto turn = [c, s](double& x, double& y) {
    const double was = x;
    x = c * was - s * y;
    y = s * was + c * y;
  };
  for (Axis& row : m) turn(row[p], row[q]);
  for (size_t i = 0; i < brick_voxels; ++i) turn(m[p][i], m[q][i]);
  for (size_t i = 0; i < brick_voxels; ++i) turn(axes[p][i], axes[q][i]);
}

}  // namespace

PrincipalAxes principal_axes(std::span<const Brick> bricks) {
  PrincipalAxes result{};
  const size_t step = std::max<size_t>(1, bricks.size() >> 13);
  double count = 0;
  for (size_t i = 0; i < bricks.size(); i += step, ++count)
    for (size_t v = 0; v < brick_voxels; ++v) result.mean[v] += bricks[i][v];
  for (double& v : result.mean) v /= std::max(count, 1.0);

  Matrix covariance{}, axes{};
  for (size_t i = 0; i < bricks.size(); i += step) {
    Axis x;
    for (size_t v = 0; v < brick_voxels; ++v) x[v] = bricks[i][v] - result.mean[v];
    for (size_t a = 0; a < brick_voxels; ++a)
      for (size_t b = 0; b < brick_voxels; ++b) covariance[a][b] += x[a] * x[b];
  }
  double variance = 0;
  for (size_t a = 0; a < brick_voxels; ++a) {
    axes[a][a] = 1;
    variance += covariance[a][a];
  }
  const double negligible = 1e-12 * variance;
  // It converges quadratically; a few sweeps more than random matrices of this size need.
  for (int sweep = 0; sweep < 12; ++sweep)
    for (size_t p = 0; p + 1 < brick_voxels; ++p)
      for (size_t q = p + 1; q < brick_voxels; ++q) rotate(covariance, axes, p, q, negligible);

  std::array<size_t, brick_voxels> order;
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return covariance[a][a] > covariance[b][b]; });
  for (size_t i = 0; i < brick_voxels; ++i) result.axes[i] = axes[order[i]];
  return result;
}

}  // namespace voxkit::vq
