// Polygons and the triangles that they become.
#include "formats/mesh/polygon.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace voxkit {
namespace {

using Corners = std::vector<glm::dvec3>;

double area(const Corners& corners, const std::array<uint32_t, 3>& t) {
  const glm::dvec3 u = corners[t[1]] - corners[t[0]], v = corners[t[2]] - corners[t[0]];
  return (u.x * v.y - u.y * v.x) / 2;
}
double area(const Corners& corners) {
  double sum = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const auto& a = corners[i];
    const auto& b = corners[(i + 1) % corners.size()];
    sum += (a.x * b.y - a.y * b.x) / 2;
  }
  return sum;
}

/// Triangles that cover what the polygon does, once.
void expect_covered(const Corners& corners) {
  PolygonSplitter splitter;
  std::vector<std::array<uint32_t, 3>> triangles;
  ASSERT_TRUE(splitter.split(corners, triangles));
  const double want = area(corners), sign = want < 0 ? -1 : 1;
  double sum = 0;
  for (const auto& t : triangles) {
    EXPECT_GE(sign * area(corners, t), -1e-9);
    sum += area(corners, t);
  }
  EXPECT_NEAR(sum, want, 1e-9 * std::abs(want));
}

TEST(Polygon, ConvexOnesAreFans) {
  PolygonSplitter splitter;
  std::vector<std::array<uint32_t, 3>> triangles;
  ASSERT_TRUE(splitter.split(Corners{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, triangles));
  EXPECT_EQ(triangles, (std::vector<std::array<uint32_t, 3>>{{0, 1, 2}, {0, 2, 3}}));
}

TEST(Polygon, HollowOnes) {
  expect_covered({{0, 0, 0}, {2, 1, 0}, {0, 2, 0}, {1, 1, 0}});  // an arrow head
  expect_covered({{1, 1, 0}, {0, 0, 0}, {2, 1, 0}, {0, 2, 0}});  // from its notch on
  expect_covered({{0, 2, 0}, {2, 1, 0}, {0, 0, 0}, {1, 1, 0}});  // the other way round
  expect_covered(
      {{0, 0, 0}, {3, 0, 0}, {3, 3, 0}, {2, 3, 0}, {2, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}});  // a U
  // Corners on a line, and one twice.
  expect_covered({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 1, 0}, {0, 2, 0}});
  // A square with a square hole, tied to its border.
  expect_covered({{0, 0, 0},
                  {4, 0, 0},
                  {4, 4, 0},
                  {0, 4, 0},
                  {0, 0, 0},
                  {1, 1, 0},
                  {1, 3, 0},
                  {3, 3, 0},
                  {3, 1, 0},
                  {1, 1, 0}});
}

TEST(Polygon, ASpiralAndRandomStars) {
  Corners spiral;
  for (int i = 0; i < 200; ++i)
    spiral.push_back({(10 + 0.1 * i) * std::cos(0.1 * i), (10 + 0.1 * i) * std::sin(0.1 * i), 0});
  for (int i = 200; i-- > 0;)
    spiral.push_back({(10.5 + 0.1 * i) * std::cos(0.1 * i), (10.5 + 0.1 * i) * std::sin(0.1 * i), 0});
  expect_covered(spiral);
  std::mt19937 random(1);
  for (int n = 0; n < 100; ++n) {
    Corners star;
    const int count = 5 + static_cast<int>(random() % 200);
    for (int i = 0; i < count; ++i) {
      const double r = 1 + static_cast<double>(random() % 1000) / 100;
      star.push_back({r * std::cos(2 * M_PI * i / count), r * std::sin(2 * M_PI * i / count), 0});
    }
    expect_covered(star);
  }
}

TEST(Polygon, InAnyPlane) {
  // The arrow head in the plane x = y, seen from both sides: as many triangles, in it.
  for (const bool turned : {false, true}) {
    Corners corners{{0, 0, 0}, {2, 2, 1}, {0, 0, 2}, {1, 1, 1}};
    if (turned) std::reverse(corners.begin(), corners.end());
    PolygonSplitter splitter;
    std::vector<std::array<uint32_t, 3>> triangles;
    ASSERT_TRUE(splitter.split(corners, triangles));
    EXPECT_EQ(triangles.size(), 2u);
    const uint32_t notch = turned ? 0 : 3;
    for (const auto& t : triangles) EXPECT_NE(std::find(t.begin(), t.end(), notch), t.end());
  }
}

TEST(Polygon, WhatIsNoneEnds) {
  PolygonSplitter splitter;
  std::vector<std::array<uint32_t, 3>> triangles;
  EXPECT_TRUE(splitter.split(Corners(5, {1, 2, 3}), triangles));
  EXPECT_TRUE(splitter.split(Corners{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}, triangles));
  EXPECT_TRUE(splitter.split(Corners{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}, triangles));  // a bow tie
  EXPECT_TRUE(splitter.split(Corners{{NAN, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, INFINITY, 0}}, triangles));
  EXPECT_TRUE(splitter.split(Corners{{1e300, 0, 0}, {-1e300, 0, 0}, {1, 1e300, 0}, {0, 1, 0}}, triangles));
  for (const auto& t : triangles)
    for (const uint32_t i : t) EXPECT_LT(i, 5u);
  // Many corners at random: they end, or are refused.
  std::mt19937 random(1);
  Corners wild;
  for (int i = 0; i < 100000; ++i)
    wild.push_back({static_cast<double>(random() % 10000), static_cast<double>(random() % 10000), 0});
  triangles.clear();
  const bool done = splitter.split(wild, triangles);
  EXPECT_TRUE(!done || triangles.size() <= wild.size());
}

}  // namespace
}  // namespace voxkit
