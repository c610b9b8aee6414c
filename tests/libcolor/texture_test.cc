// Colours as textures: curves, blocks of 16, and what encoding says about them.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "formats/little_endian.h"
#include "libcolor/textures/astc.h"
#include "libcolor/textures/bc1.h"
#include "libcolor/textures/bc7.h"
#include "libcolor/textures/bc7_modes.h"
#include "libcolor/textures/texture.h"
#include "tests/libcolor/color_runs.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

constexpr ImageCurve curves[] = {ImageCurve::morton, ImageCurve::hilbert};

Params params_of(const Options& options) {
  Params params;
  params.codec = options.codec;
  params.image_curve = options.image_curve;
  params.block_size = block_size_of(options);
  return params;
}

TEST(ImageCurve, ComesToEveryPixelOnce) {
  for (const ImageCurve curve : curves) {
    std::vector<bool> seen(part_colors);
    for (uint32_t i = 0; i < part_colors; ++i) {
      const Pixel at = curve_pixel(curve, i);
      ASSERT_LT(at.x, image_side);
      ASSERT_LT(at.y, image_side);
      ASSERT_FALSE(seen[at.y * image_side + at.x]);
      seen[at.y * image_side + at.x] = true;
    }
  }
}

TEST(ImageCurve, SixteenInARowAreASquare) {
  for (const ImageCurve curve : curves)
    for (uint32_t i = 0; i < part_colors; i += 16) {
      const Pixel first = curve_pixel(curve, i);
      for (uint32_t j = 1; j < 16; ++j) {
        const Pixel at = curve_pixel(curve, i + j);
        ASSERT_EQ(at.x / 4, first.x / 4);
        ASSERT_EQ(at.y / 4, first.y / 4);
      }
    }
}

TEST(ImageCurve, OfHilbertGoesFromNeighbourToNeighbour) {
  Pixel last = curve_pixel(ImageCurve::hilbert, 0);
  EXPECT_EQ(last, Pixel{});
  for (uint32_t i = 1; i < part_colors; ++i) {
    const Pixel at = curve_pixel(ImageCurve::hilbert, i);
    const int dx = static_cast<int>(at.x) - static_cast<int>(last.x),
              dy = static_cast<int>(at.y) - static_cast<int>(last.y);
    ASSERT_EQ(dx * dx + dy * dy, 1) << i;
    last = at;
  }
}

Pixels16 decoded(const std::array<std::byte, bc1_block_bytes>& block) {
  Pixels16 pixels;
  decode_bc1(block.data(), pixels);
  return pixels;
}
std::array<std::byte, bc1_block_bytes> bc1_of(uint16_t c0, uint16_t c1, uint32_t indices) {
  std::array<std::byte, bc1_block_bytes> block{};
  store_le(block.data(), c0);
  store_le(block.data() + 2, c1);
  store_le(block.data() + 4, indices);
  return block;
}

/// Computed by hand.
TEST(Bc1, BlocksAreRead) {
  const auto four = decoded(bc1_of(0xf800, 0x001f, 0b11100100));
  EXPECT_EQ(four[0], (Rgb{255, 0, 0}));
  EXPECT_EQ(four[1], (Rgb{0, 0, 255}));
  EXPECT_EQ(four[2], (Rgb{170, 0, 85}));
  EXPECT_EQ(four[3], (Rgb{85, 0, 170}));
  EXPECT_EQ(four[15], (Rgb{255, 0, 0}));
  const auto three = decoded(bc1_of(0x001f, 0xf800, 0b11100100));
  EXPECT_EQ(three[0], (Rgb{0, 0, 255}));
  EXPECT_EQ(three[1], (Rgb{255, 0, 0}));
  EXPECT_EQ(three[2], (Rgb{127, 0, 127}));
  EXPECT_EQ(three[3], Rgb{});
}

uint64_t error_of(const Pixels16& pixels, const Pixels16& others) {
  EncodedPart part;
  for (size_t i = 0; i < 16; ++i) part.add_error(pixels[i], others[i]);
  return part.squared_error;
}

uint64_t bc1_error(const Pixels16& pixels, int effort) {
  std::array<std::byte, bc1_block_bytes> block;
  encode_bc1(pixels, effort, block.data());
  return error_of(pixels, decoded(block));
}

/// What can be said exactly comes back so.
TEST(Bc1, ColorsThatABlockHasAreKept) {
  std::mt19937 random(5);
  for (int round = 0; round < 300; ++round) {
    const auto a = static_cast<uint16_t>(random()), b = static_cast<uint16_t>(random());
    // Of both ends only.
    const Pixels16 pixels = decoded(bc1_of(a, b, static_cast<uint32_t>(random()) & 0x55555555));
    EXPECT_EQ(bc1_error(pixels, 3), 0u) << a << ' ' << b;
  }
}

/// One colour is off by no more than its nearest third between two of 5 or 6 bits.
TEST(Bc1, PlainBlocksAreNear) {
  for (int v = 0; v < 256; ++v) {
    const auto x = static_cast<uint8_t>(v);
    Pixels16 pixels;
    pixels.fill({x, static_cast<uint8_t>(255 - v), static_cast<uint8_t>(v * 7)});
    EXPECT_LE(bc1_error(pixels, 1), 16u * 3) << v;
  }
}

/// The best of all pairs of ends in a grid, by trying: of greys, so that there are few.
TEST(Bc1, IsCloseToTheBest) {
  std::mt19937 random(6);
  uint64_t found = 0, best = 0, quick = 0;
  for (int round = 0; round < 60; ++round) {
    Pixels16 pixels;
    const int base = static_cast<int>(random() % 200);
    for (Rgb& p : pixels) {
      const auto v = static_cast<uint8_t>(base + static_cast<int>(random() % 56));
      p = {v, v, v};
    }
    uint64_t least = ~uint64_t{0};
    for (uint32_t a = 0; a < 32; ++a)
      for (uint32_t b = 0; b < 32; ++b) {
        const auto c0 = static_cast<uint16_t>(a << 11 | 2 * a << 5 | a),
                   c1 = static_cast<uint16_t>(b << 11 | 2 * b << 5 | b);
        const Pixels16 palette = decoded(bc1_of(c0, c1, 0b11100100));
        uint64_t sum = 0;
        for (const Rgb& p : pixels) {
          uint64_t nearest = ~uint64_t{0};
          for (size_t i = 0; i < 4; ++i) {
            EncodedPart one;
            one.add_error(p, palette[i]);
            nearest = std::min(nearest, one.squared_error);
          }
          sum += nearest;
        }
        least = std::min(least, sum);
      }
    best += least;
    found += bc1_error(pixels, 5);
    quick += bc1_error(pixels, 1);
  }
  EXPECT_LE(found, quick);
  EXPECT_LT(static_cast<double>(found), 1.02 * static_cast<double>(best));
}

uint64_t bc7_error(const Pixels16& pixels, int effort) {
  std::array<std::byte, bc7_block_bytes> block;
  encode_bc7(pixels, effort, block.data());
  EXPECT_TRUE(valid_bc7(block.data()));
  Pixels16 read;
  decode_bc7(block.data(), read);
  return error_of(pixels, read);
}

/// Computed by hand: mode 6, whose ends are black and white with lowest bits 0 and 1, indices 0 to 15.
TEST(Bc7, BlocksAreRead) {
  std::array<std::byte, bc7_block_bytes> block{};
  uint64_t low = 0x40, high = 0;
  // Red, green, blue and alpha of both ends, 7 bits each, from bit 7 on: every second one has all bits.
  for (int k = 0; k < 4; ++k) low |= uint64_t{127} << (7 + 14 * k + 7);
  high |= 1;  // lowest bits: 0 of the first, at bit 63, and 1 of the second
  for (uint64_t i = 1; i < 16; ++i) high |= i << 4 * i;
  store_le(block.data(), low);
  store_le(block.data() + 8, high);
  Pixels16 pixels;
  decode_bc7(block.data(), pixels);
  constexpr std::array<int, 16> weights = {0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64};
  for (size_t i = 0; i < 16; ++i) {
    const auto v = static_cast<uint8_t>((255 * weights[i] + 32) / 64);
    EXPECT_EQ(pixels[i], (Rgb{v, v, v})) << i;
  }
  block.fill({});
  EXPECT_FALSE(valid_bc7(block.data()));
  decode_bc7(block.data(), pixels);
  for (const Rgb c : pixels) EXPECT_EQ(c, Rgb{});
}

/// The modes fill 128 bits; each anchor is of its subset, as the highest bit of its index is not stored.
TEST(Bc7, TablesAgreeWithEachOther) {
  for (size_t m = 0; m < bc7::modes.size(); ++m) {
    const bc7::Mode& mode = bc7::modes[m];
    const int ends = 2 * mode.subsets;
    EXPECT_EQ(static_cast<int>(m) + 1 + mode.partition_bits + mode.rotation_bits + mode.selection_bits +
                  ends * (3 * mode.color_bits + mode.alpha_bits + mode.end_p) + mode.subsets * mode.shared_p +
                  16 * (mode.index_bits + mode.second_bits) - mode.subsets - (mode.second_bits != 0 ? 1 : 0),
              128)
        << m;
  }
  for (const int subsets : {2, 3})
    for (uint32_t partition = 0; partition < 64; ++partition)
      for (uint32_t s = 0; s < static_cast<uint32_t>(subsets); ++s)
        EXPECT_EQ(bc7::subset_of(subsets, partition, bc7::anchor_of(subsets, partition, s)), s)
            << subsets << ' ' << partition;
}

/// Two and three surfaces in a block, along any partition: each keeps its colour.
TEST(Bc7, SurfacesInABlockKeepTheirColors) {
  const std::array<Rgb, 3> surfaces = {Rgb{200, 20, 30}, Rgb{10, 90, 220}, Rgb{30, 200, 60}};
  for (const int subsets : {2, 3})
    for (uint32_t partition = 0; partition < 64; ++partition) {
      Pixels16 pixels;
      for (uint32_t i = 0; i < 16; ++i) pixels[i] = surfaces[bc7::subset_of(subsets, partition, i)];
      // Of three surfaces, ends of 5 bits are off by up to 4.
      EXPECT_LE(bc7_error(pixels, 9), subsets == 2 ? 16u * 3 : 16u * 27) << subsets << ' ' << partition;
      EXPECT_LT(bc7_error(pixels, 9), bc1_error(pixels, 9) / (subsets == 2 ? 1 : 4) + 49);
    }
}

TEST(Bc7, PlainBlocksAndGradientsAreNear) {
  for (int v = 0; v < 256; ++v) {
    const auto x = static_cast<uint8_t>(v), y = static_cast<uint8_t>(v * 11);
    Pixels16 pixels;
    pixels.fill({x, y, static_cast<uint8_t>(255 - v)});
    EXPECT_LE(bc7_error(pixels, 3), 16u * 3) << v;
    for (size_t i = 0; i < 16; ++i) pixels[i] = {static_cast<uint8_t>(v / 2 + 2 * static_cast<int>(i)), x, y};
    EXPECT_LE(bc7_error(pixels, 3), 16u * 3) << v;
  }
}

/// Every colour has a block, each block has a colour or stands beside one, and no two colours share a place.
TEST(TextureLayout, HasAPlaceForEveryColor) {
  for (const ImageCurve curve : curves)
    for (const BlockSize size : astc_block_sizes())
      for (const uint32_t colors : {1u, 2u, 16u, 17u, 1000u, 70001u, part_colors - 1, part_colors}) {
        const TextureLayout layout(curve, size, colors);
        const uint32_t area = size.width * size.height;
        std::vector<bool> taken(size_t{layout.blocks()} * area);
        for (uint32_t i = 0; i < colors; ++i) {
          const Pixel at = curve_pixel(curve, i);
          const uint32_t block = layout.block_of(i, at), within = layout.within(at);
          ASSERT_LT(block, layout.blocks());
          ASSERT_LT(within, area);
          const Pixel corner = layout.corner(block);
          ASSERT_EQ(at, (Pixel{corner.x + within % size.width, corner.y + within / size.width}));
          ASSERT_FALSE(taken[size_t{block} * area + within]);
          taken[size_t{block} * area + within] = true;
        }
        // Little is wasted, but at the edges of few colours.
        if (colors > 70000) {
          EXPECT_LT(layout.blocks() * area, 1.2 * colors);
        }
      }
}

TEST(Astc, QualityIsASizeOfBlocks) {
  EXPECT_EQ(astc_block_size(100), (BlockSize{4, 4}));
  EXPECT_EQ(astc_block_size(0), (BlockSize{12, 12}));
  uint32_t last = 0;
  size_t sizes = 0;
  for (int quality = 100; quality >= 0; --quality) {
    const BlockSize size = astc_block_size(quality);
    EXPECT_GE(size.width * size.height, last);
    sizes += size.width * size.height != last;
    last = size.width * size.height;
  }
  EXPECT_EQ(sizes, 14u);
}

TEST(Astc, EverySizeIsReadBackAndLargerOnesAreWorse) {
  if (!texture_support(ColorCodec::astc)) GTEST_SKIP() << "built without libastcenc";
  for (const ImageCurve curve : curves) {
    const auto colors = color_cases(30000, 8)[4].colors;
    uint64_t first = 0, last = 0;
    for (const int quality : {100, 92, 84, 77, 69, 62, 54, 46, 38, 31, 23, 15, 8, 0}) {
      Options options;
      options.codec = ColorCodec::astc;
      options.image_curve = curve;
      options.quality = quality;
      const EncodedPart part = encode_texture(colors, options);
      const Params params = params_of(options);
      TextureReader reader;
      reader.open(part.bytes.data(), params, static_cast<uint32_t>(colors.size()));
      EncodedPart seen;
      for (uint32_t i = 0; i < colors.size(); ++i) seen.add_error(colors[i], reader.color(i));
      EXPECT_EQ(seen.squared_error, part.squared_error);
      (quality == 100 ? first : last) = seen.squared_error;
    }
    EXPECT_LT(std::sqrt(static_cast<double>(first) / 90000), 1.5);
    EXPECT_GT(last, 4 * first);
  }
}

/// By hand: a block of one colour, 16 bits a channel; one that is reserved.
TEST(Astc, BlocksAreRead) {
  if (!texture_support(ColorCodec::astc)) GTEST_SKIP() << "built without libastcenc";
  std::array<std::byte, astc_block_bytes> block{};
  store_le(block.data(), uint64_t{0xfffffffffffffdfc});
  store_le(block.data() + 8, uint64_t{0xffff'1234'8000'ff00});
  std::array<Rgb, 30> pixels;
  decode_astc({6, 5}, block.data(), pixels.data());
  EXPECT_TRUE(valid_astc({6, 5}, block.data()));
  for (const Rgb c : pixels) EXPECT_EQ(c, (Rgb{0xff, 0x80, 0x12}));
  block.fill({});
  EXPECT_FALSE(valid_astc({6, 5}, block.data()));
  decode_astc({6, 5}, block.data(), pixels.data());
  for (const Rgb c : pixels) EXPECT_EQ(c, (Rgb{0xff, 0, 0xff}));
}

class Textures : public testing::TestWithParam<ColorCodec> {};

TEST_P(Textures, WhatIsReadIsWhatEncodingSaid) {
  for (const ImageCurve curve : curves)
    for (const size_t size : {size_t{1}, size_t{15}, size_t{16}, size_t{17}, size_t{3000}})
      for (const ColorCase& c : color_cases(size, 4)) {
        SCOPED_TRACE(testing::Message() << c.name << ", " << size);
        Options options;
        options.codec = GetParam();
        options.image_curve = curve;
        const EncodedPart part = encode_texture(c.colors, options);
        const Params params = params_of(options);
        ASSERT_EQ(part.bytes.size(), texture_bytes(params, static_cast<uint32_t>(size)));
        TextureReader in_order, at_random;
        in_order.open(part.bytes.data(), params, static_cast<uint32_t>(size));
        at_random.open(part.bytes.data(), params, static_cast<uint32_t>(size));
        EXPECT_EQ(in_order.blocks(), part.blocks);
        EXPECT_EQ(in_order.first_invalid(), part.blocks);
        EncodedPart seen;
        std::vector<Rgb> colors;
        for (uint32_t i = 0; i < size; ++i) {
          colors.push_back(in_order.color(i));
          seen.add_error(c.colors[i], colors.back());
        }
        EXPECT_EQ(seen.squared_error, part.squared_error);
        EXPECT_EQ(seen.most_squared, part.most_squared);
        std::mt19937 random(3);
        for (int i = 0; i < 200; ++i) {
          const auto index = static_cast<uint32_t>(random() % size);
          ASSERT_EQ(at_random.color(index), colors[index]);
        }
      }
}

TEST_P(Textures, SmoothColorsStayNearAndEffortHelps) {
  const auto cases = color_cases(4096, 9);
  for (const ColorCase& c : cases) {
    Options options;
    options.codec = GetParam();
    options.effort = 1;
    const uint64_t quick = encode_texture(c.colors, options).squared_error;
    options.effort = 6;
    const uint64_t slow = encode_texture(c.colors, options).squared_error;
    EXPECT_LE(slow, quick) << c.name;
    if (c.name == "gradient") {
      EXPECT_LT(std::sqrt(static_cast<double>(slow) / (3 * 4096)), 1.6);
    }
    if (c.name == "black") {
      EXPECT_EQ(slow, 0u);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Codecs, Textures, testing::ValuesIn(texture_codecs()));

}  // namespace
}  // namespace voxkit::color
