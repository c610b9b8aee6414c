#include "libcolor/blocks/block_fit.h"

#include <algorithm>
#include <cmath>

#include "libcolor/blocks/directions.h"
#include "libcolor/blocks/lab_colors.h"

namespace voxkit::color {
namespace {

using Vec3 = std::array<double, 3>;

/// A line through a run of colours, in the least squares sense.
struct Line {
  Vec3 mean;
  std::array<float, 3> axis;  ///< of length 1; 0 where all colours are equal
  double residual;            ///< mean squared distance from it
};

/// The direction of the greatest variance, by squaring the covariance matrix.
Line line_of(const MacroColors::Sums& s, double count) {
  Line line;
  line.mean = {s[0] / count, s[1] / count, s[2] / count};
  // count^2 times the covariance: whole numbers below 2^53.
  const auto moment = [&](size_t square, size_t i, size_t j) {
    return count * s[square] - static_cast<double>(s[i]) * s[j];
  };
  const std::array<double, 6> c = {moment(3, 0, 0), moment(4, 1, 1), moment(5, 2, 2),
                                   moment(6, 0, 1), moment(7, 0, 2), moment(8, 1, 2)};
  const double trace = c[0] + c[1] + c[2];
  line.axis = {0, 0, 0};
  line.residual = 0;
  if (trace <= 0) return line;
  std::array<double, 6> m;
  for (size_t i = 0; i < 6; ++i) m[i] = c[i] / trace;
  constexpr int squarings = 5;  // the ratio of two eigenvalues to the power of 32
  for (int k = 0; k < squarings; ++k) {
    const std::array<double, 6> q = {
        m[0] * m[0] + m[3] * m[3] + m[4] * m[4], m[3] * m[3] + m[1] * m[1] + m[5] * m[5],
        m[4] * m[4] + m[5] * m[5] + m[2] * m[2], m[0] * m[3] + m[3] * m[1] + m[4] * m[5],
        m[0] * m[4] + m[3] * m[5] + m[4] * m[2], m[3] * m[4] + m[1] * m[5] + m[5] * m[2]};
    const double scale = 1 / (q[0] + q[1] + q[2]);
    for (size_t i = 0; i < 6; ++i) m[i] = q[i] * scale;
  }
  // Any column that is not zero points along the axis; the longest is the most exact.
  Vec3 axis = {m[0], m[3], m[4]};
  if (m[1] > m[0] && m[1] >= m[2]) axis = {m[3], m[1], m[5]};
  if (m[2] > m[0] && m[2] > m[1]) axis = {m[4], m[5], m[2]};
  const double length = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
  for (double& v : axis) v /= length;
  const double along = axis[0] * (c[0] * axis[0] + 2 * (c[3] * axis[1] + c[4] * axis[2])) +
                       axis[1] * (c[1] * axis[1] + 2 * c[5] * axis[2]) + c[2] * axis[2] * axis[2];
  line.residual = std::max(0.0, (trace - along) / (count * count));
  for (size_t i = 0; i < 3; ++i) line.axis[i] = static_cast<float>(axis[i]);
  return line;
}

std::array<float, 3> floats(Rgb c) {
  return {static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)};
}

/// Where a colour is in the space in which distances are measured, other than RGB.
std::array<float, 3> point_in(ErrorSpace space, Rgb color) {
  return space == ErrorSpace::lab ? lab_colors().point(color) : direction_point({color.r, color.g});
}

}  // namespace

void MacroColors::assign(std::span<const Rgb> colors, ErrorSpace space) {
  size_ = static_cast<uint32_t>(colors.size());
  space_ = space;
  for (auto& channel : channels_) channel.resize(colors.size() + color_vector);
  prefix_.resize(colors.size() + 1);
  prefix_[0] = {};
  Sums sums{};
  for (size_t i = 0; i < colors.size(); ++i) {
    const uint32_t r = colors[i].r, g = colors[i].g, b = colors[i].b;
    const Sums own = {r, g, b, r * r, g * g, b * b, r * g, r * b, g * b};
    for (size_t k = 0; k < own.size(); ++k) sums[k] += own[k];
    prefix_[i + 1] = sums;
    channels_[0][i] = static_cast<float>(r);
    channels_[1][i] = static_cast<float>(g);
    channels_[2][i] = static_cast<float>(b);
  }
  if (space == ErrorSpace::rgb) return;
  for (auto& channel : lab_) channel.resize(colors.size() + color_vector);
  for (size_t i = 0; i < colors.size(); ++i) {
    // Neighbours are often equal.
    const LabPoint point = i > 0 && colors[i] == colors[i - 1]
                               ? LabPoint{lab_[0][i - 1], lab_[1][i - 1], lab_[2][i - 1]}
                               : point_in(space, colors[i]);
    for (size_t c = 0; c < 3; ++c) lab_[c][i] = point[c];
  }
}

Rgb MacroColors::color(uint32_t i) const {
  return {static_cast<uint8_t>(channels_[0][i]), static_cast<uint8_t>(channels_[1][i]),
          static_cast<uint8_t>(channels_[2][i])};
}

namespace {

ColorRun run_of(const MacroColors& colors, uint32_t first, uint32_t last) {
  return {{colors.channel(0) + first, colors.channel(1) + first, colors.channel(2) + first}, last - first};
}

}  // namespace

Fitter::Fitter(const MacroColors& colors, Endpoints endpoints, uint32_t allowed, int effort)
    : colors_(colors), endpoints_(endpoints), allowed_(allowed), tries_(effort + 1) {
  // What is decoded is off a line by less than rounding may move it.
  constexpr double rounding = 0.87;
  const double reach = std::sqrt(static_cast<double>(allowed_)) + rounding;
  most_residual_ = reach * reach;
}

Rgb Fitter::quantised(const std::array<float, 3>& color) const {
  const auto to = [](float v, float most) {
    return static_cast<uint32_t>(std::clamp(v, 0.0f, 255.0f) * (most / 255.0f) + 0.5f);
  };
  if (endpoints_ != Endpoints::rgb565)
    return {static_cast<uint8_t>(to(color[0], 255)), static_cast<uint8_t>(to(color[1], 255)),
            static_cast<uint8_t>(to(color[2], 255))};
  return {from_5_bits(to(color[0], 31)), from_6_bits(to(color[1], 63)), from_5_bits(to(color[2], 31))};
}

void Fitter::fit(uint32_t first, uint32_t last, int bits, Fit& out) const {
  if (bits == 0)
    fit_single(first, last, out);
  else
    out = fit_line(first, last, bits);
}

Distances Fitter::lab_distances(const Fit& fit, uint32_t first, uint32_t last, uint32_t most,
                                uint8_t* weights) const {
  std::array<LabPoint, 1 << most_weight_bits> steps;
  const uint32_t count = fit.a == fit.b ? 1 : most + 1;
  for (uint32_t w = 0; w < count; ++w) steps[w] = point_in(colors_.space(), mix(fit.a, fit.b, w, most));
  const ColorRun run{
      {colors_.lab_channel(0) + first, colors_.lab_channel(1) + first, colors_.lab_channel(2) + first},
      last - first};
  return kernels_.nearest(run, steps.data(), static_cast<int>(count), allowed_, weights);
}

void Fitter::fit_single(uint32_t first, uint32_t last, Fit& fit) const {
  const uint32_t count = last - first;
  if (count == 1) {
    fit.feasible = true;
    fit.a = fit.b = colors_.color(first);
    fit.squared_error = 0;
    return;
  }
  fit.feasible = false;
  const MacroColors::Sums s = colors_.sums(first, last);
  const auto mean = [&](size_t c) { return static_cast<uint8_t>((2 * s[c] + count) / (2 * count)); };
  fit.a = fit.b = {mean(0), mean(1), mean(2)};
  if (colors_.space() != ErrorSpace::rgb) {
    const Distances d = lab_distances(fit, first, last, 1, nullptr);
    fit.squared_error = d.sum;
    fit.feasible = d.most <= allowed_;
    return;
  }
  // Of all single colours the mean has the least error, but for its rounding.
  const uint64_t squares = uint64_t{s[3]} + s[4] + s[5];
  const auto cross = [&](size_t c, uint8_t v) {
    return uint64_t{v} * (2 * uint64_t{s[c]} - uint64_t{v} * count);
  };
  fit.squared_error = squares - cross(0, fit.a.r) - cross(1, fit.a.g) - cross(2, fit.a.b);
  if (fit.squared_error > uint64_t{allowed_} * count) return;
  // No square is greater than the sum of them all.
  fit.feasible =
      fit.squared_error <= allowed_ || kernels_.within(run_of(colors_, first, last), floats(fit.a), allowed_);
}

Fit Fitter::fit_line(uint32_t first, uint32_t last, int bits) const {
  const ColorRun run = run_of(colors_, first, last);
  const int most = (1 << bits) - 1;
  const Line line = line_of(colors_.sums(first, last), run.size);
  const LineTries tries{
      {static_cast<float>(line.mean[0]), static_cast<float>(line.mean[1]), static_cast<float>(line.mean[2])},
      line.axis,
      static_cast<float>(line.mean[0] * line.axis[0] + line.mean[1] * line.axis[1] +
                         line.mean[2] * line.axis[2]),
      endpoints_,
      tries_};
  Fit best;
  if (colors_.space() != ErrorSpace::rgb) return fit_lab_line(first, last, bits, tries);
  // No line does better than this one.
  if (line.residual > most_residual_) return best;
  const LineFit fit = kernels_.line(run, tries, most, allowed_);
  return {fit.feasible, fit.a, fit.b, fit.squared_error};
}

Fit Fitter::fit_lab_line(uint32_t first, uint32_t last, int bits, const LineTries& line) const {
  const Extent extent = kernels_.extent(run_of(colors_, first, last), line.axis);
  const float lo = extent.least - line.center, hi = extent.most - line.center;
  const float half_cell = (hi - lo) / static_cast<float>(2 << bits);
  const auto end = [&](float t) {
    std::array<float, 3> color;
    for (size_t c = 0; c < 3; ++c) color[c] = line.mean[c] + t * line.axis[c];
    return quantised(color);
  };
  Fit best;
  for (int i = 0; i < line.tries && !best.feasible; ++i) {
    const float* const inset = line_insets + 8 * (i / 4) + i % 4;
    best.a = end(lo + inset[0] * half_cell);
    best.b = end(hi + inset[4] * half_cell);
    const Distances d = lab_distances(best, first, last, (1u << bits) - 1, nullptr);
    best.squared_error = d.sum;
    best.feasible = d.most <= allowed_;
    // Other ends are near these: where one colour is far off they do not help.
    constexpr uint32_t hopeless = 6;
    if (d.most / hopeless > allowed_) break;
  }
  return best;
}

uint32_t Fitter::weights(const Fit& fit, uint32_t first, uint32_t last, int bits, uint8_t* out) const {
  const uint32_t most = bits == 0 ? 1 : (1u << bits) - 1;
  if (colors_.space() != ErrorSpace::rgb) return lab_distances(fit, first, last, most, out).most;
  return kernels_
      .distances(run_of(colors_, first, last), floats(fit.a), floats(fit.b), static_cast<int>(most), allowed_,
                 out)
      .most;
}

}  // namespace voxkit::color
