// Runs of colours to test with.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "libcolor/surface/surface.h"

namespace voxkit::color {

struct ColorCase {
  std::string name;
  std::vector<Rgb> colors;
};

/// Gradients, checkers, noise of many kinds: `size` colours each.
inline std::vector<ColorCase> color_cases(size_t size, uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto byte = [&] { return static_cast<uint8_t>(random() >> 56); };
  const auto clamped = [](double v) { return static_cast<uint8_t>(v < 0 ? 0 : v > 255 ? 255 : v + 0.5); };
  std::vector<ColorCase> cases;
  const auto add = [&](std::string name, auto color) {
    ColorCase c{std::move(name), {}};
    for (size_t i = 0; i < size; ++i) c.colors.push_back(color(i));
    cases.push_back(std::move(c));
  };
  add("black", [](size_t) { return Rgb{}; });
  add("white noise", [&](size_t) { return Rgb{byte(), byte(), byte()}; });
  add("checkers", [](size_t i) { return i / 3 % 2 != 0 ? Rgb{200, 30, 10} : Rgb{190, 90, 250}; });
  add("gradient", [&](size_t i) {
    const double t = 255.0 * static_cast<double>(i) / static_cast<double>(size);
    return Rgb{clamped(t), clamped(255 - t), clamped(t / 2 + 40)};
  });
  double r = 100, g = 120, b = 90;
  std::normal_distribution<double> normal;
  add("walk", [&](size_t) {
    const double common = 3 * normal(random);
    r = std::clamp(r + common + normal(random), 0.0, 255.0);
    g = std::clamp(g + common + normal(random), 0.0, 255.0);
    b = std::clamp(b + common + normal(random), 0.0, 255.0);
    return Rgb{clamped(r), clamped(g), clamped(b)};
  });
  Rgb held;
  add("patches", [&](size_t) {
    if (random() % 20 == 0) held = {byte(), byte(), byte()};
    return Rgb{clamped(held.r + 2 * normal(random)), clamped(held.g + 2 * normal(random)),
               clamped(held.b + 2 * normal(random))};
  });
  add("extremes", [&](size_t) {
    return Rgb{static_cast<uint8_t>(random() % 2 * 255), static_cast<uint8_t>(random() % 2 * 255),
               static_cast<uint8_t>(random() % 2 * 255)};
  });
  return cases;
}

}  // namespace voxkit::color
