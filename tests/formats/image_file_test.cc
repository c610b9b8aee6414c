#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <thread>

#include "formats/image.h"
#include "formats/module.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

class ImageFileTest : public FileFormatTest {
 protected:
  void SetUp() override {
    FileFormatTest::SetUp();
    if (!load_module(module_folder(), {"image_stack", "reading images", ""}))
      GTEST_SKIP() << "no OpenImageIO";
  }

  Image random_image(int64_t width, int64_t height, int channels, SampleType type) {
    auto image = Image::create(width, height, channels, type, ctx_);
    EXPECT_TRUE(image);
    const int bits = 8 * sample_bytes(type);
    const bool is_signed = type == SampleType::i8 || type == SampleType::i16;
    for (int64_t i = 0; i < image->pixels() * channels; ++i) {
      const auto number = static_cast<int32_t>(random_() & 0xffff);
      image->row(0)[i] =
          type == SampleType::f32
              ? static_cast<float>(number) / 1000 - 5
              : static_cast<float>((number >> (16 - bits)) - (is_signed ? 1 << (bits - 1) : 0));
    }
    return std::move(*image);
  }

  Image read_back(const std::string& file) {
    auto image = read_image(file, ctx_);
    EXPECT_TRUE(image) << image.error().what;
    EXPECT_TRUE(image && *image);
    return std::move(**image);
  }

  static void expect_same(const Image& a, const Image& b) {
    ASSERT_EQ(a.width(), b.width());
    ASSERT_EQ(a.height(), b.height());
    ASSERT_EQ(a.channels(), b.channels());
    ASSERT_EQ(a.type(), b.type());
    for (int64_t i = 0; i < a.pixels() * a.channels(); ++i) ASSERT_EQ(a.row(0)[i], b.row(0)[i]) << i;
  }

  /// A grey JPEG of 8 x 8 samples of 208: one coefficient, codes of one bit.
  static std::string jpeg() {
    std::string file = "\xff\xd8";
    const auto segment = [&](char marker, const std::string& data) {
      file += '\xff';
      file += marker;
      file += '\0';
      file += static_cast<char>(data.size() + 2);
      file += data;
    };
    segment('\xdb', std::string(1, '\0') + std::string(64, '\x08'));
    segment('\xc0', std::string("\x08\0\x08\0\x08\x01\x01\x11\0", 9));
    for (const char table : {'\0', '\x10'})
      segment('\xc4', std::string(1, table) + '\x01' + std::string(15, '\0') + (table ? '\0' : '\x07'));
    segment('\xda', std::string("\x01\x01\0\0\x3f\0", 6));
    return file + "\x50\x7f\xff\xd9";
  }
};

TEST_F(ImageFileTest, RoundTrips) {
  struct {
    const char* name;
    SampleType type;
  } const files[] = {{"a.png", SampleType::u8},  {"b.png", SampleType::u16},  {"c.tif", SampleType::u8},
                     {"d.tif", SampleType::i8},  {"e.TIFF", SampleType::u16}, {"f.tif", SampleType::i16},
                     {"g.tif", SampleType::f32}, {"h.exr", SampleType::f32}};
  for (const auto& file : files)
    for (const int channels : {1, 2, 3, 4})
      for (const auto& [width, height] : {std::pair<int64_t, int64_t>{1, 1}, {37, 131}}) {
        SCOPED_TRACE(fmt::format("{} {} {}", file.name, channels, width));
        const Image image = random_image(width, height, channels, file.type);
        const Status written = write_image(path(file.name), image, true);
        ASSERT_TRUE(written) << written.error().what;
        expect_same(image, read_back(path(file.name)));
      }
}

TEST_F(ImageFileTest, IntegersAreRoundedAndClamped) {
  auto image = Image::create(6, 1, 1, SampleType::u8, ctx_);
  ASSERT_TRUE(image);
  const float in[] = {-3, 0.4f, 0.6f, 254.7f, 300, std::numeric_limits<float>::quiet_NaN()};
  const float out[] = {0, 0, 1, 255, 255, 0};
  std::copy_n(in, 6, image->row(0));
  ASSERT_TRUE(write_image(path("a.png"), *image, false));
  const Image back = read_back(path("a.png"));
  for (int i = 0; i < 6; ++i) EXPECT_EQ(back.row(0)[i], out[i]);
}

TEST_F(ImageFileTest, SameBytesEachTime) {
  const Image real = random_image(20, 10, 3, SampleType::f32),
              whole = random_image(20, 10, 3, SampleType::u8);
  const char* const names[] = {"1.exr", "1.tif", "1.png"};
  std::vector<std::string> first;
  for (int round = 0; round < 2; ++round) {
    if (round == 1) std::this_thread::sleep_for(std::chrono::milliseconds(1100));
    for (size_t i = 0; i < 3; ++i) {
      ASSERT_TRUE(write_image(path(names[i]), i == 0 ? real : whole, true));
      if (round == 0)
        first.push_back(get(path(names[i])));
      else
        EXPECT_EQ(get(path(names[i])), first[i]) << names[i];
    }
  }
}

TEST_F(ImageFileTest, Jpeg) {
  const Image image = read_back(put("a.jpg", jpeg()));
  EXPECT_EQ(image.width(), 8);
  EXPECT_EQ(image.height(), 8);
  EXPECT_EQ(image.channels(), 1);
  for (int i = 0; i < 64; ++i) EXPECT_EQ(image.row(0)[i], 208);
}

TEST_F(ImageFileTest, EveryCutFileIsAnError) {
  const Image small = random_image(5, 3, 3, SampleType::u8), real = random_image(5, 3, 3, SampleType::f32);
  ASSERT_TRUE(write_image(path("a.png"), small, false));
  ASSERT_TRUE(write_image(path("a.tif"), small, false));
  ASSERT_TRUE(write_image(path("a.exr"), real, false));
  put("a.jpg", jpeg());
  for (const char* name : {"a.png", "a.tif", "a.exr", "a.jpg"}) {
    const std::string whole = get(path(name));
    for (size_t length = 0; length < whole.size(); ++length) {
      const auto image = read_image(put(std::string("cut-") + name, whole.substr(0, length)), ctx_);
      ASSERT_FALSE(image) << name << " of " << length << " bytes";
      EXPECT_EQ(image.error().code, ErrorCode::input);
      EXPECT_EQ(image.error().what.find('\n'), std::string::npos);
    }
  }
}

TEST_F(ImageFileTest, DamagedFilesDoNoHarm) {
  ASSERT_TRUE(write_image(path("a.tif"), random_image(5, 3, 4, SampleType::u16), false));
  ASSERT_TRUE(write_image(path("a.exr"), random_image(5, 3, 4, SampleType::f32), false));
  put("a.jpg", jpeg());
  for (const char* name : {"a.tif", "a.exr", "a.jpg"})
    for (int round = 0; round < 300; ++round) {
      std::string file = get(path(name));
      for (int i = 0; i < 3; ++i) file[random_() % file.size()] = static_cast<char>(random_());
      (void)read_image(put(std::string("bad-") + name, file), ctx_);
    }
}

TEST_F(ImageFileTest, RefusesWhatAFileCannotHold) {
  const auto refused = [&](const char* name, SampleType type) {
    const Status written = write_image(path(name), random_image(3, 3, 1, type), false);
    return !written && written.error().code == ErrorCode::usage && !std::filesystem::exists(path(name));
  };
  EXPECT_TRUE(refused("a.png", SampleType::f32));
  EXPECT_TRUE(refused("a.png", SampleType::i16));
  EXPECT_TRUE(refused("a.exr", SampleType::u8));
  EXPECT_TRUE(refused("a.jpg", SampleType::u8));
  EXPECT_TRUE(refused("a-%d.png", SampleType::u8));
  EXPECT_TRUE(refused("a.nrrd", SampleType::u8));
}

TEST_F(ImageFileTest, KeepsAnExistingFileUnlessForced) {
  put("a.png", "old");
  const Image image = random_image(3, 3, 1, SampleType::u8);
  EXPECT_EQ(write_image(path("a.png"), image, false).error().code, ErrorCode::output);
  EXPECT_EQ(check_image_output(path("a.png"), false).error().code, ErrorCode::output);
  EXPECT_EQ(get(path("a.png")), "old");
  EXPECT_TRUE(write_image(path("a.png"), image, true));
  expect_same(image, read_back(path("a.png")));
  EXPECT_EQ(write_image(path("none/a.png"), image, false).error().code, ErrorCode::output);
}

TEST_F(ImageFileTest, MemoryIsLimited) {
  ASSERT_TRUE(write_image(path("a.png"), random_image(100, 100, 4, SampleType::u8), false));
  MemoryBudget small(150000);
  Context ctx{.threads = 1, .memory = &small};
  EXPECT_EQ(read_image(path("a.png"), ctx).error().code, ErrorCode::limit);
}

TEST_F(ImageFileTest, SeveralPagesAreAVolume) {
  ASSERT_TRUE(write_image(path("a.tif"), random_image(4, 4, 1, SampleType::u8), false));
  // The same page again: its directory, at the end of the file, leads to a copy of itself.
  std::string file = get(path("a.tif"));
  const auto number = [&](size_t at, size_t bytes) {
    size_t value = 0;
    for (size_t i = 0; i < bytes; ++i) value |= size_t{static_cast<unsigned char>(file[at + i])} << (8 * i);
    return value;
  };
  const size_t directory = number(4, 4), bytes = 2 + 12 * number(directory, 2);
  if (file.size() % 2 != 0) file += '\0';
  const size_t copy = file.size();
  file += file.substr(directory, bytes) + std::string(4, '\0');
  for (size_t i = 0; i < 4; ++i) file[directory + bytes + i] = static_cast<char>(copy >> (8 * i));
  const auto image = read_image(put("two.tif", file), ctx_);
  ASSERT_TRUE(image) << image.error().what;
  EXPECT_FALSE(*image);
}

TEST(ImageNameTest, TellsImagesFromVolumes) {
  for (const char* name : {"a.png", "b.TIF", "c.d/e.tiff", "x.exr", "y.jpg", "z.JPEG"})
    EXPECT_TRUE(is_image_name(name)) << name;
  for (const char* name : {"a.nrrd", "a-%04d.png", "png", "folder", "-", "menger:3", "a.png.gz"})
    EXPECT_FALSE(is_image_name(name)) << name;
}

}  // namespace
}  // namespace voxkit
