// Palettes: the quantisation against searches without shortcuts, the cut into blocks against all cuts, and
// whole parts.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "libcolor/palette/palette.h"
#include "libcolor/palette/palette_check.h"
#include "libcolor/palette/palette_encode.h"
#include "libcolor/palette/palette_layout.h"
#include "libcolor/palette/palette_plan.h"
#include "libcolor/palette/palette_split.h"
#include "tests/libcolor/color_runs.h"

namespace voxkit::color {
namespace {

/// A palette, and memory for it.
Palette palette_of(std::span<const Rgb> colors, uint32_t most, int effort = 3, int threads = 2) {
  static MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  ctx.threads = threads;
  auto made = Palette::choose(colors, most, effort, ctx);
  EXPECT_TRUE(made);
  return std::move(*made);
}

uint64_t squared(Rgb a, Rgb b) {
  const int r = a.r - b.r, g = a.g - b.g, c = a.b - b.b;
  return static_cast<uint64_t>(r * r + g * g + c * c);
}
uint64_t error_of(std::span<const Rgb> colors, const Palette& palette) {
  uint64_t sum = 0;
  for (const Rgb c : colors) sum += squared(c, palette.colors()[palette.index_of(c)]);
  return sum;
}

TEST(Palette, FewColorsStayAsTheyAre) {
  const std::vector<Rgb> colors = {{9, 8, 7}, {0, 0, 1}, {9, 8, 7}, {255, 255, 255}};
  const Palette palette = palette_of(colors, 3);
  EXPECT_EQ(std::vector<Rgb>(palette.colors().begin(), palette.colors().end()),
            (std::vector<Rgb>{{0, 0, 1}, {9, 8, 7}, {255, 255, 255}}));
  for (const Rgb c : colors) EXPECT_EQ(palette.colors()[palette.index_of(c)], c);
}

TEST(Palette, EveryColorGetsTheNearest) {
  for (const ColorCase& c : color_cases(3000, 1))
    for (const uint32_t most : {1u, 2u, 7u, 100u, 900u}) {
      SCOPED_TRACE(c.name + ", " + std::to_string(most));
      const Palette palette = palette_of(c.colors, most, 1);
      const auto chosen = palette.colors();
      ASSERT_LE(chosen.size(), most);
      ASSERT_GE(chosen.size(), 1u);
      for (size_t i = 1; i < chosen.size(); ++i)
        ASSERT_LT(std::tie(chosen[i - 1].r, chosen[i - 1].g, chosen[i - 1].b),
                  std::tie(chosen[i].r, chosen[i].g, chosen[i].b));
      for (size_t i = 0; i < c.colors.size(); i += 5) {
        uint64_t least = ~uint64_t{0};
        for (const Rgb p : chosen) least = std::min(least, squared(c.colors[i], p));
        ASSERT_EQ(squared(c.colors[i], chosen[palette.index_of(c.colors[i])]), least);
      }
    }
}

TEST(Palette, MoreColorsAndRoundsHaveLessError) {
  const std::vector<Rgb> colors = color_cases(20000, 2)[5].colors;
  uint64_t last = ~uint64_t{0};
  for (const uint32_t most : {1u, 4u, 16u, 64u, 256u, 1024u}) {
    const uint64_t error = error_of(colors, palette_of(colors, most));
    EXPECT_LT(error, last / 2);
    last = error;
  }
  // The mean has the least error of single colours, but for its rounding.
  const Palette one = palette_of(colors, 1);
  const uint64_t least = error_of(colors, one);
  for (const Rgb other : {Rgb{0, 0, 0}, Rgb{128, 128, 128}, colors[0]}) {
    uint64_t sum = 0;
    for (const Rgb c : colors) sum += squared(c, other);
    EXPECT_LE(least, sum);
  }
  EXPECT_LE(error_of(colors, palette_of(colors, 64, 9)), error_of(colors, palette_of(colors, 64, 1)));
}

TEST(Palette, DoesNotDependOnThreads) {
  const std::vector<Rgb> colors = color_cases(40000, 3)[1].colors;
  const Palette one = palette_of(colors, 500, 3, 1), five = palette_of(colors, 500, 3, 5);
  EXPECT_TRUE(
      std::equal(one.colors().begin(), one.colors().end(), five.colors().begin(), five.colors().end()));
}

TEST(Palette, SplittingFindsTheBestPlane) {
  std::mt19937_64 random(4);
  for (int round = 0; round < 50; ++round) {
    std::map<std::array<uint8_t, 3>, uint32_t> distinct;
    for (size_t i = 0; i < 2 + random() % 30; ++i)
      distinct[{static_cast<uint8_t>(random() % 40), static_cast<uint8_t>(random()),
                static_cast<uint8_t>(random())}] += 1 + static_cast<uint32_t>(random() % 5);
    std::vector<WeightedColor> colors;
    for (const auto& [c, weight] : distinct) colors.push_back({{c[0], c[1], c[2]}, weight});
    // In fractions without rounding: weight times the squared distances from the mean.
    const auto error = [](std::span<const WeightedColor> part) {
      ColorSums s;
      double squares = 0;
      for (const WeightedColor& c : part) {
        s.add(c);
        squares += static_cast<double>(c.weight) * static_cast<double>(squared(c.color, {}));
      }
      const auto square = [](uint64_t v) { return static_cast<double>(v) * static_cast<double>(v); };
      return squares - (square(s.r) + square(s.g) + square(s.b)) / static_cast<double>(s.weight);
    };
    double best = error(colors);
    for (int axis = 0; axis < 3; ++axis)
      for (int value = 1; value < 256; ++value) {
        std::vector<WeightedColor> low, high;
        for (const WeightedColor& c : colors) {
          const int v = axis == 0 ? c.color.r : axis == 1 ? c.color.g : c.color.b;
          (v < value ? low : high).push_back(c);
        }
        if (!low.empty() && !high.empty()) best = std::min(best, error(low) + error(high));
      }
    const std::vector<uint32_t> begins = split_colors(colors, 2);
    ASSERT_EQ(begins.size(), std::min<size_t>(colors.size(), 2));
    if (begins.size() < 2) continue;
    const auto all = std::span<const WeightedColor>(colors);
    EXPECT_NEAR(error(all.first(begins[1])) + error(all.subspan(begins[1])), best, 1e-6 * (1 + best));
  }
}

/// What a cut costs, in 1/16 bit, counted from its blocks.
uint64_t cost_of(std::span<const uint16_t> colors, const std::vector<PaletteBlock>& blocks, uint32_t bits) {
  uint64_t cost = 0;
  for (const PaletteBlock& block : blocks) {
    const std::set<uint16_t> own(colors.begin() + block.first, colors.begin() + block.last);
    cost += 16 * 56;
    if (block.width == direct_width) {
      cost += uint64_t{16} * bits * (block.last - block.first);
      continue;
    }
    EXPECT_LE(own.size(), size_t{1} << block.width);
    cost += uint64_t{16} * block.width * (block.last - block.first) +
            (own.size() > 1 ? 12 * bits * own.size() : 0);
  }
  return cost;
}

TEST(Palette, NoCutIsCheaper) {
  std::mt19937_64 random(5);
  for (int round = 0; round < 60; ++round) {
    const uint32_t bits = 4 + static_cast<uint32_t>(random() % 9),
                   different = 1 + static_cast<uint32_t>(random() % 12);
    std::vector<uint16_t> colors(1 + random() % 150);
    for (size_t i = 0; i < colors.size(); ++i)
      colors[i] = i > 0 && random() % 3 == 0
                      ? colors[i - 1]
                      : static_cast<uint16_t>((random() % different + i / 40 * 3) % (uint32_t{1} << bits));
    const auto blocks = cut_palette_blocks(colors, bits, 1 << 14);
    uint32_t next = 0;
    for (const PaletteBlock& block : blocks) {
      ASSERT_EQ(block.first, next);
      ASSERT_LT(block.first, block.last);
      next = block.last;
    }
    ASSERT_EQ(next, colors.size());
    // All cuts: the least cost of the first i colours.
    std::vector<uint64_t> least(colors.size() + 1, ~uint64_t{0});
    least[0] = 0;
    for (size_t i = 0; i < colors.size(); ++i) {
      std::set<uint16_t> own;
      for (size_t j = i; j < colors.size(); ++j) {
        own.insert(colors[j]);
        const uint64_t length = j + 1 - i, width = std::bit_width(own.size() - 1);
        const uint64_t palette = 16 * width * length + (own.size() > 1 ? 12 * bits * own.size() : 0);
        least[j + 1] = std::min(least[j + 1], least[i] + 16 * 56 + std::min(palette, 16 * bits * length));
      }
    }
    EXPECT_EQ(cost_of(colors, blocks, bits), least.back());
  }
}

TEST(Palette, BlockPalettesHaveTheirColors) {
  std::mt19937_64 random(6);
  constexpr uint32_t colors = 60;
  PaletteEntries entries(colors);
  struct Asked {
    std::set<uint16_t> colors;
    uint32_t first, width;
  };
  std::vector<Asked> all;
  size_t own = 0;
  for (int round = 0; round < 3000; ++round) {
    Asked asked{{}, 0, 0};
    const auto around = static_cast<uint32_t>(random() % colors);
    const size_t count = 2 + random() % 14;
    while (asked.colors.size() < count)
      asked.colors.insert(static_cast<uint16_t>((around + random() % 20) % colors));
    asked.width = static_cast<uint32_t>(std::bit_width(count - 1) + random() % 2);
    const std::vector<uint16_t> list(asked.colors.begin(), asked.colors.end());
    asked.first = entries.add(list, asked.width);
    own += count;
    all.push_back(asked);
  }
  for (const Asked& asked : all) {
    const auto& list = entries.entries();
    ASSERT_LT(asked.first, list.size());
    const auto last = std::min<size_t>(list.size(), asked.first + (size_t{1} << asked.width));
    const std::set<uint16_t> there(list.begin() + asked.first,
                                   list.begin() + static_cast<std::ptrdiff_t>(last));
    ASSERT_TRUE(std::includes(there.begin(), there.end(), asked.colors.begin(), asked.colors.end()));
  }
  EXPECT_LT(entries.entries().size(), own * 2 / 3);
}

TEST(Palette, APaletteThatIsThereCostsNothing) {
  PaletteEntries entries(100);
  const std::vector<uint16_t> a = {1, 2, 3, 4}, b = {10, 11, 12, 13, 14}, c = {4, 10, 11};
  const uint32_t first = entries.add(a, 2);
  entries.add(b, 3);
  EXPECT_EQ(entries.entries().size(), 9u);
  EXPECT_EQ(entries.add(a, 2), first);
  entries.add(std::vector<uint16_t>{2, 3}, 2);
  EXPECT_EQ(entries.entries().size(), 9u);
  // The end of one palette and the beginning of the next.
  PaletteEntries few(100);
  few.add(a, 2);
  few.add(std::vector<uint16_t>{1, 3, 20, 21}, 2);
  EXPECT_EQ(few.entries().size(), 6u);
}

/// A part, and its colours by a reader.
struct Part {
  EncodedPart part;
  std::vector<std::byte> global;
  PaletteView view;
  PaletteBytes bytes;
  Part(std::span<const Rgb> colors, const Palette& palette, int effort)
      : part(encode_palette_part(colors, palette, effort)) {
    const auto raw = std::as_bytes(palette.colors());
    global.assign(raw.begin(), raw.end());
    const auto count = static_cast<uint32_t>(palette.colors().size());
    bytes = {global.data(), count};
    view = PaletteView(part.bytes.data(), part.bytes.size(), static_cast<uint32_t>(colors.size()),
                       palette_bits(count));
  }
};

TEST(Palette, PartsComeBack) {
  for (const size_t size : {size_t{1}, size_t{16384}, size_t{40000}})
    for (const ColorCase& c : color_cases(size, 7))
      for (const uint32_t most : {1u, 300u, 65536u}) {
        SCOPED_TRACE(c.name + ", " + std::to_string(size) + " colors, palette of " + std::to_string(most));
        const Palette palette = palette_of(c.colors, most, 1);
        const Part made(c.colors, palette, 3);
        ASSERT_TRUE(made.view.valid());
        const auto count = static_cast<uint32_t>(palette.colors().size());
        EXPECT_EQ(check_palette_part(made.view, count), "");
        PaletteReader reader;
        reader.open(made.view, made.bytes);
        uint64_t error = 0;
        for (uint32_t i = 0; i < size; ++i) {
          const Rgb expected = palette.colors()[palette.index_of(c.colors[i])];
          ASSERT_EQ(reader.color(i), expected) << i;
          error += squared(c.colors[i], expected);
        }
        EXPECT_EQ(made.part.squared_error, error);
        for (uint32_t i = static_cast<uint32_t>(size); i > 0; i -= std::min(i, 997u))
          ASSERT_EQ(reader.color(i - 1), palette.colors()[palette.index_of(c.colors[i - 1])]);
        // Never more than one direct block a macro block.
        const size_t macro_blocks = (size + macro_block_colors - 1) / macro_block_colors;
        EXPECT_LE(made.part.bytes.size(), 16 + 15 * macro_blocks + (size * palette_bits(count) + 7) / 8);
        if (most == 1 || c.name == "black") {
          EXPECT_EQ(made.part.blocks, macro_blocks);
        }
      }
}

TEST(Palette, DamagedPartsAreReadWithoutHarm) {
  std::mt19937_64 random(9);
  const std::vector<Rgb> colors = color_cases(20000, 9)[5].colors;
  const Palette palette = palette_of(colors, 200);
  const Part made(colors, palette, 2);
  const std::vector<std::byte>& bytes = made.part.bytes;
  int valid = 0, sound = 0;
  for (int round = 0; round < 1500; ++round) {
    // Exactly the bytes that are there, on the heap.
    std::vector<std::byte> copy(
        bytes.begin(),
        round % 3 == 0 ? bytes.begin() + static_cast<std::ptrdiff_t>(random() % bytes.size()) : bytes.end());
    copy.shrink_to_fit();
    if (round % 3 != 0)
      for (int i = 0; i < 1 + round % 4; ++i)
        copy[random() % (round % 2 == 0 ? std::min<size_t>(copy.size(), 2000) : copy.size())] =
            static_cast<std::byte>(random());
    const PaletteView view(copy.data(), copy.size(), static_cast<uint32_t>(colors.size()), 8);
    valid += view.valid() ? 1 : 0;
    const bool checked = check_palette_part(view, made.bytes.colors).empty();
    sound += checked ? 1 : 0;
    PaletteReader reader;
    reader.open(view, made.bytes);
    for (uint32_t i = 0; i < colors.size(); i += 1 + static_cast<uint32_t>(random() % 200)) {
      const Rgb color = reader.color(i);
      // What has been checked has only colours of the palette.
      if (checked) {
        ASSERT_NE(std::find(palette.colors().begin(), palette.colors().end(), color), palette.colors().end());
      }
    }
  }
  EXPECT_GT(valid, 500);
  EXPECT_GT(valid - sound, 100);
  EXPECT_GT(sound, 100);
}

TEST(Palette, MoreEffortIsSmaller) {
  const std::vector<Rgb> colors = color_cases(100000, 8)[4].colors;
  const Palette palette = palette_of(colors, 256);
  EXPECT_LT(encode_palette_part(colors, palette, 6).bytes.size(),
            encode_palette_part(colors, palette, 1).bytes.size());
}

TEST(Palette, MemoryIsCounted) {
  MemoryBudget memory(1 << 20);
  Context ctx;
  ctx.memory = &memory;
  const std::vector<Rgb> colors(10);
  const auto palette = Palette::choose(colors, 4, 3, ctx);
  ASSERT_FALSE(palette);
  EXPECT_EQ(palette.error().code, ErrorCode::limit);
}

}  // namespace
}  // namespace voxkit::color
