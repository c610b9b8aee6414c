// Colours as images: their size, what comes back, and how decoded parts are kept.
#include "libcolor/textures/image_codec.h"

#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "formats/module.h"
#include "libcolor/textures/decoded_parts.h"
#include "libcolor/textures/part_image.h"
#include "tests/damage.h"
#include "tests/libcolor/color_runs.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

constexpr ImageCurve curves[] = {ImageCurve::morton, ImageCurve::hilbert};

TEST(PartImage, IsAsLargeAsItsColors) {
  for (const ImageCurve curve : curves) {
    ImageSize least;
    uint32_t done = 0;
    for (const uint32_t colors :
         {1u, 2u, 3u, 4u, 5u, 16u, 17u, 100u, 4096u, 70001u, 524289u, part_colors - 1, part_colors}) {
      for (; done < colors; ++done) {
        const Pixel at = curve_pixel(curve, done);
        least = {std::max(least.width, at.x + 1), std::max(least.height, at.y + 1)};
      }
      EXPECT_EQ(part_image_size(curve, colors), least) << colors;
    }
    EXPECT_EQ(least, (ImageSize{image_side, image_side}));
  }
}

TEST(PartImage, HasEveryColorInItsPlace) {
  for (const ImageCurve curve : curves)
    for (const size_t size : {size_t{1}, size_t{6}, size_t{1000}, size_t{70001}}) {
      const auto colors = color_cases(size, 6)[1].colors;
      const RgbImage image = part_image(colors, curve);
      EXPECT_EQ(part_colors_of(image, curve, static_cast<uint32_t>(size)), colors);
      const Pixel last = curve_pixel(curve, static_cast<uint32_t>(size) - 1);
      EXPECT_EQ(image.rgb[3 * (size_t{last.y} * image.size.width + last.x)], std::byte{colors.back().r});
    }
}

class Images : public testing::TestWithParam<ColorCodec> {};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Images);

TEST_P(Images, WhatIsReadIsWhatEncodingSaid) {
  for (const ImageCurve curve : curves)
    for (const size_t size : {size_t{1}, size_t{2}, size_t{17}, size_t{3000}})
      for (const ColorCase& c : color_cases(size, 4))
        for (const int quality : {100, 70, 0}) {
          SCOPED_TRACE(testing::Message() << c.name << ", " << size << ", quality " << quality);
          Options options;
          options.codec = GetParam();
          options.image_curve = curve;
          options.quality = quality;
          if (!validate(options)) continue;  // png without libimagequant
          const auto part = encode_as_image(c.colors, options);
          ASSERT_TRUE(part) << part.error().what;
          const auto read = decode_as_image(part->bytes, options.codec, curve, static_cast<uint32_t>(size));
          ASSERT_TRUE(read) << read.error().what;
          EncodedPart seen;
          for (size_t i = 0; i < size; ++i) seen.add_error(c.colors[i], (*read)[i]);
          EXPECT_EQ(seen.squared_error, part->squared_error);
          EXPECT_EQ(seen.most_squared, part->most_squared);
          if (quality == 100 && GetParam() != ColorCodec::jpeg) {
            EXPECT_EQ(seen.squared_error, 0u);
          }
          if (quality == 70 && size > 1000 && c.name == "gradient") {
            EXPECT_LT(std::sqrt(static_cast<double>(seen.squared_error) / (3 * static_cast<double>(size))),
                      9);
          }
          // As a part of more colours it is refused.
          const auto other =
              decode_as_image(part->bytes, options.codec, curve, static_cast<uint32_t>(4 * size + 13));
          ASSERT_FALSE(other);
          EXPECT_EQ(other.error().code, ErrorCode::input);
        }
}

/// A byte of a part is changed, and its checksum made right: decoding says where.
TEST_P(Images, ErrorsNameTheChunk) {
  Options options;
  options.codec = GetParam();
  ListSource source(sphere_shell(4), Index3(16));
  auto bytes = std::make_shared<std::vector<std::byte>>(compressed(source, options));
  const auto good = Container::open(*bytes, "file", bytes);
  ASSERT_TRUE(good);
  for (const ChunkEntry& entry : (*good)->table())
    if (entry.kind == chunk_kind("COLR")) (*bytes)[entry.offset + 1] ^= std::byte{0xff};
  voxkit::test::reseal(*bytes);
  const auto volume = Volume::open(*Container::open(*bytes, "file", bytes));
  ASSERT_TRUE(volume);
  const auto color = (*volume)->color(0);
  ASSERT_FALSE(color);
  EXPECT_EQ(color.error().code, ErrorCode::input);
  EXPECT_EQ(color.error().file, "file");
  EXPECT_EQ(color.error().what.rfind("chunk COLR 0.0: ", 0), 0u) << color.error().what;
}

INSTANTIATE_TEST_SUITE_P(Codecs, Images, testing::ValuesIn(image_codecs()));

/// Part i has two colours, of i.
Result<std::vector<Rgb>> two_of(uint64_t part) {
  return std::vector<Rgb>(2, Rgb{static_cast<uint8_t>(part), 0, 0});
}

TEST(DecodedParts, AreDecodedOnceAndKept) {
  MemoryBudget memory(uint64_t{1} << 30);
  std::atomic<int> calls = 0;
  {
    DecodedParts parts(8, memory, 0, [&](uint64_t part) {
      ++calls;
      return two_of(part);
    });
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
      threads.emplace_back([&] {
        for (uint64_t i = 0; i < 800; ++i) {
          const auto part = parts.get(i % 8);
          ASSERT_TRUE(part);
          ASSERT_EQ((*part)->data()[1].r, i % 8);
        }
      });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(calls, 8);
  }
  EXPECT_TRUE(memory.reserve(memory.limit(), "all of it"));
}

TEST(DecodedParts, ThoseUsedLongestAgoGoFirst) {
  // Room for two in a quarter of the memory.
  MemoryBudget memory(uint64_t{24} << 20);
  std::vector<uint64_t> calls;
  DecodedParts parts(4, memory, 1 << 20, [&](uint64_t part) {
    calls.push_back(part);
    return two_of(part);
  });
  const auto held = parts.get(0);
  for (const uint64_t part : {1, 0, 2, 0, 1, 2}) ASSERT_TRUE(parts.get(part));
  EXPECT_EQ(calls, (std::vector<uint64_t>{0, 1, 2, 1, 2}));
  EXPECT_EQ((*held)->data()[0].r, 0);
}

/// More threads than there is room for parts.
TEST(DecodedParts, ThreadsShareLittleRoom) {
  MemoryBudget memory(uint64_t{40} << 20);
  DecodedParts parts(64, memory, 1 << 20, two_of);
  std::vector<std::thread> threads;
  std::atomic<int> wrong = 0;
  for (uint64_t t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      std::mt19937_64 random(t);
      for (int i = 0; i < 2000; ++i) {
        const uint64_t number = random() % 64;
        const auto part = parts.get(number);
        wrong += !part || (*part)->data()[0].r != number;
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

TEST(DecodedParts, WithoutRoomThatIsSaid) {
  MemoryBudget memory(uint64_t{5} << 20);
  DecodedParts parts(3, memory, 1 << 20, two_of);
  {
    const auto held = parts.get(0);
    ASSERT_TRUE(held);
    // It is in use: forgetting it gives nothing back.
    const auto other = parts.get(1);
    ASSERT_FALSE(other);
    EXPECT_EQ(other.error().code, ErrorCode::limit);
  }
  EXPECT_TRUE(parts.get(2));
  EXPECT_TRUE(parts.get(0));
}

TEST(DecodedParts, AnErrorIsKept) {
  MemoryBudget memory;
  int calls = 0;
  DecodedParts parts(1, memory, 0, [&](uint64_t) -> Result<std::vector<Rgb>> {
    ++calls;
    return bad_input("file", "broken");
  });
  for (int i = 0; i < 3; ++i) {
    const auto part = parts.get(0);
    ASSERT_FALSE(part);
    EXPECT_EQ(part.error().what, "broken");
  }
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace voxkit::color
