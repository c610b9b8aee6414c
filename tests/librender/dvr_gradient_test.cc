// Gradients: how far they are from those of the function that was sampled, and where none can be had.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <random>
#include <vector>

#include "librender/dvr/dvr_lanes.h"
#include "librender/dvr/dvr_packet.h"

namespace voxkit::render {
namespace {

using Function = std::function<double(const glm::dvec3&)>;

/// Of Marschner and Lobb, within -1 .. 1, on a grid of 40 voxels; and of a sphere with a soft edge.
double marschner_lobb(const glm::dvec3& voxel) {
  const glm::dvec3 p = voxel / 20.0 - 1.0;
  const double r = std::sqrt(p.x * p.x + p.y * p.y), pi = 3.14159265358979;
  const double rho = std::cos(2 * pi * 6 * std::cos(pi * r / 2));
  return 255 * (1 - std::sin(pi * p.z / 2) + 0.25 * (1 + rho)) / (2 * 1.25);
}
double ball(const glm::dvec3& voxel) {
  return 255 / (1 + std::exp(glm::length(voxel - 20.0) - 12));
}
glm::dvec3 gradient_of(const Function& f, const glm::dvec3& at) {
  glm::dvec3 g;
  for (int a = 0; a < 3; ++a) {
    glm::dvec3 d(0);
    d[a] = 1e-4;
    g[a] = (f(at + d) - f(at - d)) / 2e-4;
  }
  return g;
}
Interpolated<float> sample(const Function& f, const glm::dvec3& at) {
  const glm::dvec3 cell = glm::floor(at);
  float v[8];
  for (int i = 0; i < 8; ++i) v[i] = static_cast<float>(f(cell + glm::dvec3(i & 1, i >> 1 & 1, i >> 2)));
  const glm::vec3 within(at - cell);
  return interpolate<true>(v, Vec<float>{within.x, within.y, within.z});
}
double degrees_between(const glm::dvec3& a, const Vec<float>& b) {
  const glm::dvec3 c(b.x, b.y, b.z);
  return std::acos(std::clamp(glm::dot(glm::normalize(a), glm::normalize(c)), -1.0, 1.0)) * 57.29577951308232;
}

struct Errors {
  double mean, rare;  ///< the rare one: the 99.9th percentile
};
Errors errors(std::vector<double> angles) {
  std::sort(angles.begin(), angles.end());
  double sum = 0;
  for (const double a : angles) sum += a;
  const auto n = static_cast<double>(angles.size());
  return {sum / n, angles[static_cast<size_t>(n * 0.999)]};
}

/// Samples where there is something to light, as rays of a picture take them: neighbours 0.4 voxels apart,
/// depths half a voxel, seen from any side.
void measure(const Function& f, Errors& analytic, Errors& neighbour) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(6, 34), unit(-1, 1);
  std::vector<double> cell, rays;
  while (cell.size() < 20000) {
    const glm::dvec3 at(place(random), place(random), place(random));
    const glm::dvec3 expected = gradient_of(f, at);
    if (glm::length(expected) < 4) continue;
    const Interpolated<float> here = sample(f, at);
    cell.push_back(degrees_between(expected, here.gradient));
    const glm::dvec3 ahead = glm::normalize(glm::dvec3(unit(random), unit(random), unit(random)) + 1e-3);
    const glm::dvec3 right = glm::normalize(glm::cross(ahead, glm::dvec3(0.3, 0.9, 0.1))),
                     down = glm::cross(ahead, right);
    const glm::dvec3 ways[3] = {right * 0.4 + ahead * 0.02, down * 0.4, ahead * 0.5};
    Vec<float> way[3];
    float difference[3];
    for (int i = 0; i < 3; ++i) {
      way[i] = {static_cast<float>(ways[i].x), static_cast<float>(ways[i].y), static_cast<float>(ways[i].z)};
      difference[i] = sample(f, at + ways[i]).value - here.value;
    }
    const auto solved = solve_gradient<OneLane>(way, difference, 0);
    ASSERT_TRUE(solved.accepted);
    rays.push_back(degrees_between(expected, solved.gradient));
  }
  analytic = errors(cell), neighbour = errors(rays);
}

TEST(DvrGradient, IsNearThatOfTheFunction) {
  Errors analytic, neighbour;
  measure(ball, analytic, neighbour);
  RecordProperty("sphere", std::to_string(analytic.mean) + " " + std::to_string(analytic.rare) + " " +
                               std::to_string(neighbour.mean) + " " + std::to_string(neighbour.rare));
  EXPECT_LT(analytic.mean, 4.5);
  EXPECT_LT(analytic.rare, 18);
  EXPECT_LT(neighbour.mean, 4.7);
  EXPECT_LT(neighbour.rare, 23);
  measure(marschner_lobb, analytic, neighbour);
  RecordProperty("marschner_lobb", std::to_string(analytic.mean) + " " + std::to_string(analytic.rare) + " " +
                                       std::to_string(neighbour.mean) + " " + std::to_string(neighbour.rare));
  EXPECT_LT(analytic.mean, 28);
  EXPECT_LT(neighbour.mean, 30);
}

TEST(DvrGradient, OfALinearFunctionIsExact) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(-1, 1);
  for (int i = 0; i < 1000; ++i) {
    const Vec<float> g{unit(random), unit(random), unit(random)};
    Vec<float> way[3];
    float difference[3];
    for (int k = 0; k < 3; ++k) {
      way[k] = {unit(random), unit(random), unit(random)};
      difference[k] = dot(way[k], g);
    }
    const auto solved = solve_gradient<OneLane>(way, difference, 0);
    if (!solved.accepted) continue;
    EXPECT_NEAR(solved.gradient.x, g.x, 2e-3);
    EXPECT_NEAR(solved.gradient.y, g.y, 2e-3);
    EXPECT_NEAR(solved.gradient.z, g.z, 2e-3);
  }
}

TEST(DvrGradient, WaysInAPlaneAreRefused) {
  const float difference[3] = {1, 2, 3};
  const Vec<float> none{0, 0, 0}, x{1, 0, 0}, y{0, 1, 0}, xy{1, 1, 0}, nearly{1, 1, 1e-3f},
      clear{1, 1, 5e-3f};
  for (const auto& last : {none, x, xy, nearly}) {
    const Vec<float> way[3] = {x, y, last};
    EXPECT_FALSE(solve_gradient<OneLane>(way, difference, 0).accepted);
  }
  const Vec<float> good[3] = {x, y, clear};
  EXPECT_TRUE(solve_gradient<OneLane>(good, difference, 0).accepted);
  // Tiny ways, as of a narrow field of view, are as good as long ones, but for the rounding of places.
  const Vec<float> tiny[3] = {{1e-4f, 0, 0}, {0, 1e-4f, 0}, {0, 0, 1e-4f}};
  EXPECT_TRUE(solve_gradient<OneLane>(tiny, difference, 0).accepted);
  EXPECT_TRUE(solve_gradient<OneLane>(tiny, difference, 0.9e-4f).accepted);
  EXPECT_FALSE(solve_gradient<OneLane>(tiny, difference, 1.1e-4f).accepted);
  const Vec<float> odd[3] = {{NAN, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  EXPECT_FALSE(solve_gradient<OneLane>(odd, difference, 0).accepted);
}

/// A packet's samples of a linear function at two depths, `across` from ray to ray.
struct Packet {
  DvrSamples<PortableLanes> first, second;
};
Packet packet_of(const glm::dvec3& slope, const glm::dvec3& at, const glm::dvec3& across,
                 const glm::dvec3& down, const glm::dvec3& ahead, unsigned inside) {
  Packet packet;
  for (int depth = 0; depth < 2; ++depth) {
    auto& s = depth == 0 ? packet.first : packet.second;
    for (int i = 0; i < 8; ++i) {
      const glm::vec3 p(at + across * double(i % 4) + down * double(i / 4) + ahead * double(depth));
      const bool there = inside >> (8 * depth + i) & 1;
      s.place.clamped.x[i] = p.x, s.place.clamped.y[i] = p.y, s.place.clamped.z[i] = p.z;
      s.here.value[i] = there ? static_cast<float>(1000 + glm::dot(slope, glm::dvec3(p))) : NAN;
      s.here.gradient.x[i] = static_cast<float>(slope.x);
      s.here.gradient.y[i] = static_cast<float>(slope.y);
      s.here.gradient.z[i] = static_cast<float>(slope.z);
      s.inside[i] = there ? -1 : 0;
    }
  }
  return packet;
}

TEST(DvrGradient, NearSingularCasesAreNeverTurnedRoundNorNoNumbers) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto any = [&] { return glm::dvec3(unit(random), unit(random), unit(random)); };
  constexpr float shortest = 256 * 0x1p-16f;
  int64_t taken = 0, all = 0;
  for (int i = 0; i < 20000; ++i) {
    const glm::dvec3 slope = any() * std::exp2(6 * unit(random)), ahead = glm::normalize(any() + 1e-3);
    const glm::dvec3 right = glm::normalize(glm::cross(ahead, any() + 2e-3)), down = glm::cross(ahead, right);
    // Narrow fields of view; directions that nearly lie in a plane, or in a line; rays that are not there.
    const double width = std::exp2(-1 - i % 20), tilt = std::exp2(-(i / 20 % 16));
    const glm::dvec3 ways[3][3] = {{right * width, down * width, ahead * 0.5},
                                   {right, glm::mix(right, down, tilt), ahead},
                                   {right, down, glm::mix(right + down, ahead, tilt)}};
    const auto& way = ways[i % 3];
    const unsigned inside = i % 5 == 0 ? static_cast<unsigned>(random()) : ~0u;
    Packet packet = packet_of(slope, glm::dvec3(200) + any() * 40.0, way[0], way[1], way[2], inside);
    const DvrSamples<PortableLanes> before = packet.first;
    use_neighbours<PortableLanes>(shortest, 1, packet.first, packet.second);
    for (int lane = 0; lane < 8; ++lane) {
      const auto& g = packet.first.here.gradient;
      const glm::dvec3 got(g.x[lane], g.y[lane], g.z[lane]);
      ASSERT_TRUE(std::isfinite(got.x) && std::isfinite(got.y) && std::isfinite(got.z)) << i;
      ASSERT_GT(glm::dot(got, slope), 0) << i;
      ++all;
      taken += g.x[lane] != before.here.gradient.x[lane];
      // What is not there, and what is too near, says nothing.
      const unsigned needed = 1u << lane | 1u << (lane ^ 1) | 1u << (lane ^ 4) | 256u << lane;
      if ((inside & needed) != needed || (i % 3 == 0 && width < static_cast<double>(shortest) / 2)) {
        ASSERT_EQ(g.x[lane], before.here.gradient.x[lane]) << i;
      }
    }
  }
  EXPECT_GT(taken * 4, all);  // many are determined
}

TEST(DvrGradient, LightIsNeverNegativeNorNoNumber) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(-1, 1);
  const Vec<float> light{0.6f, 0.64f, 0.48f};
  for (int i = 0; i < 10000; ++i) {
    const float scale = std::ldexp(1.0f, i % 60 - 45);
    const Vec<float> gradient{unit(random) * scale, unit(random) * scale,
                              i % 7 == 0 ? 0 : unit(random) * scale};
    const Vec<float> ahead{0, 0, -1}, half{0.35f, 0.37f, 0.86f};
    const Lit<float> lit = light_sample<OneLane>(gradient, light, half, ahead, 1e-6f);
    ASSERT_TRUE(lit.diffuse >= 0.3f && lit.diffuse <= 1 && lit.specular >= 0 && lit.specular < 0.2f);
    // Which side is lit does not depend on the gradient's sign.
    const Lit<float> other =
        light_sample<OneLane>({-gradient.x, -gradient.y, -gradient.z}, light, half, ahead, 1e-6f);
    if (gradient.z != 0) {
      ASSERT_EQ(lit.diffuse, other.diffuse);
    }
  }
}

TEST(DvrArithmetic, PowersAndLogarithms) {
  for (double x = 0; x < 120; x += 0.0137) {
    const auto y = static_cast<double>(exp2_of_density<OneLane>(static_cast<float>(-x)));
    ASSERT_NEAR(y / std::exp2(static_cast<double>(static_cast<float>(-x))), 1, 3e-7) << x;
    const float share = static_cast<float>(std::exp2(-x));
    ASSERT_NEAR(static_cast<double>(log2_of_share<OneLane>(share)), std::log2(static_cast<double>(share)),
                2e-6 + x * 1e-7)
        << x;
  }
  EXPECT_EQ(exp2_of_density<OneLane>(0.0f), 1);
  EXPECT_EQ(exp2_of_density<OneLane>(-1e30f), 0x1p-126f);
  EXPECT_EQ(log2_of_share<OneLane>(1.0f), 0);
}

}  // namespace
}  // namespace voxkit::render
