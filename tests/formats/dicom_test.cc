#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <thread>

#include "formats/module.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

/// A DICOM slice by hand: explicit VR, little endian.
struct Slice {
  uint16_t columns = 2, rows = 2, bits = 16, stored = 16, sign = 0, samples = 1;
  std::string series = "1.2.3", photometric = "MONOCHROME2", instance = "1";
  std::string position = {}, orientation = {}, spacing = {}, slope = {}, intercept = {}, frames = {};
  std::string transfer_syntax = "1.2.840.10008.1.2.1";
  std::string pixels = std::string(8, 'p');
  bool encapsulated = false;

  std::string bytes() const {
    std::string meta;
    text(meta, 2, 0x10, "UI", transfer_syntax);
    std::string file(128, '\0');
    file += "DICM";
    put16(file, 2), put16(file, 0), file += "UL", put16(file, 4),
        put32(file, static_cast<uint32_t>(meta.size()));
    file += meta;
    text(file, 0x20, 0x0e, "UI", series);
    text(file, 0x20, 0x13, "IS", instance);
    text(file, 0x20, 0x32, "DS", position);
    text(file, 0x20, 0x37, "DS", orientation);
    number(file, 0x28, 0x02, samples);
    text(file, 0x28, 0x04, "CS", photometric);
    text(file, 0x28, 0x08, "IS", frames);
    number(file, 0x28, 0x10, rows);
    number(file, 0x28, 0x11, columns);
    text(file, 0x28, 0x30, "DS", spacing);
    number(file, 0x28, 0x100, bits);
    number(file, 0x28, 0x101, stored);
    number(file, 0x28, 0x102, static_cast<uint16_t>(stored - 1));
    number(file, 0x28, 0x103, sign);
    text(file, 0x28, 0x1052, "DS", intercept);
    text(file, 0x28, 0x1053, "DS", slope);
    put16(file, 0x7fe0), put16(file, 0x10), file += bits == 8 ? "OB" : "OW", put16(file, 0);
    if (!encapsulated) {
      put32(file, static_cast<uint32_t>(pixels.size())), file += pixels;
    } else {
      put32(file, 0xffffffff);
      put16(file, 0xfffe), put16(file, 0xe000), put32(file, 0);  // empty table of offsets
      put16(file, 0xfffe), put16(file, 0xe000), put32(file, static_cast<uint32_t>(pixels.size())),
          file += pixels;
      put16(file, 0xfffe), put16(file, 0xe0dd), put32(file, 0);
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
  static void text(std::string& file, uint16_t group, uint16_t element, const char* type, std::string value) {
    if (value.empty()) return;
    if (value.size() % 2) value += type == std::string("UI") ? '\0' : ' ';
    put16(file, group), put16(file, element), file += type;
    put16(file, static_cast<uint32_t>(value.size())), file += value;
  }
  static void number(std::string& file, uint16_t group, uint16_t element, uint16_t value) {
    put16(file, group), put16(file, element), file += "US", put16(file, 2), put16(file, value);
  }
};

class Dicom : public FileFormatTest {
 protected:
  void SetUp() override {
    FileFormatTest::SetUp();
    if (!std::filesystem::exists(module_folder() + "/dicom.so")) GTEST_SKIP() << "built without GDCM";
  }
  Result<Bytes> read_folder(VolumeInfo* info = nullptr) {
    VOX_TRY(const auto source, open_dicom(folder_, {}, ctx_));
    if (info) *info = source->info();
    return read(*source);
  }
  void expect_refused(const std::string& part, ErrorCode code = ErrorCode::input) {
    const auto voxels = read_folder();
    ASSERT_FALSE(voxels) << "accepted; expected an error with: " << part;
    EXPECT_EQ(voxels.error().code, code) << voxels.error().what;
    const std::string line = voxels.error().file + ": " + voxels.error().what;
    EXPECT_NE(line.find(part), std::string::npos) << line;
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
  }
  static std::vector<int> words(const Bytes& bytes) {
    std::vector<int> values;
    for (size_t i = 0; i + 1 < bytes.size(); i += 2)
      values.push_back(static_cast<int>(bytes[i]) | static_cast<int>(bytes[i + 1]) << 8);
    return values;
  }
};

TEST_F(Dicom, SlicesAreOrderedByPositionAlongTheirNormal) {
  // Sagittal slices, from x = 7 down in the order of their names; the normal of these directions is +x.
  for (int i = 0; i < 4; ++i)
    put(fmt::format("{}.dcm", i), Slice{.instance = std::to_string(10 + i),
                                        .position = fmt::format("{}\\5\\-6.5", 7 - 2 * i),
                                        .orientation = "0\\1\\0\\0\\0\\1",
                                        .spacing = "0.5 \\0.25",
                                        .slope = "2",
                                        .intercept = "-1024.5",
                                        .pixels = std::string(8, static_cast<char>('0' + i))}
                                      .bytes());
  put("README", "no slice");
  VolumeInfo info;
  const auto voxels = read_folder(&info);
  ASSERT_TRUE(voxels) << voxels.error().file << voxels.error().what;
  EXPECT_EQ(info.dims, Index3(2, 2, 4));
  EXPECT_EQ(info.format, VoxelFormat::density16);
  EXPECT_EQ(info.sample_type, SampleType::u16);
  EXPECT_EQ(info.affine.spacing(), (std::array<double, 3>{0.25, 0.5, 2}));
  EXPECT_EQ(info.affine.origin, (std::array<double, 3>{1, 5, -6.5}));
  EXPECT_EQ(info.slope, 2);
  EXPECT_EQ(info.intercept, -1024.5);
  const std::string text(reinterpret_cast<const char*>(voxels->data()), voxels->size());
  EXPECT_EQ(text, "33333333222222221111111100000000");
}

TEST_F(Dicom, WithoutPositionsTheInstanceNumberOrTheNameOrders) {
  for (int i = 8; i < 12; ++i)
    put(fmt::format("s{}", i),
        Slice{.instance = std::to_string(20 - i), .pixels = std::string(8, static_cast<char>('a' + i))}
            .bytes());
  auto voxels = read_folder();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ((*voxels)[0], std::byte{'a' + 11});
  EXPECT_EQ(voxels->back(), std::byte{'a' + 8});
  put("s10", Slice{.instance = "", .pixels = std::string(8, 'a' + 10)}.bytes());
  voxels = read_folder();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ((*voxels)[0], std::byte{'a' + 8});
  EXPECT_EQ((*voxels)[8], std::byte{'a' + 9});
  EXPECT_EQ((*voxels)[16], std::byte{'a' + 10});
}

TEST_F(Dicom, SignedAndUnusedBits) {
  // 12 bits with an overlay in the others: 5, -1, -2048, 2047.
  const std::string pixels("\x05\xf0\xff\x0f\x00\x48\xff\x37", 8);
  put("a", Slice{.stored = 12, .sign = 1, .pixels = pixels}.bytes());
  VolumeInfo info;
  auto voxels = read_folder(&info);
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info.sample_type, SampleType::i16);
  EXPECT_EQ(words(*voxels), (std::vector<int>{32768 + 5, 32768 - 1, 32768 - 2048, 32768 + 2047}));
  put("a", Slice{.stored = 12, .pixels = pixels}.bytes());
  voxels = read_folder(&info);
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(words(*voxels), (std::vector<int>{5, 4095, 2048, 2047}));
  put("a",
      Slice{.bits = 8, .stored = 8, .sign = 1, .photometric = "MONOCHROME1", .pixels = "\x01\x7f\x80\xff"}
          .bytes());
  voxels = read_folder(&info);
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info.sample_type, SampleType::i8);
  EXPECT_EQ(*voxels, (Bytes{std::byte{129}, std::byte{255}, std::byte{0}, std::byte{127}}));
}

/// RLE of 8 bits: a header of 64 bytes (one segment, at 64), then "three times 7, and 9".
Slice run_length_slice() {
  std::string rle(64, '\0');
  rle[0] = 1;
  rle[4] = 64;
  rle += std::string("\xfe\x07\x00\x09", 4);
  return Slice{
      .bits = 8, .stored = 8, .transfer_syntax = "1.2.840.10008.1.2.5", .pixels = rle, .encapsulated = true};
}

TEST_F(Dicom, CompressedSlicesAreDecoded) {
  put("a", run_length_slice().bytes());
  const auto voxels = read_folder();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(*voxels, (Bytes{std::byte{7}, std::byte{7}, std::byte{7}, std::byte{9}}));
}

TEST_F(Dicom, RunLengthsOfWords) {
  // Two segments: high bytes (1 1 1 2), then low bytes (three literals, a byte without meaning, a run that is
  // too long).
  std::string rle(64, '\0');
  rle[0] = 2;
  rle[4] = 64;
  rle[8] = 68;
  rle += std::string(
      "\xfe\x01\x00\x02"
      "\x02\x0a\x0b\x0c\x80\xf0\x0d",
      11);
  Slice slice{.transfer_syntax = "1.2.840.10008.1.2.5", .pixels = rle, .encapsulated = true};
  put("a", slice.bytes());
  const auto voxels = read_folder();
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(words(*voxels), (std::vector<int>{0x10a, 0x10b, 0x10c, 0x20d}));
  slice.pixels.resize(slice.pixels.size() - 3);
  put("a", slice.bytes());
  expect_refused("run-length code ends early");
}

TEST_F(Dicom, BothByteOrdersAndBothEncodings) {
  const std::string valid = Slice{.pixels = std::string("\1\2\3\4\5\6\7\10", 8)}.bytes();
  put("a", valid);
  const auto expected = read_folder();
  ASSERT_TRUE(expected) << expected.error().what;
  // The same elements after the meta group, without types or in big-endian order.
  const std::string meta = valid.substr(0, 144 + 28), data = valid.substr(144 + 28);
  for (const bool implicit : {true, false}) {
    std::string file = meta;
    const size_t syntax = file.find("1.2.840.10008.1.2.1");
    file.replace(
        syntax, 20,
        implicit ? std::string("1.2.840.10008.1.2\0\0\0", 20) : std::string("1.2.840.10008.1.2.2\0", 20));
    const auto put_number = [&](const std::string& little, size_t bytes) {
      std::string raw = little;
      raw.resize(bytes, '\0');
      if (!implicit) std::reverse(raw.begin(), raw.end());
      file += raw;
    };
    for (size_t at = 0; at < data.size();) {
      put_number(data.substr(at, 2), 2), put_number(data.substr(at + 2, 2), 2);
      const std::string type = data.substr(at + 4, 2);
      const bool wide = type == "OW";
      const std::string length = data.substr(at + (wide ? 8 : 6), wide ? 4 : 2);
      if (!implicit) file += type;
      if (!implicit && wide) file += std::string(2, '\0');
      put_number(length, implicit || wide ? 4 : 2);
      const size_t count = static_cast<unsigned char>(length[0]);
      at += wide ? 12 : 8;
      for (size_t i = 0; i < count; i += 2)
        type == "US" || type == "OW" ? put_number(data.substr(at + i, 2), 2)
                                     : void(file += data.substr(at + i, 2));
      at += count;
    }
    put("a", file);
    const auto voxels = read_folder();
    ASSERT_TRUE(voxels) << voxels.error().what;
    EXPECT_EQ(*voxels, *expected) << (implicit ? "implicit" : "big endian");
  }
}

TEST_F(Dicom, MixedAndUnsupportedSlicesAreRefused) {
  expect_refused("no DICOM images in this folder");
  put("a", Slice{}.bytes());
  put("b", Slice{.series = "1.2.4"}.bytes());
  expect_refused(
      "slices of 2 series: expected --series N or ID with one of 0: 1.2.3 (1 slices), 1: 1.2.4 (1 slices)");
  const auto refused = [&](const Slice& b, const char* part) {
    put("b", b.bytes());
    expect_refused(part);
  };
  refused(Slice{.columns = 4, .rows = 1, .instance = "2"}, "size of the image differs");
  refused(Slice{.stored = 12, .instance = "2"}, "pixel type differs");
  refused(Slice{.instance = "2", .slope = "3"}, "rescale slope and intercept, 3 and 0, differ");
  refused(Slice{.instance = "2", .orientation = "1\\0\\0\\0\\1\\0"}, "orientation differs");
  std::filesystem::remove(path("a"));
  refused(Slice{.photometric = "RGB"}, "photometric interpretation RGB");
  refused(Slice{.frames = "4"}, "file of 4 frames");
  refused(Slice{.bits = 24, .stored = 24}, "expected 1, 8, 16 or 32");
  refused(Slice{.columns = 65535, .rows = 65535}, "cannot hold them");
  refused(Slice{.columns = 0}, "image without pixels");
  const Slice placed{.position = "1\\2\\3", .orientation = "1\\0\\0\\0\\1\\0"};
  put("a", placed.bytes());
  refused(placed, "lies where");
}

TEST_F(Dicom, BoxesFromManyThreadsAreThoseOfTheWhole) {
  const VolumeInfo info = make_info({40, 30, 25}, VoxelFormat::density16, SampleType::u16);
  const Bytes voxels = random_voxels(info);
  const size_t slice = 40 * 30 * 2;
  for (size_t z = 0; z < 25; ++z)
    put(fmt::format("{}", z),
        Slice{.columns = 40,
              .rows = 30,
              .instance = std::to_string(z),
              .pixels = std::string(reinterpret_cast<const char*>(voxels.data()) + z * slice, slice)}
            .bytes());
  for (const uint64_t limit :
       {uint64_t{100} << 20, uint64_t{60000}, uint64_t{10000}}) {  // all, few or no slices kept
    MemoryBudget memory(limit);
    ctx_.memory = &memory;
    auto source = open_dicom(folder_, {}, ctx_);
    ASSERT_TRUE(source) << source.error().what;
    std::array<int, 4> wrong{};
    std::vector<std::thread> threads;
    for (unsigned t = 0; t < 4; ++t)
      threads.emplace_back([&, t] {
        std::mt19937 random(t);
        for (int i = 0; i < 10; ++i) {
          Box box;
          for (int a = 0; a < 3; ++a) {
            box.lo[a] = random() % info.dims[a];
            box.hi[a] = box.lo[a] + 1 + random() % (info.dims[a] - box.lo[a]);
          }
          Bytes part(static_cast<size_t>(box.voxels() * 2));
          wrong[t] += !(*source)->read(box, packed(part.data(), box.size(), info.format));
          size_t n = 0;
          for (int64_t z = box.lo.z; z < box.hi.z; ++z)
            for (int64_t y = box.lo.y; y < box.hi.y; ++y)
              for (int64_t x = box.lo.x; x < box.hi.x; ++x, n += 2)
                wrong[t] +=
                    std::memcmp(&part[n], &voxels[static_cast<size_t>((z * 30 + y) * 40 + x) * 2], 2) != 0;
        }
      });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, (std::array<int, 4>{})) << limit;
  }
}

TEST_F(Dicom, DamagedFilesAreRefused) {
  const Slice plain{.columns = 4,
                    .rows = 3,
                    .position = "1\\2\\3",
                    .orientation = "1\\0\\0\\0\\1\\0",
                    .spacing = "1\\1",
                    .pixels = std::string(24, 'x')};
  for (const std::string& valid : {plain.bytes(), run_length_slice().bytes()}) {
    for (size_t length = 0; length < valid.size(); ++length) {
      put("a", valid.substr(0, length));
      const auto voxels = read_folder();
      ASSERT_FALSE(voxels) << "accepted a file cut to " << length << " of " << valid.size();
      ASSERT_EQ(voxels.error().code, ErrorCode::input) << voxels.error().what;
    }
    for (int i = 0; i < 2000; ++i) {
      std::string changed = valid;
      for (auto n = 1 + random_() % 3; n > 0; --n)
        changed[128 + random_() % (changed.size() - 128)] = static_cast<char>(random_());
      put("a", changed);
      const auto voxels = read_folder();
      ASSERT_TRUE(voxels || voxels.error().code == ErrorCode::input) << voxels.error().what;
    }
  }
}

}  // namespace
}  // namespace voxkit
