#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <thread>

#include "formats/image/image.h"
#include "formats/little_endian.h"
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

/// What is in an OpenEXR file of one part, floats and blocks of 16 rows, by its specification.
struct OpenExr {
  std::map<std::string, std::string> attributes;  ///< name and value
  std::map<std::string, std::vector<float>> channels;

  OpenExr(const std::string& file, size_t width, size_t height) {
    size_t at = 8;
    const auto name = [&] {
      const std::string text = file.c_str() + at;
      at += text.size() + 1;
      return text;
    };
    const auto number = [&](size_t from) { return load_le<uint32_t>(as_bytes(file) + from); };
    while (file[at] != '\0') {
      const std::string attribute = name();
      name();  // its type
      const size_t end = at + 4 + number(at);
      at += 4;
      attributes[attribute] = file.substr(at, end - at);
      if (attribute == "channels")
        for (; file[at] != '\0'; at += 16) {
          const std::string channel = name();
          EXPECT_EQ(number(at), 2u) << channel << " is not of floats";
          channels[channel].resize(width * height);
        }
      at = end;
    }
    at += 1 + 8 * ((height + 15) / 16);
    while (at < file.size()) {
      const size_t y0 = number(at), bytes = number(at + 4), y1 = std::min(y0 + 16, height);
      std::string block(4 * (y1 - y0) * width * channels.size(), '\0');
      if (bytes == block.size())
        block = file.substr(at + 8, bytes);
      else
        block = unzip(file.substr(at + 8, bytes), block.size());
      const std::byte* in = as_bytes(block);
      for (size_t y = y0; y < y1; ++y)
        for (auto& [channel, samples] : channels)
          for (size_t x = 0; x < width; ++x, in += 4) samples[y * width + x] = load_le<float>(in);
      at += 8 + bytes;
    }
  }

 private:
  static const std::byte* as_bytes(const std::string& text) {
    return reinterpret_cast<const std::byte*>(text.data());
  }
  /// Deflated are the differences of the bytes, and before these all even ones, then all odd ones.
  static std::string unzip(const std::string& data, size_t size) {
    std::string bytes(size, '\0'), out = bytes;
    uLongf length = size;
    EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(bytes.data()), &length,
                         reinterpret_cast<const Bytef*>(data.data()), data.size()),
              Z_OK);
    for (size_t i = 1; i < size; ++i) bytes[i] = static_cast<char>(bytes[i - 1] + bytes[i] - 128);
    for (size_t i = 0; i < size; ++i) out[i] = bytes[i / 2 + (i % 2 ? (size + 1) / 2 : 0)];
    return out;
  }
};

class ImageLayersTest : public ImageFileTest {
 protected:
  std::vector<ImageLayer> random_layers(int64_t width, int64_t height) {
    std::vector<ImageLayer> layers;
    layers.push_back({"depth", "Z", random_image(width, height, 1, SampleType::f32)});
    layers.push_back({"normal", "XYZ", random_image(width, height, 3, SampleType::f32)});
    layers[0].image.row(0)[0] = std::numeric_limits<float>::infinity();
    return layers;
  }
};

TEST_F(ImageLayersTest, AreChannelsOfOneFileBesideThePicture) {
  constexpr int64_t width = 7, height = 131;
  const std::string names[] = {"Y", "YA", "RGB", "RGBA"};
  for (const int channels : {1, 2, 3, 4}) {
    const Image image = random_image(width, height, channels, SampleType::f32);
    const auto layers = random_layers(width, height);
    const Status written = write_image(path("a.exr"), image, true, layers);
    ASSERT_TRUE(written) << written.error().what;
    const OpenExr file(get(path("a.exr")), width, height);
    EXPECT_EQ(file.channels.size(), static_cast<size_t>(channels) + 4);
    const auto expect_channel = [&](const std::string& name, const Image& from, int64_t c) {
      ASSERT_TRUE(file.channels.contains(name)) << name;
      for (int64_t i = 0; i < width * height; ++i)
        ASSERT_EQ(file.channels.at(name)[static_cast<size_t>(i)], from.row(0)[i * from.channels() + c])
            << name << " " << i;
    };
    for (int c = 0; c < channels; ++c)
      expect_channel(std::string(1, names[channels - 1][static_cast<size_t>(c)]), image, c);
    expect_channel("depth.Z", layers[0].image, 0);
    expect_channel("normal.X", layers[1].image, 0);
    expect_channel("normal.Y", layers[1].image, 1);
    expect_channel("normal.Z", layers[1].image, 2);
    expect_same(image, read_back(path("a.exr")));
  }
}

TEST_F(ImageLayersTest, NothingIsStoredThatDiffersFromRunToRun) {
  ASSERT_TRUE(write_image(path("a.exr"), random_image(4, 4, 4, SampleType::f32), false, random_layers(4, 4)));
  auto attributes = OpenExr(get(path("a.exr")), 4, 4).attributes;
  for (const char* fixed : {"channels", "compression", "dataWindow", "displayWindow", "lineOrder",
                            "pixelAspectRatio", "screenWindowCenter", "screenWindowWidth"})
    attributes.erase(fixed);
  if (attributes.contains("capDate")) {
    EXPECT_EQ(attributes["capDate"], "");
    attributes.erase("capDate");
  }
  for (const auto& [attribute, value] : attributes) ADD_FAILURE() << attribute << ": " << value;
}

TEST_F(ImageLayersTest, OtherChannelsThanThePictureAreNotRead) {
  // As other programs write it: five channels of no layer. Z comes after A, and is none of the picture's.
  std::vector<ImageLayer> layers;
  layers.push_back({"x", "Z", random_image(3, 3, 1, SampleType::f32)});
  const Image image = random_image(3, 3, 3, SampleType::f32);
  ASSERT_TRUE(write_image(path("a.exr"), image, false, layers));
  expect_same(image, read_back(path("a.exr")));  // not four channels
  // Where nothing is called as a picture's channels are, there must be four at most.
  std::string file = get(path("a.exr"));
  const size_t red = file.find(std::string("R\0\2", 3));
  ASSERT_NE(red, std::string::npos);
  file[red] = 'Q';
  EXPECT_EQ(read_back(put("four.exr", file)).channels(), 4);
  ASSERT_TRUE(write_image(path("b.exr"), image, false, random_layers(3, 3)));
  file = get(path("b.exr"));
  file[file.find(std::string("R\0\2", 3))] = 'Q';
  const auto seven = read_image(put("seven.exr", file), ctx_);
  ASSERT_FALSE(seven);
  EXPECT_EQ(seven.error().code, ErrorCode::input);
}

TEST_F(ImageLayersTest, AreForOpenExrOfTheirSizeOnly) {
  const Image image = random_image(4, 4, 3, SampleType::f32);
  const auto refused = [&](const char* name, int64_t width, const char* channels, SampleType type) {
    std::vector<ImageLayer> layers;
    layers.push_back({"depth", channels, random_image(width, 4, 1, type)});
    const Status written = write_image(path(name), image, false, layers);
    return !written && written.error().code == ErrorCode::usage && !std::filesystem::exists(path(name));
  };
  EXPECT_TRUE(refused("a.tif", 4, "Z", SampleType::f32));
  EXPECT_TRUE(refused("a.exr", 5, "Z", SampleType::f32));
  EXPECT_TRUE(refused("a.exr", 4, "XY", SampleType::f32));
  EXPECT_TRUE(refused("a.exr", 4, "Z", SampleType::u8));
  EXPECT_FALSE(refused("a.exr", 4, "Z", SampleType::f32));
}

TEST_F(ImageLayersTest, CutAndDamagedFilesDoNoHarm) {
  ASSERT_TRUE(write_image(path("a.exr"), random_image(5, 3, 4, SampleType::f32), false, random_layers(5, 3)));
  const std::string whole = get(path("a.exr"));
  for (size_t length = 0; length < whole.size(); ++length) {
    const auto image = read_image(put("cut.exr", whole.substr(0, length)), ctx_);
    ASSERT_FALSE(image) << length;
    EXPECT_EQ(image.error().code, ErrorCode::input);
  }
  for (int round = 0; round < 300; ++round) {
    std::string file = whole;
    for (int i = 0; i < 3; ++i) file[random_() % file.size()] = static_cast<char>(random_());
    (void)read_image(put("bad.exr", file), ctx_);
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
