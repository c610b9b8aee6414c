// PNG slices: what their samples are, and images on a full disk.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <zlib.h>

#include <csignal>
#include <filesystem>

#include "formats/image/image.h"
#include "formats/module.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

template <class Set>
OpenOptions with(const Set& set) {
  OpenOptions options;
  set(options);
  return options;
}

/// A PNG file by hand; `rows` with the byte of the filter before each.
struct Png {
  uint32_t width = 1, height = 1;
  uint8_t bits = 8, color = 0;  // 0 grey, 2 RGB, 3 palette, 4 grey and alpha, 6 RGBA
  std::string rows = {}, palette = {}, transparent = {}, physical = {};

  std::string bytes() const {
    std::string file = "\x89PNG\r\n\x1a\n";
    chunk(file, "IHDR",
          be(width) + be(height) + static_cast<char>(bits) + static_cast<char>(color) + std::string(3, '\0'));
    if (!palette.empty()) chunk(file, "PLTE", palette);
    if (!transparent.empty()) chunk(file, "tRNS", transparent);
    if (!physical.empty()) chunk(file, "pHYs", physical);
    uLongf length = compressBound(rows.size());
    std::string packed(length, '\0');
    compress(reinterpret_cast<Bytef*>(packed.data()), &length, reinterpret_cast<const Bytef*>(rows.data()),
             rows.size());
    packed.resize(length);
    chunk(file, "IDAT", packed);
    chunk(file, "IEND", "");
    return file;
  }
  static std::string be(uint32_t v) {
    return {static_cast<char>(v >> 24), static_cast<char>(v >> 16), static_cast<char>(v >> 8),
            static_cast<char>(v)};
  }

 private:
  static void chunk(std::string& file, const std::string& type, const std::string& data) {
    const std::string body = type + data;
    const auto sum = crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
    file += be(static_cast<uint32_t>(data.size())) + body + be(static_cast<uint32_t>(sum));
  }
};

class PngStack : public FileFormatTest {
 protected:
  void SetUp() override {
    FileFormatTest::SetUp();
    if (!std::filesystem::exists(module_folder() + "/image_stack.so"))
      GTEST_SKIP() << "built without OpenImageIO";
    ctx_.note = [this](const std::string& line) { notes_ += line + "\n"; };
  }
  std::string read_file(const Png& png, const OpenOptions& options = {}) {
    const auto source = open_image_stack(put("a.png", png.bytes()), options, ctx_);
    if (!source) return source.error().what;
    info_ = (*source)->info();
    const auto voxels = read(**source);
    if (!voxels) return voxels.error().what;
    return {reinterpret_cast<const char*>(voxels->data()), voxels->size()};
  }
  VolumeInfo info_;
  std::string notes_;
};

TEST_F(PngStack, SamplesAreKeptAsTheyAreStored) {
  EXPECT_EQ(read_file({.width = 9, .bits = 1, .rows = std::string("\0\xa0\x80", 3)}),
            std::string("\1\0\1\0\0\0\0\0\1", 9));
  EXPECT_EQ(info_.format, VoxelFormat::bitmap);
  EXPECT_EQ(read_file({.width = 3, .bits = 4, .rows = std::string("\0\x1f\x70", 3)}), "\x01\x0f\x07");
  EXPECT_EQ(read_file({.width = 2, .bits = 16, .rows = std::string("\0\1\2\3\4", 5)}), "\2\1\4\3");
  EXPECT_EQ(info_.sample_type, SampleType::u16);
  EXPECT_EQ(read_file({.width = 1, .color = 6, .rows = std::string("\0\1\2\3\0", 5)}),
            std::string("\1\2\3\0", 4));
  EXPECT_EQ(read_file({.width = 2,
                       .color = 2,
                       .rows = std::string("\0abcdef", 7),
                       .transparent = std::string("\0d\0e\0f", 6)}),
            std::string("abc\xff"
                        "def\0",
                        8));
  EXPECT_NE(read_file({.width = 1, .color = 4, .rows = std::string("\0ab", 3)})
                .find("--channel N with a number from 0 to 1"),
            std::string::npos);
  EXPECT_EQ(read_file({.width = 1, .color = 4, .rows = std::string("\0ab", 3)},
                      with([&](OpenOptions& o) { o.channel = 1; })),
            "b");
  EXPECT_EQ(read_file({.width = 1, .bits = 16, .color = 2, .rows = std::string("\0\0a\0b\0c", 7)},
                      with([&](OpenOptions& o) { o.channel = 2; })),
            std::string("c\0", 2));
}

TEST_F(PngStack, PalettesAreGreyOrColorsOrLabels) {
  Png png{.width = 4, .bits = 2, .color = 3, .rows = std::string("\0\x1b", 2), .palette = "aaabbbcccddd"};
  EXPECT_EQ(read_file(png), "abcd");
  EXPECT_EQ(info_.format, VoxelFormat::density8);
  EXPECT_EQ(read_file(png, with([&](OpenOptions& o) { o.labels = true; })), std::string("\0\1\2\3", 4));
  EXPECT_TRUE(info_.is_labels);
  png.palette[1] = 'x';
  EXPECT_EQ(read_file(png), "axabbbcccddd");
  EXPECT_EQ(info_.format, VoxelFormat::rgb24);
  png.transparent = std::string("\xff\x80", 2);
  EXPECT_EQ(read_file(png),
            "axa\xff"
            "bbb\x80"
            "ccc\xff"
            "ddd\xff");
  // Slices of one stack are alike.
  png = {.width = 1, .color = 3, .rows = std::string("\0\0", 2), .palette = "aaa"};
  put("s0.png", png.bytes());
  png.palette = "abc";
  put("s1.png", png.bytes());
  auto source = open_image_stack(path("s%d.png"), {}, ctx_);
  ASSERT_FALSE(source);
  EXPECT_NE(source.error().what.find("palette of colours"), std::string::npos);
}

TEST_F(PngStack, PixelsHaveAPhysicalSize) {
  Png png{.rows = std::string("\0a", 2), .physical = Png::be(2000) + Png::be(4000) + '\1'};
  EXPECT_EQ(read_file(png), "a");
  EXPECT_EQ(info_.affine.spacing(), (std::array<double, 3>{0.5, 0.25, 0.5}));
  EXPECT_EQ(info_.unit, Unit::millimetre);
}

TEST_F(PngStack, DamageIsOneLineOfOurOwn) {
  // Whole chunks, but pixels that libpng complains of.
  testing::internal::CaptureStderr();
  Png png{.width = 3, .height = 2, .rows = std::string("\7abc", 4)};
  const std::string text = read_file(png);
  EXPECT_NE(text.find("corrupt PNG file"), std::string::npos) << text;
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  png = {.width = 50000, .height = 50000, .rows = std::string(1 << 20, '\0')};
  EXPECT_NE(read_file(png).find("cannot hold that"), std::string::npos);
  // 4 MB that stand for more pixels than are taken.
  png.rows = std::string(size_t{100} << 20, '\0');
  for (size_t i = 0; i < png.rows.size(); i += 64) png.rows[i] = static_cast<char>(random_());
  EXPECT_NE(read_file(png).find("50000 x 50000 pixels: expected at most 2^31"), std::string::npos);
}

/// Files may not grow past so many bytes, as on a full disk.
class SmallFiles {
 public:
  explicit SmallFiles(rlim_t bytes) {
    old_handler_ = std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &old_);
    const rlimit small{bytes, old_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~SmallFiles() {
    setrlimit(RLIMIT_FSIZE, &old_);
    std::signal(SIGXFSZ, old_handler_);
  }

 private:
  rlimit old_{};
  void (*old_handler_)(int) = nullptr;
};

TEST_F(PngStack, WhatCannotBeWrittenLeavesOldFilesAlone) {
  for (const char* ending : {"png", "tif", "exr"}) {
    const bool exr = std::string(ending) == "exr";
    const VolumeInfo info = make_info({64, 64, 2}, exr ? VoxelFormat::float32 : VoxelFormat::density8,
                                      exr ? SampleType::f32 : SampleType::u8);
    const Bytes old = random_voxels(info), fresh = random_voxels(info);
    const std::string stack = fmt::format("s%d.{}", ending);
    auto sink = create_image_stack(path(stack), info, true, ctx_);
    ASSERT_TRUE(sink && write(**sink, info, old));
    const std::string before = get(path(fmt::format("s0.{}", ending)));
    Image image = *Image::create(64, 64, 1, exr ? SampleType::f32 : SampleType::u8, ctx_);
    for (int64_t i = 0; i < 64 * 64; ++i) image.row(0)[i] = static_cast<float>(random_() % 256);
    const std::string picture = path(fmt::format("picture.{}", ending));
    ASSERT_TRUE(write_image(picture, image, true));
    const std::string picture_before = get(picture);
    for (const size_t limit : {size_t{0}, size_t{100}, before.size() / 2, before.size() - 1}) {
      SCOPED_TRACE(testing::Message() << ending << " " << limit);
      Status written, pictured;
      {
        const SmallFiles small(limit);
        sink = create_image_stack(path(stack), info, true, ctx_);
        ASSERT_TRUE(sink);
        written = write(**sink, info, fresh);
        sink->reset();
        image.row(0)[0] += 1;
        pictured = limit < picture_before.size() - 40 ? write_image(picture, image, true)
                                                      : Status(fail(ErrorCode::output, "", ""));
      }
      ASSERT_FALSE(written);
      EXPECT_EQ(written.error().code, ErrorCode::output) << written.error().what;
      ASSERT_FALSE(pictured);
      EXPECT_EQ(pictured.error().code, ErrorCode::output) << pictured.error().what;
      EXPECT_EQ(get(path(fmt::format("s0.{}", ending))), before);
      EXPECT_EQ(get(picture), picture_before);
    }
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) EXPECT_FALSE(entry.is_directory());
}

}  // namespace
}  // namespace voxkit
