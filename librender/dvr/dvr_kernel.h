// The arithmetic of one sample of direct volume rendering, on the host or a device: what a cell of eight
// voxels has at a point, how much light it stops, how it is lit (Guthe and Goesele 2016, section 5).
//
// Real is float, or a vector of floats: samples side by side. No function compares or branches on samples, so
// both give the same bits. `Lanes` is OneLane of dvr_lane.h, or has the same for what Real is.
#pragma once

#include "formats/hd.h"
#include "librender/dvr/dvr_lane.h"
#include "librender/light.h"

namespace voxkit::render {

/// 2^x of x <= 0: exactly 1 at 0; relative error below 3e-7; 2^-126 and less is 2^-126.
template <class Lanes, class Real>
VOX_HD_HOT Real exp2_of_density(Real x) {
  x = Lanes::greatest(x, x * 0 - 126.0f);
  const auto whole = Lanes::to_int(x - 0.5f);
  const Real y = (x - Lanes::to_float(whole)) * 0.693147181f;  // |y| < 0.35
  Real sum = y * (1.0f / 720) + 1.0f / 120;
  sum = sum * y + 1.0f / 24;
  sum = sum * y + 1.0f / 6;
  sum = sum * y + 0.5f;
  sum = sum * y + 1.0f;
  sum = sum * y + 1.0f;
  return sum * Lanes::bits_as_float((whole + 127) << 23);
}

/// log2 of 2^-126 <= x <= 1: exactly 0 at 1; absolute error below 2e-6.
template <class Lanes, class Real>
VOX_HD_HOT Real log2_of_share(const Real& x) {
  const auto bits = Lanes::float_as_bits(x);
  // The exponent for a mantissa from sqrt(1/2) to sqrt(2).
  const auto exponent = ((bits - 0x3f3504f3) >> 23);
  const Real m = Lanes::bits_as_float(bits - (exponent << 23));
  const Real s = (m - 1.0f) / (m + 1.0f), q = s * s;
  Real sum = q * (1.0f / 9) + 1.0f / 7;
  sum = sum * q + 1.0f / 5;
  sum = sum * q + 1.0f / 3;
  sum = sum * q + 1.0f;
  return Lanes::to_float(exponent) + sum * s * 2.88539008f;
}

template <class Real>
struct Vec {
  Real x, y, z;
};
template <class Real, class Other>
VOX_HD_HOT Real dot(const Vec<Real>& a, const Vec<Other>& b) {
  return a.x * b.x + (a.y * b.y + a.z * b.z);
}
template <class Real>
VOX_HD_HOT Vec<Real> cross(const Vec<Real>& a, const Vec<Real>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class Real>
VOX_HD_HOT Vec<Real> operator-(const Vec<Real>& a, const Vec<Real>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}

/// The value at a place of a cell, whose corner voxels are v[x + 2y + 4z], and its gradient there, in values
/// a voxel.
template <class Real>
struct Interpolated {
  Real value;
  Vec<Real> gradient;
};
template <bool with_gradient, class Real>
VOX_HD_HOT Interpolated<Real> interpolate(const Real (&v)[8], const Vec<Real>& at) {
  const Real dx0 = v[1] - v[0], dx1 = v[3] - v[2], dx2 = v[5] - v[4], dx3 = v[7] - v[6];
  const Real y0 = v[0] + at.x * dx0, y1 = v[2] + at.x * dx1, y2 = v[4] + at.x * dx2, y3 = v[6] + at.x * dx3;
  const Real dy0 = y1 - y0, dy1 = y3 - y2;
  const Real z0 = y0 + at.y * dy0, z1 = y2 + at.y * dy1;
  const Real dz = z1 - z0;
  Interpolated<Real> found;
  found.value = z0 + at.z * dz;
  if constexpr (with_gradient) {
    const Real gx0 = dx0 + at.y * (dx1 - dx0), gx1 = dx2 + at.y * (dx3 - dx2);
    found.gradient = {gx0 + at.z * (gx1 - gx0), dy0 + at.z * (dy1 - dy0), dz};
  }
  return found;
}

/// The gradient from three samples elsewhere, each off by a way and a difference of values: solves
/// way . gradient = difference. `accepted`: whether no way is shorter than `shortest`, below which the
/// rounding of places would show, the ways are far enough from lying in a plane, and nothing has become too
/// large for a float; then the gradient means something.
template <class Real>
struct Solved {
  Vec<Real> gradient;
  decltype((Real{} < Real{}) & (Real{} < Real{})) accepted;
};
template <class Lanes, class Real>
VOX_HD_HOT Solved<Real> solve_gradient(const Vec<Real> (&way)[3], const Real (&difference)[3],
                                       float shortest) {
  constexpr float least = 1e-3f;
  const Vec<Real> c12 = cross(way[1], way[2]), c20 = cross(way[2], way[0]), c01 = cross(way[0], way[1]);
  const Real det = dot(way[0], c12);
  const Real square[3] = {dot(way[0], way[0]), dot(way[1], way[1]), dot(way[2], way[2])};
  const Real bound = (square[0] * square[1]) * (square[2] * (least * least));
  const Real nearest = Lanes::least(square[0], Lanes::least(square[1], square[2]));
  const auto accepted = (det * det >= bound) & (bound > 0.0f) & (nearest >= shortest * shortest);
  const Real inverse = 1.0f / det;  // of 0: not accepted
  const auto part = [&](const Real& a, const Real& b, const Real& c) {
    return (a * difference[0] + (b * difference[1] + c * difference[2])) * inverse;
  };
  const Vec<Real> gradient = {part(c12.x, c20.x, c01.x), part(c12.y, c20.y, c01.y),
                              part(c12.z, c20.z, c01.z)};
  const Real sum = (gradient.x + gradient.y) + gradient.z;
  return {gradient, accepted & (sum - sum == 0.0f)};
}

/// Blinn-Phong: what a colour is multiplied by, and what is added to it.
template <class Real>
struct Lit {
  Real diffuse, specular;
};
/// `gradient` in the world; the side that faces the viewer is lit. `light`, `half`: unit vectors to the light
/// and halfway between it and the viewer; `ahead`: along the ray. Where the gradient is less than `flat`
/// there is no surface, and the colour stays as it is.
template <class Lanes, class Real>
VOX_HD_HOT Lit<Real> light_sample(const Vec<Real>& gradient, const Vec<float>& light, const Vec<Real>& half,
                                  const Vec<Real>& ahead, float flat) {
  const Real square = dot(gradient, gradient);
  const auto is_surface = square > flat * flat;
  const Real zero = half.x * 0, least = zero + 1e-36f;
  const Real scale = 1.0f / Lanes::root(Lanes::greatest(square, least));
  const Real towards = dot(gradient, ahead) > 0.0f ? -scale : scale;
  const Real n_light = Lanes::greatest(dot(gradient, light) * towards, zero);
  Real n_half = Lanes::greatest(dot(gradient, half) * towards, zero);
  for (int i = 0; i < log2_shine; ++i) n_half = n_half * n_half;
  const Real one = zero + 1.0f;
  return {is_surface ? ambient_light + diffuse_light * n_light : one,
          is_surface ? specular_light * n_half : zero};
}

}  // namespace voxkit::render
