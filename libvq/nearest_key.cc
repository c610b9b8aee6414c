#include "libvq/nearest_key.h"

#include <algorithm>
#include <cmath>

#include "libvq/nearest_axes.h"

namespace voxkit::vq {
namespace {

constexpr int components = fine_axes - 1, coarse_components = coarse_axes - 1;
// Each of the 32 coordinates of two keys is off by a half at most, which adds sqrt(32) to a distance. Axes
// are orthonormal to 1e-12 and squares are at most 2^30, so what is left of these for the norm of the rest
// may be off by 1e-3, and its root by 0.032.
constexpr double rounding = 5.66 + 2 * 0.032 + 0.01;

struct Projection {
  std::array<double, fine_axes> axes{};  // the last one: the norm of the rest
  double coarse_rest = 0;
};

Projection project(const Brick& brick, const std::array<double, brick_voxels>& mean, double scale,
                   const std::array<std::array<double, fine_axes>, brick_voxels>& weights) {
  Projection p;
  double all = 0;
  for (size_t v = 0; v < brick_voxels; ++v) {
    const double x = brick[v] - mean[v];
    all += x * x;
    for (size_t a = 0; a < fine_axes; ++a) p.axes[a] += x * weights[v][a];
  }
  double rest = all * scale * scale;
  for (size_t a = 0; a < components; ++a) {
    if (a == coarse_components) p.coarse_rest = std::sqrt(std::max(rest, 0.0));
    rest -= p.axes[a] * p.axes[a];
  }
  p.axes[components] = std::sqrt(std::max(rest, 0.0));
  return p;
}

int16_t rounded(double v) {
  return static_cast<int16_t>(std::clamp(std::floor(v + 0.5), -1.0 * key_limit, 1.0 * key_limit));
}

}  // namespace

KeySpace::KeySpace(std::span<const Brick> bricks) {
  uint16_t greatest = 1;
  for (const Brick& brick : bricks) greatest = std::max(greatest, range_of(brick).max);
  narrow_ = greatest < 4096;
  scale_ = 1;
  while (greatest * scale_ >= 4096) scale_ /= 2;
  while (greatest * scale_ * 2 < 4096) scale_ *= 2;

  const PrincipalAxes found = principal_axes(bricks);
  mean_ = found.mean;
  for (size_t v = 0; v < brick_voxels; ++v) {
    for (size_t a = 0; a < components; ++a) weights_[v][a] = found.axes[a][v] * scale_;
    weights_[v][components] = 0;
  }
  // Outliers that are not in the sample may be cut off at the limits, which makes no distance greater.
  std::array<double, fine_axes + 1> least, most;
  least.fill(1e9);
  most.fill(-1e9);
  const size_t step = std::max<size_t>(1, bricks.size() >> 13);
  for (size_t i = 0; i < bricks.size(); i += step) {
    const Projection p = project(bricks[i], mean_, scale_, weights_);
    for (size_t a = 0; a <= fine_axes; ++a) {
      const double x = a < fine_axes ? p.axes[a] : p.coarse_rest;
      least[a] = std::min(least[a], x);
      most[a] = std::max(most[a], x);
    }
  }
  for (size_t a = 0; a < fine_axes; ++a) middle_[a] = (least[a] + most[a]) / 2;
  coarse_middle_ = (least[fine_axes] + most[fine_axes]) / 2;
}

Key KeySpace::key(const Brick& brick) const {
  const Projection p = project(brick, mean_, scale_, weights_);
  Key key;
  key.norm = 0;
  for (size_t a = 0; a < fine_axes; ++a) {
    key.fine[a] = rounded(p.axes[a] - middle_[a]);
    key.norm += static_cast<uint32_t>(key.fine[a] * key.fine[a]);
  }
  std::copy_n(key.fine.begin(), coarse_components, key.coarse.begin());
  key.coarse[coarse_components] = rounded(p.coarse_rest - coarse_middle_);
  return key;
}

int32_t KeySpace::reach(uint64_t squared_distance) const {
  if (squared_distance == 0) return 0;
  const double furthest = 64.0 * 4096 * 4096;  // scaled voxels are below 4096: nothing is further apart
  const double distance =
      std::sqrt(std::min(static_cast<double>(squared_distance) * scale_ * scale_, furthest)) * (1 + 1e-9) +
      rounding;
  return static_cast<int32_t>(distance * distance) + 1;
}

}  // namespace voxkit::vq
