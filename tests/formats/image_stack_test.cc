#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <thread>

#include "formats/module.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

/// An uncompressed little-endian TIFF by hand: one page for each element of `pages`, which are the pages'
/// pixels.
struct Tiff {
  uint32_t width = 1, height = 1;
  uint16_t samples = 1, bits = 8, sample_format = 1;  // 1 unsigned, 2 signed, 3 float
  std::vector<std::string> pages = {};

  std::string bytes() const {
    std::string file = "II*\0";
    file.resize(4, '\0');
    uint32_t link = 4;
    put32(file, 0);
    for (const std::string& pixels : pages) {
      const auto data = static_cast<uint32_t>(file.size());
      file += pixels;
      if (file.size() % 2) file += '\0';
      const auto bits_at = static_cast<uint32_t>(file.size());
      for (int i = 0; i < samples; ++i) put16(file, bits);
      const auto format_at = static_cast<uint32_t>(file.size());
      for (int i = 0; i < samples; ++i) put16(file, sample_format);
      set32(file, link, static_cast<uint32_t>(file.size()));
      const bool alpha = samples == 2 || samples == 4;
      put16(file, alpha ? 11 : 10);
      entry(file, 256, 4, 1, width);
      entry(file, 257, 4, 1, height);
      entry(file, 258, 3, samples, samples > 2 ? bits_at : bits | (samples > 1 ? uint32_t{bits} << 16 : 0));
      entry(file, 259, 3, 1, 1);
      entry(file, 262, 3, 1, samples > 2 ? 2 : 1);
      entry(file, 273, 4, 1, data);
      entry(file, 277, 3, 1, samples);
      entry(file, 278, 4, 1, height);
      entry(file, 279, 4, 1, static_cast<uint32_t>(pixels.size()));
      if (alpha) entry(file, 338, 3, 1, 2);  // unassociated
      entry(file, 339, 3, samples,
            samples > 2 ? format_at : sample_format | (samples > 1 ? uint32_t{sample_format} << 16 : 0));
      link = static_cast<uint32_t>(file.size());
      put32(file, 0);
    }
    return file;
  }

 private:
  static void put16(std::string& file, uint32_t v) {
    file += static_cast<char>(v);
    file += static_cast<char>(v >> 8);
  }
  static void put32(std::string& file, uint32_t v) {
    put16(file, v & 0xffff);
    put16(file, v >> 16);
  }
  static void set32(std::string& file, size_t at, uint32_t v) {
    for (size_t i = 0; i < 4; ++i) file[at + i] = static_cast<char>(v >> (8 * i));
  }
  static void entry(std::string& file, uint32_t tag, uint32_t type, uint32_t count, uint32_t value) {
    put16(file, tag);
    put16(file, type);
    put32(file, count);
    put32(file, value);
  }
};

std::string text_of(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class ImageStack : public FileFormatTest {
 protected:
  void SetUp() override {
    FileFormatTest::SetUp();
    if (!std::filesystem::exists(module_folder() + "/image_stack.so"))
      GTEST_SKIP() << "built without OpenImageIO";
    ctx_.threads = 2;
  }
  Status write_stack(const std::string& name, const VolumeInfo& info, const Bytes& voxels,
                     bool force = false) {
    VOX_TRY(const auto sink, create_image_stack(path(name), info, force, ctx_));
    return write(*sink, info, voxels);
  }
  Result<Bytes> read_stack(const std::string& name, VolumeInfo* info = nullptr) {
    VOX_TRY(const auto source, open_image_stack(path(name), {}, ctx_));
    if (info) *info = source->info();
    return read(*source);
  }
  void expect_refused(const std::string& name, ErrorCode code, const std::string& part) {
    const auto voxels = read_stack(name);
    ASSERT_FALSE(voxels) << "accepted; expected an error with: " << part;
    EXPECT_EQ(voxels.error().code, code) << voxels.error().what;
    const std::string line = voxels.error().file + ": " + voxels.error().what;
    EXPECT_NE(line.find(part), std::string::npos) << line;
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
  }
  std::string put_tiff(const std::string& name, uint32_t width, uint32_t height,
                       const std::string& pixels) const {
    return put(name, Tiff{.width = width, .height = height, .pages = {pixels}}.bytes());
  }
  size_t files() const {
    size_t count = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) count += entry.exists();
    return count;
  }
};

TEST_F(ImageStack, WhatAnEndingHoldsComesBackExactly) {
  struct Case {
    const char* ending;
    VoxelFormat format;
    SampleType type;
  };
  const Case cases[] = {
      {"tif", VoxelFormat::density8, SampleType::u8},   {"tif", VoxelFormat::density8, SampleType::i8},
      {"tif", VoxelFormat::density16, SampleType::u16}, {"tif", VoxelFormat::density16, SampleType::i16},
      {"tiff", VoxelFormat::float32, SampleType::f32},  {"tif", VoxelFormat::rgb24, SampleType::u8},
      {"tif", VoxelFormat::rgba32, SampleType::u8},     {"png", VoxelFormat::density8, SampleType::u8},
      {"png", VoxelFormat::density16, SampleType::u16}, {"png", VoxelFormat::rgb24, SampleType::u8},
      {"png", VoxelFormat::rgba32, SampleType::u8},     {"exr", VoxelFormat::float32, SampleType::f32},
  };
  int n = 0;
  for (const Case& c : cases)
    for (const Index3 dims : {Index3(1, 1, 1), Index3(7, 131, 5), Index3(64, 8, 3)}) {
      const VolumeInfo info = make_info(dims, c.format, c.type);
      SCOPED_TRACE(testing::Message()
                   << c.ending << " " << name(c.format) << " " << dims.x << " x " << dims.y);
      const Bytes voxels = random_voxels(info);
      const std::string stack = fmt::format("s{}-%03d.{}", n++, c.ending);
      const Status written = write_stack(stack, info, voxels);
      ASSERT_TRUE(written) << written.error().what;
      VolumeInfo got;
      const auto back = read_stack(stack, &got);
      ASSERT_TRUE(back) << back.error().what;
      EXPECT_EQ(got.dims, dims);
      EXPECT_EQ(got.format, c.format);
      if (!is_color(c.format)) {
        EXPECT_EQ(got.sample_type, c.type);
      }
      EXPECT_EQ(*back, voxels);
    }
}

TEST_F(ImageStack, WhatAnEndingCannotHoldIsRefusedBeforehand) {
  const auto refused = [&](const char* stack, const VolumeInfo& info) {
    const auto sink = create_image_stack(path(stack), info, false, ctx_);
    ASSERT_FALSE(sink) << stack;
    EXPECT_EQ(sink.error().code, ErrorCode::usage) << sink.error().what;
    EXPECT_EQ(files(), 0);
  };
  refused("a%d.png", make_info({2, 2, 2}, VoxelFormat::float32, SampleType::f32));
  refused("a%d.png", make_info({2, 2, 2}, VoxelFormat::density16, SampleType::i16));
  refused("a%d.exr", make_info({2, 2, 2}, VoxelFormat::density8));
  refused("a%d.exr", make_info({2, 2, 2}, VoxelFormat::rgba32));
  refused("a%d.jpg", make_info({2, 2, 2}, VoxelFormat::density8));
  for (const char* wrong :
       {"a.png", "a%s.png", "a%d%d.png", "a%04x.png", "a%0d.png", "a%999d.png", "a%.png", "a%4d.png"})
    refused(wrong, make_info({2, 2, 2}, VoxelFormat::density8));
}

TEST_F(ImageStack, SameVolumeGivesSameBytesAtAnyTime) {
  const VolumeInfo u8 = make_info({20, 10, 3}, VoxelFormat::density8);
  const VolumeInfo f32 = make_info({20, 10, 3}, VoxelFormat::float32, SampleType::f32);
  const Bytes small = random_voxels(u8), large = random_voxels(f32);
  for (const char* when : {"early", "late"}) {
    ASSERT_TRUE(write_stack(std::string(when) + "%d.png", u8, small));
    ASSERT_TRUE(write_stack(std::string(when) + "%d.tif", u8, small));
    ASSERT_TRUE(write_stack(std::string(when) + "%d.exr", f32, large));
    if (std::string(when) == "early") std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  }
  for (const char* name : {"0.png", "1.png", "0.tif", "2.tif", "0.exr", "1.exr"})
    EXPECT_EQ(get(path(std::string("early") + name)), get(path(std::string("late") + name))) << name;
}

TEST_F(ImageStack, SlicesAreNumberedOrInNaturalOrder) {
  for (int i = 8; i <= 11; ++i) put_tiff(fmt::format("a{}.tif", i), 2, 1, {char('a' + i), 'z'});
  put("a08.tif", "not of the pattern");
  put("b.txt", "no image");
  auto voxels = read_stack("a%d.tif");
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(text_of(*voxels), "izjzkzlz");
  std::filesystem::remove(path("a08.tif"));
  VolumeInfo info;
  voxels = read_stack("", &info);  // the folder
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info.dims, Index3(2, 1, 4));
  EXPECT_EQ(text_of(*voxels), "izjzkzlz");

  std::filesystem::remove(path("a10.tif"));
  expect_refused("a%d.tif", ErrorCode::input, "a10.tif: slice is missing");
  expect_refused("c%d.tif", ErrorCode::input, "no file has a name of this pattern");
  expect_refused("missing/a%d.tif", ErrorCode::input, "cannot read the folder");
  put("x.png", "");
  expect_refused("", ErrorCode::input, "images of several kinds");
}

TEST_F(ImageStack, PagesOfOneFileAreSlices) {
  Tiff tiff{.width = 3, .height = 2};
  std::string all;
  for (int page = 0; page < 20; ++page) {
    std::string pixels;
    for (int i = 0; i < 6; ++i) pixels += static_cast<char>(page * 7 + i);
    tiff.pages.push_back(pixels);
    all += pixels;
  }
  put("pages.tif", tiff.bytes());
  VolumeInfo info;
  const auto voxels = read_stack("pages.tif", &info);
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info.dims, Index3(3, 2, 20));
  EXPECT_EQ(text_of(*voxels), all);
  const std::string valid = tiff.bytes();
  for (size_t length = valid.size() - 400; length < valid.size() - 4; length += 3) {
    put("cut.tif", valid.substr(0, length));
    EXPECT_FALSE(read_stack("cut.tif")) << "accepted a file cut to " << length << " of " << valid.size();
  }
}

TEST_F(ImageStack, PixelsKeepTheirValues) {
  // Colours under zero alpha too: nothing is multiplied by alpha.
  put("rgba.tif",
      Tiff{.width = 2, .height = 1, .samples = 4, .pages = {std::string("\1\2\3\0\377\200\100\1", 8)}}
          .bytes());
  VolumeInfo info;
  auto voxels = read_stack("rgba.tif", &info);
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info.format, VoxelFormat::rgba32);
  EXPECT_EQ(text_of(*voxels), std::string("\1\2\3\0\377\200\100\1", 8));

  put("i16.tif", Tiff{.width = 2,
                      .height = 1,
                      .bits = 16,
                      .sample_format = 2,
                      .pages = {std::string("\0\200\377\177", 4)}}
                     .bytes());
  voxels = read_stack("i16.tif", &info);
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info.sample_type, SampleType::i16);
  EXPECT_EQ(text_of(*voxels), std::string("\0\0\377\377", 4));  // -32768 and 32767, with the bias
}

TEST_F(ImageStack, OtherPixelsAreRefused) {
  put("two.tif", Tiff{.width = 1, .height = 1, .samples = 2, .pages = {"ab"}}.bytes());
  expect_refused("two.tif", ErrorCode::input,
                 "2 channels of u8: expected 1 channel, or 3 or 4 of 8 bits, or --channel N");
  put("deep.tif", Tiff{.width = 1, .height = 1, .samples = 3, .bits = 16, .pages = {"abcdef"}}.bytes());
  expect_refused("deep.tif", ErrorCode::input, "3 channels of u16");
}

TEST_F(ImageStack, SlicesMustBeAlike) {
  put_tiff("a0.tif", 2, 1, "ab");
  put_tiff("a1.tif", 1, 2, "cd");
  expect_refused("a%d.tif", ErrorCode::input, "a1.tif: slice is 1 x 2");
  put_tiff("a2.tif", 2, 1, "ef");  // seen only when slice 1 is read
  expect_refused("a%d.tif", ErrorCode::input, "a1.tif: slice is 1 x 2");
  put("a1.tif", Tiff{.width = 2, .height = 1, .bits = 16, .pages = {"abcd"}}.bytes());
  expect_refused("a%d.tif", ErrorCode::input, "u16: expected 2 x 1 with 1 channel of u8");
}

TEST_F(ImageStack, BoxesFromManyThreadsAreThoseOfTheWhole) {
  const VolumeInfo info = make_info({61, 150, 40}, VoxelFormat::density16, SampleType::u16);
  const Bytes voxels = random_voxels(info);
  ASSERT_TRUE(write_stack("a%d.tif", info, voxels));
  // With room for all slices, for a few, and for none.
  for (const uint64_t limit : {uint64_t{100} << 20, uint64_t{800000}, uint64_t{50000}}) {
    MemoryBudget memory(limit);
    ctx_.memory = &memory;
    {
      auto source = open_image_stack(path("a%d.tif"), {}, ctx_);
      ASSERT_TRUE(source) << source.error().what;
      std::array<int, 4> wrong{};
      std::vector<std::thread> threads;
      for (unsigned t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
          std::mt19937 random(t);
          for (int i = 0; i < 20; ++i) {
            Box box;
            for (int a = 0; a < 3; ++a) {
              box.lo[a] = random() % info.dims[a];
              box.hi[a] = box.lo[a] + 1 + random() % std::min<int64_t>(info.dims[a] - box.lo[a], 30);
            }
            Bytes part(static_cast<size_t>(box.voxels() * 2));
            wrong[t] += !(*source)->read(box, packed(part.data(), box.size(), info.format));
            size_t n = 0;
            for (int64_t z = box.lo.z; z < box.hi.z; ++z)
              for (int64_t y = box.lo.y; y < box.hi.y; ++y)
                for (int64_t x = box.lo.x; x < box.hi.x; ++x, n += 2)
                  wrong[t] +=
                      std::memcmp(&part[n], &voxels[static_cast<size_t>((z * 150 + y) * 61 + x) * 2], 2) != 0;
          }
        });
      for (std::thread& thread : threads) thread.join();
      EXPECT_EQ(wrong, (std::array<int, 4>{})) << limit;
    }
    EXPECT_TRUE(memory.reserve(limit, "everything given back"));
  }
}

TEST_F(ImageStack, OutputAppearsWholeOrNotAtAll) {
  const VolumeInfo info = make_info({4, 4, 3}, VoxelFormat::density8);
  const Bytes old = random_voxels(info), fresh = random_voxels(info);
  {
    auto sink = create_image_stack(path("a%d.png"), info, false, ctx_);
    ASSERT_TRUE(sink);
    ASSERT_TRUE((*sink)->write(0, 2, packed(old.data(), {4, 4, 2}, info.format)));
    EXPECT_FALSE((*sink)->finish());  // a slice is missing
  }
  EXPECT_EQ(files(), 0);

  ASSERT_TRUE(write_stack("a%d.png", info, old));
  EXPECT_EQ(files(), 3);
  const Status again = write_stack("a%d.png", info, fresh);
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, ErrorCode::output);
  EXPECT_EQ(*read_stack("a%d.png"), old);
  {
    auto sink = create_image_stack(path("a%d.png"), info, true, ctx_);
    ASSERT_TRUE(sink);
    ASSERT_TRUE((*sink)->write(0, 3, packed(fresh.data(), info.dims, info.format)));
    EXPECT_EQ(*read_stack("a%d.png"), old);
  }
  EXPECT_EQ(*read_stack("a%d.png"), old);
  ASSERT_TRUE(write_stack("a%d.png", info, fresh, true));
  EXPECT_EQ(*read_stack("a%d.png"), fresh);
  EXPECT_EQ(files(), 3);

  // When a slice cannot get its name, the others get their old ones back.
  {
    auto sink = create_image_stack(path("a%d.png"), info, true, ctx_);
    ASSERT_TRUE(sink);
    ASSERT_TRUE((*sink)->write(0, 3, packed(old.data(), info.dims, info.format)));
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      if (entry.is_directory()) std::filesystem::remove(entry.path() / "a2.png");
    EXPECT_FALSE((*sink)->finish());
  }
  EXPECT_EQ(*read_stack("a%d.png"), fresh);

  // A shorter stack over a longer one would be read as a mixture.
  const VolumeInfo shorter = make_info({4, 4, 2}, VoxelFormat::density8);
  const auto sink = create_image_stack(path("a%d.png"), shorter, true, ctx_);
  ASSERT_FALSE(sink);
  EXPECT_EQ(sink.error().code, ErrorCode::output);
  EXPECT_NE(sink.error().file.find("a2.png"), std::string::npos);
}

TEST_F(ImageStack, SizesThatAFileCannotHoldAreRefused) {
  put_tiff("wide.tif", 65535, 65535, "a few bytes");
  expect_refused("wide.tif", ErrorCode::input, "cannot hold that");
  MemoryBudget little(1 << 20);
  ctx_.memory = &little;
  put_tiff("large.tif", 1000, 1000, std::string(1000000, 'a'));
  expect_refused("large.tif", ErrorCode::limit, "more than half of --max-memory");
}

TEST_F(ImageStack, DamagedFilesAreRefused) {
  const VolumeInfo info = make_info({5, 4, 1}, VoxelFormat::density8);
  const Bytes voxels = random_voxels(info);
  for (const char* kind : {"png", "tif"}) {
    ASSERT_TRUE(write_stack(std::string("a%d.") + kind, info, voxels));
    const std::string valid = get(path(std::string("a0.") + kind));
    const std::string name = std::string("cut.") + kind;
    for (size_t length = 0; length < valid.size(); ++length) {
      put(name, valid.substr(0, length));
      const auto read = read_stack(name);
      if (read) {
        EXPECT_EQ(*read, voxels) << "wrong voxels from a file cut to " << length << " of " << valid.size();
      } else {
        ASSERT_EQ(read.error().code, ErrorCode::input) << read.error().what;
        ASSERT_EQ(read.error().what.find('\n'), std::string::npos) << read.error().what;
      }
    }
    for (int i = 0; i < 500; ++i) {
      std::string changed = valid;
      for (auto n = 1 + random_() % 3; n > 0; --n)
        changed[random_() % changed.size()] = static_cast<char>(random_());
      put(name, changed);
      const auto source = open_image_stack(path(name), {}, ctx_);
      if (source && (*source)->info().box().voxels() > 1000000) continue;
      const auto read = read_stack(name);
      ASSERT_TRUE(read || read.error().code == ErrorCode::input) << read.error().what;
    }
  }
}

}  // namespace
}  // namespace voxkit
