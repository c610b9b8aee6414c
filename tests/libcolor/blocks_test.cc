// Block encoded colours: the bound holds, what is decoded is what was planned, on any machine and from any
// bytes.
#include <gtest/gtest.h>

#include <cmath>

#include "libcolor/blocks/block_encode.h"
#include "libcolor/blocks/block_kernel.h"
#include "libcolor/blocks/block_plan.h"
#include "tests/libcolor/color_runs.h"

namespace voxkit::color {
namespace {

uint32_t squared_distance(Rgb a, Rgb b) {
  const int r = a.r - b.r, g = a.g - b.g, c = a.b - b.b;
  return static_cast<uint32_t>(r * r + g * g + c * c);
}
PartView view_of(const EncodedPart& part, size_t colors, const BlockOptions& options) {
  return {part.bytes.data(), part.bytes.size(), static_cast<uint32_t>(colors),
          endpoints_for(options.threshold)};
}

TEST(Blocks, NoColorIsFurtherThanTheThreshold) {
  for (const double threshold : {0.0, 0.5, 1.0, 3.0, 6.12, 6.13, 6.38, 9.56, 12.8, 25.5, 64.0, 1000.0})
    for (const int weight_bits : {0, 1, 3, 4})
      for (const ColorCase& c : color_cases(3000, 1)) {
        SCOPED_TRACE(testing::Message() << c.name << ", " << threshold << ", " << weight_bits << " bits");
        const BlockOptions options{threshold, weight_bits, 1};
        const EncodedPart part = encode_part(c.colors, options);
        const PartView view = view_of(part, c.colors.size(), options);
        ASSERT_TRUE(view.valid());
        uint64_t sum = 0;
        uint32_t most = 0;
        for (size_t i = 0; i < c.colors.size(); ++i) {
          const uint32_t d = squared_distance(c.colors[i], view.color(static_cast<uint32_t>(i)));
          sum += d;
          most = std::max(most, d);
        }
        EXPECT_LE(most, threshold * threshold);
        EXPECT_EQ(sum, part.squared_error);
        EXPECT_EQ(most, part.most_squared);
      }
}

TEST(Blocks, OptimalParsingHoldsTheBoundAndIsNeverLarger) {
  for (const double threshold : {0.5, 4.0, 9.56, 25.5})
    for (const ColorCase& c : color_cases(20000, 7)) {
      SCOPED_TRACE(testing::Message() << c.name << ", " << threshold);
      uint64_t before = encode_part(c.colors, {threshold, 0, 1}).bytes.size();
      for (const int effort : {2, 3, 9}) {
        const BlockOptions options{threshold, 0, effort};
        const EncodedPart part = encode_part(c.colors, options);
        EXPECT_LE(part.bytes.size(), before) << effort;
        const PartView view = view_of(part, c.colors.size(), options);
        for (size_t i = 0; i < c.colors.size(); ++i)
          ASSERT_LE(squared_distance(c.colors[i], view.color(static_cast<uint32_t>(i))),
                    threshold * threshold);
      }
    }
}

/// All cuts of a few colours, one by one.
uint64_t cheapest_cut(const MacroColors& colors, const Fitter& fitter, Endpoints endpoints, uint32_t first,
                      std::vector<uint64_t>& known) {
  if (first == colors.size()) return 0;
  uint64_t& best = known[first];
  if (best != 0) return best;
  best = ~uint64_t{0};
  for (uint32_t last = first + 1; last <= colors.size(); ++last)
    for (int bits = 0; bits <= most_weight_bits; ++bits)
      if (fitter.fit(first, last, bits).feasible)
        best = std::min(best, block_cost(last - first, bits, endpoints) +
                                  cheapest_cut(colors, fitter, endpoints, last, known));
  return best;
}

TEST(Blocks, FromEffort4OnNothingIsLargerThanGreedyMerging) {
  // Nearly on a line, found by search (tests/stress): trying few ends of blocks misses what greedy merging
  // finds.
  std::vector<Rgb> colors;
  for (const uint32_t c : {0x010002, 0x040607, 0x070b11, 0x0b121b, 0x0c1823, 0x101e2c, 0x152536, 0x152a3f,
                           0x183048, 0x1b3651, 0x1e3b5a, 0x1f4163, 0x22486b, 0x274f75, 0x2e547e, 0x2e5987,
                           0x338c96, 0x005dbf, 0x386e9f, 0x3972aa, 0x3c79b5, 0x4a7ebe, 0xdaa5f7, 0x443b5f})
    colors.push_back({static_cast<uint8_t>(c >> 16), static_cast<uint8_t>(c >> 8), static_cast<uint8_t>(c)});
  const auto bytes = [&](int effort) {
    return encode_part(colors, {1, 0, effort, ErrorSpace::lab}).bytes.size();
  };
  EXPECT_GT(bytes(2), bytes(1));  // else this is no example
  for (int effort = greedy_too; effort <= 9; ++effort) EXPECT_LE(bytes(effort), bytes(1)) << effort;
}

TEST(Blocks, ParsingIsCloseToTheBestCut) {
  uint64_t best = 0, found = 0, greedy = 0;
  PlanMemory memory;
  for (uint64_t seed = 10; seed < 20; ++seed)
    for (const ColorCase& c : color_cases(80, seed)) {
      const MacroColors colors(c.colors);
      const Fitter fitter(colors, Endpoints::rgb565, 91, 3);
      const auto cost_of = [&](const std::vector<PlannedBlock>& plan) {
        uint64_t cost = 0;
        for (const PlannedBlock& b : plan) cost += block_cost(b.last - b.first, b.bits, Endpoints::rgb565);
        return cost;
      };
      std::vector<uint64_t> known(c.colors.size());
      const uint64_t least = cheapest_cut(colors, fitter, Endpoints::rgb565, 0, known);
      const uint64_t own = cost_of(parse_optimally(colors, fitter, Endpoints::rgb565, 9, memory));
      EXPECT_GE(own, least);
      best += least;
      found += own;
      greedy += cost_of(merge_greedily(colors, fitter, Endpoints::rgb565, 0, most_weight_bits, memory));
    }
  EXPECT_LT(static_cast<double>(found), 1.05 * static_cast<double>(best));
  EXPECT_LT(found, greedy);
}

TEST(Blocks, NoiseCostsHardlyMoreThanPlainColors) {
  for (const size_t size : {size_t{20000}, size_t{100000}}) {
    const auto noise = color_cases(size, 2)[1].colors;
    const EncodedPart part = encode_part(noise, {0.5, 0, 1});
    EXPECT_LE(static_cast<double>(part.bytes.size()), 3.03 * static_cast<double>(size));
    EXPECT_EQ(part.squared_error, 0u);
  }
}

TEST(Blocks, MacroBlocksEndWhereTheyMust) {
  for (const size_t size : {size_t{3}, size_t{16383}, size_t{16384}, size_t{16387}, size_t{32768}}) {
    std::vector<Rgb> colors(size, Rgb{17, 99, 200});
    const BlockOptions options;
    const EncodedPart part = encode_part(colors, options);
    const size_t macro_blocks = (size + 16383) / 16384;
    EXPECT_EQ(part.blocks, macro_blocks);
    EXPECT_EQ(part.bytes.size(), 8 + 16 * macro_blocks + 8 * macro_blocks + 8);
    const PartView view = view_of(part, size, options);
    EXPECT_EQ(view.color(0), colors[0]);
    EXPECT_EQ(view.color(static_cast<uint32_t>(size - 1)), colors[0]);
    EXPECT_EQ(view.color(static_cast<uint32_t>(size)), Rgb{});
  }
}

TEST(Blocks, AnySingleColorIsExact) {
  for (uint32_t v = 0; v < 256; ++v) {
    const Rgb c{static_cast<uint8_t>(v), static_cast<uint8_t>(255 - v), static_cast<uint8_t>(v ^ 0x5a)};
    EXPECT_EQ(from_single(to_single(c)), c);
  }
}

TEST(Blocks, WorstRoundingTo565) {
  // Of each channel's 256 values, the furthest from those of 5 and of 6 bits.
  const auto worst = [](int bits) {
    int furthest = 0;
    for (int v = 0; v < 256; ++v) {
      int nearest = 255;
      for (uint32_t q = 0; q < 1u << bits; ++q)
        nearest = std::min(nearest, std::abs(v - (bits == 5 ? from_5_bits(q) : from_6_bits(q))));
      furthest = std::max(furthest, nearest);
    }
    return furthest;
  };
  EXPECT_LT(std::sqrt(2 * worst(5) * worst(5) + worst(6) * worst(6)), 6.13);
  EXPECT_EQ(endpoints_for(6.13), Endpoints::rgb565);
  EXPECT_EQ(endpoints_for(6.12), Endpoints::rgb888);
}

/// The plain way: every colour against all steps of the line that it may be.
Distances plain_distances(const std::vector<Rgb>& colors, Rgb a, Rgb b, uint32_t most,
                          const uint8_t* weights) {
  Distances d{0, 0};
  for (size_t i = 0; i < colors.size(); ++i) {
    const uint32_t own = squared_distance(colors[i], mix(a, b, weights[i], most));
    d.most = std::max(d.most, own);
    d.sum += own;
  }
  return d;
}

TEST(Blocks, KernelsAgreeWithEachOtherAndWithThePlainWay) {
  std::mt19937_64 random(3);
  const auto color = [&] {
    return Rgb{static_cast<uint8_t>(random()), static_cast<uint8_t>(random()),
               static_cast<uint8_t>(random())};
  };
  const auto floats = [](Rgb c) {
    return std::array<float, 3>{static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)};
  };
  for (int round = 0; round < 300; ++round) {
    std::vector<Rgb> colors(1 + random() % 700);
    const Rgb a = color(), b = random() % 8 == 0 ? a : color();
    for (Rgb& c : colors)
      c = random() % 3 == 0 ? color() : mix(a, b, static_cast<uint32_t>(random() % 101), 100);
    const MacroColors macro(colors);
    const ColorRun run{{macro.channel(0), macro.channel(1), macro.channel(2)}, macro.size()};
    const std::array<float, 3> axis = {0.3f, -0.8f, 0.52f};
    const Extent e1 = block_kernels(true).extent(run, axis), e2 = block_kernels(false).extent(run, axis);
    EXPECT_EQ(e1.least, e2.least);
    EXPECT_EQ(e1.most, e2.most);
    for (int bits = 1; bits <= 4; ++bits) {
      const uint32_t most = (1u << bits) - 1;
      std::vector<uint8_t> w1(colors.size() + 8), w2(colors.size() + 8);
      const auto at = [&](bool native, std::vector<uint8_t>& w) {
        return block_kernels(native).distances(run, floats(a), floats(b), static_cast<int>(most), 1 << 20,
                                               w.data());
      };
      const Distances d1 = at(true, w1), d2 = at(false, w2);
      EXPECT_EQ(w1, w2);
      EXPECT_EQ(d1.most, d2.most);
      EXPECT_EQ(d1.sum, d2.sum);
      const Distances plain = plain_distances(colors, a, b, most, w1.data());
      EXPECT_EQ(d1.most, plain.most);
      EXPECT_EQ(d1.sum, plain.sum);
      // No other step is much nearer: they are chosen along the line, before rounding.
      for (size_t i = 0; i < colors.size(); ++i) {
        double nearest = 1e9;
        for (uint32_t w = 0; w <= most; ++w)
          nearest = std::min(nearest,
                             std::sqrt(static_cast<double>(squared_distance(colors[i], mix(a, b, w, most)))));
        EXPECT_LE(std::sqrt(static_cast<double>(squared_distance(colors[i], mix(a, b, w1[i], most)))),
                  nearest + 1.75);
      }
    }
  }
}

TEST(Blocks, LinesAreTheFirstTryThatIsWithinTheThreshold) {
  std::mt19937_64 random(5);
  const auto byte = [&] { return static_cast<uint8_t>(random()); };
  const auto floats = [](Rgb c) {
    return std::array<float, 3>{static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)};
  };
  int feasible = 0, later = 0;
  for (int round = 0; round < 4000; ++round) {
    // Along a line, with noise; often of few steps.
    const Rgb a{byte(), byte(), byte()}, b = round % 16 == 0 ? a : Rgb{byte(), byte(), byte()};
    const auto steps = static_cast<uint32_t>(1 + random() % (round % 2 == 0 ? 4 : 60));
    std::vector<Rgb> colors(1 + random() % (round % 4 == 0 ? 400 : 20));
    for (Rgb& c : colors) {
      c = mix(a, b, static_cast<uint32_t>(random() % (steps + 1)), steps);
      const auto shake = [&](uint8_t v) {
        return static_cast<uint8_t>(std::clamp<int>(v + static_cast<int>(random() % 9) - 4, 0, 255));
      };
      c = {shake(c.r), shake(c.g), shake(c.b)};
    }
    const MacroColors macro(colors);
    const ColorRun run{{macro.channel(0), macro.channel(1), macro.channel(2)}, macro.size()};
    const BlockKernels &native = block_kernels(true), &plain = block_kernels(false);
    const auto allowed = static_cast<uint32_t>(random() % 200);
    const Distances single = plain.distances(run, floats(a), floats(a), 1, ~uint32_t{0} >> 8, nullptr);
    EXPECT_EQ(native.within(run, floats(a), allowed), single.most <= allowed);
    EXPECT_EQ(plain.within(run, floats(a), allowed), single.most <= allowed);

    LineTries line{{0, 0, 0}, {0, 0, 0}, 0, round % 3 == 0 ? Endpoints::rgb888 : Endpoints::rgb565, 0};
    line.tries = 1 + static_cast<int>(random() % 11);
    float length = 0;
    for (size_t c = 0; c < 3; ++c) {
      line.mean[c] = (floats(a)[c] + floats(b)[c]) / 2;
      line.axis[c] = floats(b)[c] - floats(a)[c];
      length += line.axis[c] * line.axis[c];
    }
    for (size_t c = 0; c < 3; ++c) {
      line.axis[c] /= std::max(std::sqrt(length), 1.0f);
      line.center += line.mean[c] * line.axis[c];
    }
    const int bits = 1 + round % 4, most = (1 << bits) - 1;
    const Extent extent = plain.extent(run, line.axis);
    const float lo = extent.least - line.center, hi = extent.most - line.center,
                half_cell = (hi - lo) / static_cast<float>(2 * (most + 1));
    LineFit expected;
    for (int i = 0; i < line.tries && !expected.feasible; ++i) {
      const auto end = [&](float t) {
        const auto stored = [&](size_t c, float top) {
          const float v = line.mean[c] + t * line.axis[c];
          return static_cast<uint32_t>(std::clamp(v, 0.0f, 255.0f) * (top / 255.0f) + 0.5f);
        };
        return line.endpoints == Endpoints::rgb888
                   ? Rgb{static_cast<uint8_t>(stored(0, 255)), static_cast<uint8_t>(stored(1, 255)),
                         static_cast<uint8_t>(stored(2, 255))}
                   : Rgb{from_5_bits(stored(0, 31)), from_6_bits(stored(1, 63)), from_5_bits(stored(2, 31))};
      };
      const float* const inset = line_insets + 8 * (i / 4) + i % 4;
      expected.a = end(lo + inset[0] * half_cell);
      expected.b = end(hi + inset[4] * half_cell);
      const Distances d =
          plain.distances(run, floats(expected.a), floats(expected.b), most, ~uint32_t{0} >> 8, nullptr);
      expected.feasible = d.most <= allowed;
      expected.squared_error = d.sum;
      later += expected.feasible && i > 0;
    }
    feasible += expected.feasible;
    for (const LineFit& fit : {native.line(run, line, most, allowed), plain.line(run, line, most, allowed)}) {
      ASSERT_EQ(fit.feasible, expected.feasible) << "round " << round;
      if (!fit.feasible) continue;
      EXPECT_EQ(fit.a, expected.a);
      EXPECT_EQ(fit.b, expected.b);
      EXPECT_EQ(fit.squared_error, expected.squared_error);
    }
  }
  EXPECT_GT(feasible, 500);
  EXPECT_GT(later, 50);
}

TEST(Blocks, DamagedPartsAreReadWithoutHarm) {
  std::mt19937_64 random(4);
  for (const double threshold : {2.0, 9.56}) {
    const BlockOptions options{threshold, 0, 1};
    auto colors = color_cases(40000, 5)[5].colors;
    const auto noise = color_cases(16384, 6)[1].colors;
    std::copy(noise.begin(), noise.end(), colors.begin() + 16384);
    const EncodedPart part = encode_part(colors, options);
    for (int round = 0; round < 400; ++round) {
      std::vector<std::byte> bytes = part.bytes;
      if (round % 2 == 0) bytes.resize(random() % bytes.size());
      if (!bytes.empty())
        for (int i = 0; i < 4; ++i)
          bytes[random() % (round % 3 == 0 ? bytes.size() : std::min<size_t>(bytes.size(), 80))] =
              static_cast<std::byte>(random());
      // Alone on the heap, where a sanitizer sees any read past the end; and with other bytes behind it, on
      // which no answer may depend.
      std::vector<std::byte> followed = bytes;
      followed.resize(bytes.size() + 64, std::byte{0xa5});
      bytes.shrink_to_fit();
      const auto count = static_cast<uint32_t>(colors.size());
      const PartView view(bytes.data(), bytes.size(), count, endpoints_for(threshold)),
          other(followed.data(), bytes.size(), count, endpoints_for(threshold));
      ASSERT_EQ(view.valid(), other.valid());
      for (uint32_t i = 0; i < count + 100; i += 37) {
        ASSERT_EQ(view.color(i), other.color(i))
            << "threshold " << threshold << ", round " << round << ", " << i;
        if (!view.valid() || i >= count) {
          ASSERT_EQ(view.color(i), Rgb{}) << "threshold " << threshold << ", round " << round << ", " << i;
        }
      }
    }
  }
}

}  // namespace
}  // namespace voxkit::color
