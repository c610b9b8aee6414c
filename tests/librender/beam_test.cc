// What a cell hides of a pixel agrees with nine rays that are followed one by one.
#include "librender/cast/beam.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace voxkit::render {
namespace {

bool part(uint64_t parts, const std::array<int, 3>& at) {
  int code = 0;
  for (int bit = 0; bit < 2; ++bit)
    for (int a = 0; a < 3; ++a) code |= (at[static_cast<size_t>(a)] >> bit & 1) << (3 * bit + a);
  return (parts >> code & 1) != 0;
}

/// The same, ray by ray and part by part.
struct PlainBeam {
  std::array<double, 3> origin, direction;
  std::array<bool, 9> open;
  PlainBeam() { open.fill(true); }

  int count() const { return static_cast<int>(std::count(open.begin(), open.end(), true)); }
  int hide(uint64_t parts, const uint32_t (&voxel)[3], int log2_edge, double& t) {
    size_t axis = 0;
    for (size_t a = 1; a < 3; ++a)
      if (std::abs(direction[a]) > std::abs(direction[axis])) axis = a;
    const double edge = std::ldexp(1, log2_edge - 2);
    std::array<double, 3> corner;
    for (size_t a = 0; a < 3; ++a) corner[a] = std::floor(voxel[a] / (4 * edge)) * 4 * edge;
    // The part that a ray is in, as it crosses plane k, of layer `layer`.
    const auto place = [&](size_t ray, int k, int layer) {
      const double when = (corner[axis] + k * edge - origin[axis]) / direction[axis];
      std::array<int, 3> at;
      int off[2] = {static_cast<int>(ray % 3) - 1, static_cast<int>(ray / 3) - 1};
      for (size_t a = 0, i = 0; a < 3; ++a)
        at[a] = a == axis
                    ? layer
                    : static_cast<int>(std::floor((origin[a] + direction[a] * when - corner[a]) / edge)) +
                          off[i++];
      return at;
    };
    const auto inside = [](const std::array<int, 3>& at) {
      return at[0] >= 0 && at[0] < 4 && at[1] >= 0 && at[1] < 4 && at[2] >= 0 && at[2] < 4;
    };
    std::array<bool, 9> hidden{}, comes{};
    int first = -1;
    for (int n = 0; n < 4; ++n) {
      const int layer = direction[axis] > 0 ? n : 3 - n, enter = direction[axis] > 0 ? layer : layer + 1;
      for (size_t ray = 0; ray < 9; ++ray) {
        for (const int k : {layer, layer + 1}) {
          const auto at = place(ray, k, layer);
          if (!inside(at) || !part(parts, at)) continue;
          hidden[ray] = true;
          if (open[ray] && first < 0) first = enter;
        }
        comes[ray] |= inside(place(ray, enter, layer));
      }
    }
    if (first < 0) return 0;
    t = std::max(t, (corner[axis] + first * edge - origin[axis]) / direction[axis]);
    const int before = count();
    const bool middle = open[4] && hidden[4];
    for (size_t ray = 0; ray < 9; ++ray) open[ray] = open[ray] && !hidden[ray] && (comes[ray] || !middle);
    if (count() <= 5) open.fill(false);
    return before - count();
  }
};

TEST(Beam, HidesWhatRaysOneByOneMeet) {
  std::mt19937_64 random(11);
  const auto uniform = [&](double lo, double hi) {
    return lo + (hi - lo) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  for (int trial = 0; trial < 20000; ++trial) {
    PlainBeam plain;
    double origin[3], direction[3];
    for (size_t a = 0; a < 3; ++a) {
      origin[a] = uniform(-50, 100);
      direction[a] = trial % 7 == 0 && a != size_t(trial % 3) ? 0 : uniform(-1, 1);
      plain.origin[a] = origin[a];
      plain.direction[a] = direction[a];
    }
    Beam beam(origin, direction);
    double at = uniform(1, 80);
    for (int cell = 0; cell < 6; ++cell, at += 5) {
      const int log2_edge = 2 + static_cast<int>(random() % 3);
      uint32_t voxel[3];
      for (size_t a = 0; a < 3; ++a)
        voxel[a] = static_cast<uint32_t>(std::max(0.0, origin[a] + direction[a] * at));
      uint64_t parts = random();
      for (int sparser = trial % 4; sparser > 0; --sparser) parts &= random();
      double t = at, plain_t = at;
      ASSERT_EQ(beam.hide(parts, voxel, log2_edge, t), plain.hide(parts, voxel, log2_edge, plain_t));
      ASSERT_EQ(beam.open(), plain.count());
      ASSERT_NEAR(t, plain_t, 1e-6 * (1 + plain_t));
    }
    const int left = beam.open();
    EXPECT_EQ(beam.hide_all(), left);
    EXPECT_EQ(beam.open(), 0);
  }
}

/// A full cell hides all of the pixel, an empty one nothing, along every axis.
TEST(Beam, FullAndEmptyCells) {
  const uint32_t voxel[3] = {9, 10, 11};
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {-1.0, 1.0}) {
      double origin[3] = {9.5, 10.5, 11.5}, direction[3] = {};
      origin[axis] -= 100 * sign;
      direction[axis] = sign;
      double t = 80;
      EXPECT_EQ(Beam(origin, direction).hide(0, voxel, 2, t), 0);
      EXPECT_EQ(t, 80);
      EXPECT_EQ(Beam(origin, direction).hide(~uint64_t{0}, voxel, 2, t), 9);
    }
}

}  // namespace
}  // namespace voxkit::render
