// Images as files in memory: what comes back, and files of other kinds.
#include "formats/image/coded_image.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <cmath>
#include <random>
#include <set>

#include "formats/module.h"

namespace voxkit {
namespace {

RgbImage picture(ImageSize size, uint32_t seed = 1) {
  std::mt19937 random(seed);
  RgbImage image = make_rgb_image(size);
  for (uint32_t y = 0; y < size.height; ++y)
    for (uint32_t x = 0; x < size.width; ++x)
      for (uint32_t k = 0; k < 3; ++k)
        image.rgb[size_t{3} * (y * size.width + x) + k] = static_cast<std::byte>((k == 0   ? 2 * x
                                                                                  : k == 1 ? 3 * y
                                                                                           : x + y) %
                                                                                     256 / 2 +
                                                                                 random() % 20);
  return image;
}
double error(const RgbImage& a, const RgbImage& b) {
  double sum = 0;
  for (size_t i = 0; i < a.rgb.size(); ++i) {
    const double d = std::to_integer<int>(a.rgb[i]) - std::to_integer<int>(b.rgb[i]);
    sum += d * d;
  }
  return std::sqrt(sum / static_cast<double>(a.rgb.size()));
}
ImageCoding coding(int quality, ImageSize size) {
  return {quality, 0, uint64_t{size.width} * size.height};
}
bool has_module(const char* name) {
  return load_module(module_folder(), {name, "a test", "a package"}).has_value();
}

class CodedImage : public testing::TestWithParam<ImageFormat> {
 protected:
  void SetUp() override {
    if (const Status support = image_codec_support(GetParam()); !support)
      GTEST_SKIP() << support.error().what;
  }
};

TEST_P(CodedImage, BestQualityComesBack) {
  for (const ImageSize size : {ImageSize{1, 1}, ImageSize{2, 1}, ImageSize{1, 33}, ImageSize{4, 4},
                               ImageSize{64, 32}, ImageSize{100, 77}, ImageSize{1024, 3}}) {
    const RgbImage image = picture(size);
    const auto file = encode_image(GetParam(), image, coding(100, size));
    ASSERT_TRUE(file) << file.error().what;
    const auto decoded = decode_image(GetParam(), *file, size);
    ASSERT_TRUE(decoded) << decoded.error().what;
    if (GetParam() == ImageFormat::jpeg)
      EXPECT_LT(error(image, *decoded), 1.5);
    else
      EXPECT_EQ(image.rgb, decoded->rgb);
  }
}

TEST_P(CodedImage, OtherSizesAreRefused) {
  const ImageSize size{20, 10};
  const auto file = encode_image(GetParam(), picture(size), coding(100, size));
  ASSERT_TRUE(file);
  for (const ImageSize other : {ImageSize{10, 20}, ImageSize{21, 10}, ImageSize{20, 9}, ImageSize{1, 1}}) {
    const auto decoded = decode_image(GetParam(), *file, other);
    ASSERT_FALSE(decoded);
    EXPECT_EQ(decoded.error().code, ErrorCode::input);
    EXPECT_NE(decoded.error().what.find("20 x 10 pixels: expected "), std::string::npos)
        << decoded.error().what;
  }
}

TEST_P(CodedImage, EveryCutIsRefused) {
  const ImageSize size{20, 10};
  const auto file = encode_image(GetParam(), picture(size), coding(100, size));
  ASSERT_TRUE(file);
  // libpng does not ask for the last chunk, of 12 bytes, which has nothing in it.
  const size_t end = file->size() - (GetParam() == ImageFormat::png ? 12 : 0);
  for (size_t length = 0; length < end; ++length) {
    const std::vector<std::byte> cut(file->begin(), file->begin() + static_cast<ptrdiff_t>(length));
    EXPECT_FALSE(decode_image(GetParam(), cut, size)) << "cut to " << length;
  }
}

TEST_P(CodedImage, LowerQualityIsSmallerAndWorse) {
  const ImageSize size{256, 256};
  const RgbImage image = picture(size);
  size_t last_bytes = ~size_t{0};
  double last_error = -1;
  if (GetParam() == ImageFormat::png && !has_module("imagequant"))
    GTEST_SKIP() << "built without libimagequant";
  for (const int quality : {100, 80, 60, 40, 20}) {
    const auto file = encode_image(GetParam(), image, coding(quality, size));
    ASSERT_TRUE(file);
    const auto decoded = decode_image(GetParam(), *file, size);
    ASSERT_TRUE(decoded);
    const double now = error(image, *decoded);
    // libimagequant may find one palette for several.
    if (GetParam() == ImageFormat::png && quality < 100) {
      EXPECT_LE(file->size(), last_bytes) << quality;
      EXPECT_GE(now, last_error) << quality;
    } else {
      EXPECT_LT(file->size(), last_bytes) << quality;
      EXPECT_GT(now, last_error) << quality;
    }
    last_bytes = file->size();
    last_error = now;
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, CodedImage,
                         testing::Values(ImageFormat::jpeg, ImageFormat::jp2, ImageFormat::png),
                         [](const auto& format) {
                           return format.param == ImageFormat::jpeg  ? "jpeg"
                                  : format.param == ImageFormat::jp2 ? "jp2"
                                                                     : "png";
                         });

/// The share of 24 bits that its manual promises, but for the boxes around the codestream.
TEST(Jp2, SizeIsTheShareOfTheQuality) {
  if (!has_module("jp2")) GTEST_SKIP() << "built without libopenjp2";
  const ImageSize size{512, 512};
  const RgbImage image = picture(size);
  double share = 0.2;
  for (int quality = 80; quality >= 0; quality -= 20, share /= 2)
    for (const uint64_t pixels : {uint64_t{512 * 512}, uint64_t{512 * 200}}) {
      const auto file = encode_image(ImageFormat::jp2, image, {quality, 0, pixels});
      ASSERT_TRUE(file);
      const double most = share * 3 * static_cast<double>(pixels);
      EXPECT_LE(static_cast<double>(file->size()), most + 100);
      EXPECT_GE(static_cast<double>(file->size()), 0.97 * most);
    }
}

std::vector<std::byte> jp2_file() {
  const auto file = encode_image(ImageFormat::jp2, picture({40, 24}), {60, 0, 40 * 24});
  return file ? *file : std::vector<std::byte>();
}
/// Where a marker is.
size_t find(const std::vector<std::byte>& file, uint32_t marker) {
  size_t at = 0;
  while (at + 1 < file.size() &&
         (file[at] != static_cast<std::byte>(marker >> 8) || file[at + 1] != static_cast<std::byte>(marker)))
    ++at;
  return at;
}

/// What libopenjp2 would believe, or would take for another image.
TEST(Jp2, WhatIsNotExpectedIsRefused) {
  if (!has_module("jp2")) GTEST_SKIP() << "built without libopenjp2";
  struct Change {
    uint32_t marker;
    size_t at;  ///< behind the marker
    uint8_t value;
    const char* message;
  };
  const Change changes[] = {
      {0xff51, 13, 1, "marker SIZ: does not begin at 0, 0"},
      {0xff51, 23, 8, "more than one tile"},
      {0xff51, 37, 4, "marker SIZ: not its length"},
      {0xff51, 38, 11, "a component that is subsampled"},
      {0xff51, 39, 2, "a component that is subsampled"},
      {0xff52, 5, 255, "255 layers"},
      {0xff52, 7, 32, "32 levels"},
      {0xff52, 8, 0, "code-blocks of a size"},
      {0xff52, 10, 64, "code-blocks of another part"},
      {0xff52, 2, 1, "marker COD: not its length"},
      {0xff5c, 1, 255, "a marker's segment is cut short"},
      {0xff5c, 0 - size_t{1}, 0x53, "marker ff53"},
      {0xff90, 3, 1, "not of the one tile"},
      {0xff90, 4, 255, "a tile-part behind the end"},
      {0xff93, 0 - size_t{1}, 0x61, "a marker's segment is cut short"},
  };
  const std::vector<std::byte> good = jp2_file();
  ASSERT_TRUE(decode_image(ImageFormat::jp2, good, {40, 24}));
  for (const Change& change : changes) {
    auto file = good;
    const size_t place = find(file, change.marker) + 2 + change.at;
    ASSERT_LT(place, file.size());
    file[place] = std::byte{change.value};
    const auto decoded = decode_image(ImageFormat::jp2, file, {40, 24});
    ASSERT_FALSE(decoded) << change.message;
    EXPECT_NE(decoded.error().what.find(change.message), std::string::npos) << decoded.error().what;
  }
}

/// A PNG file of 2 x 1 pixels.
std::vector<std::byte> png_file(uint8_t bits, uint8_t kind, const std::string& row) {
  std::string file = "\x89PNG\r\n\x1a\n";
  const auto number = [](uint32_t v) {
    return std::string{static_cast<char>(v >> 24), static_cast<char>(v >> 16), static_cast<char>(v >> 8),
                       static_cast<char>(v)};
  };
  const auto chunk = [&](const std::string& body) {
    file += number(static_cast<uint32_t>(body.size() - 4)) + body +
            number(static_cast<uint32_t>(
                crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()))));
  };
  chunk("IHDR" + number(2) + number(1) + static_cast<char>(bits) + static_cast<char>(kind) +
        std::string(3, '\0'));
  std::string data(100, '\0');
  uLongf length = data.size();
  const std::string rows = '\0' + row;
  compress(reinterpret_cast<Bytef*>(data.data()), &length, reinterpret_cast<const Bytef*>(rows.data()),
           rows.size());
  chunk("IDAT" + data.substr(0, length));
  chunk("IEND");
  std::vector<std::byte> bytes;
  for (const char c : file) bytes.push_back(static_cast<std::byte>(c));
  return bytes;
}

TEST(Png, GreyIsReadAndOtherKindsAreRefused) {
  if (!has_module("png")) GTEST_SKIP() << "built without libpng";
  const auto rgb = decode_image(ImageFormat::png, png_file(8, 2, "abcdef"), {2, 1});
  ASSERT_TRUE(rgb) << rgb.error().what;
  EXPECT_EQ(rgb->rgb[4], std::byte{'e'});
  const auto grey = decode_image(ImageFormat::png, png_file(8, 0, "ab"), {2, 1});
  ASSERT_TRUE(grey) << grey.error().what;
  EXPECT_EQ(grey->rgb[5], std::byte{'b'});
  const auto alpha = decode_image(ImageFormat::png, png_file(8, 6, "abcdefgh"), {2, 1});
  ASSERT_FALSE(alpha);
  EXPECT_EQ(alpha.error().what, "PNG image: has alpha: expected RGB");
  const auto deep = decode_image(ImageFormat::png, png_file(16, 2, "abcdefghijkl"), {2, 1});
  ASSERT_FALSE(deep);
  EXPECT_EQ(deep.error().what, "PNG image: 16 bits a component: expected 8");
}

TEST(Png, APaletteHasSoManyColors) {
  if (!has_module("png") || !has_module("imagequant")) GTEST_SKIP() << "built without libimagequant";
  const RgbImage image = picture({128, 128});
  size_t last = 0;
  for (const int colors : {2, 16, 200, 256}) {
    ImageCoding of;
    of.palette = colors;
    const auto file = encode_image(ImageFormat::png, image, of);
    ASSERT_TRUE(file) << file.error().what;
    EXPECT_GT(file->size(), last);
    last = file->size();
    const auto decoded = decode_image(ImageFormat::png, *file, image.size);
    ASSERT_TRUE(decoded);
    std::set<std::array<std::byte, 3>> found;
    for (size_t i = 0; i < decoded->rgb.size(); i += 3)
      found.insert({decoded->rgb[i], decoded->rgb[i + 1], decoded->rgb[i + 2]});
    EXPECT_LE(found.size(), static_cast<size_t>(colors));
    EXPECT_GE(found.size(), static_cast<size_t>(colors) * 3 / 4);
  }
}

}  // namespace
}  // namespace voxkit
