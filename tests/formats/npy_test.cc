#include <cstring>

#include "formats/volume/volume_formats.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

/// A file as the format's description has it.
std::string npy(const std::string& type, bool fortran, const std::string& shape, const std::string& data,
                int version = 1) {
  std::string text = "{'descr': '" + type + "', 'fortran_order': " + (fortran ? "True" : "False") +
                     ", 'shape': (" + shape + "), }";
  const size_t length_bytes = version == 1 ? 2 : 4;
  while ((8 + length_bytes + text.size() + 1) % 64 != 0) text += ' ';
  text += '\n';
  std::string file = "\x93NUMPY";
  file += static_cast<char>(version);
  file += '\0';
  for (size_t i = 0; i < length_bytes; ++i) file += static_cast<char>(text.size() >> (8 * i) & 255);
  return file + text + data;
}

class NpyTest : public FileFormatTest {
 protected:
  void expect_voxels(const std::string& content, const std::string& expected,
                     const OpenOptions& options = {}) {
    // As a file, and as a pipe has it.
    for (const bool piped : {false, true}) {
      SCOPED_TRACE(piped);
      const std::string file = put("v.npy", content);
      FileFormatTest::expect_voxels(
          piped ? open_npy(std::move(*open_stream(file)), options, ctx_) : open_volume(file, options, ctx_),
          expected);
    }
  }
};

TEST_F(NpyTest, WhatIsWrittenIsWhatTheLibraryWrites) {
  VolumeInfo info = make_info({3, 1, 2}, VoxelFormat::density16, SampleType::i16);
  auto sink = create_volume(path("a.npy"), info, false, ctx_);
  ASSERT_TRUE(sink);
  const auto voxels = sample_text<uint16_t>({32768, 32769, 32770, 0, 65535, 32767}, false);
  ASSERT_TRUE((*sink)->write(
      0, 2, packed(reinterpret_cast<const std::byte*>(voxels.data()), info.dims, info.format)));
  ASSERT_TRUE((*sink)->finish());
  const std::string file = get(path("a.npy"));
  EXPECT_EQ(file, npy("<i2", false, "2, 1, 3", sample_text<int16_t>({0, 1, 2, -32768, 32767, -1}, false)));
  EXPECT_EQ(file.size(), 128u + 12);
}

TEST_F(NpyTest, RoundTrips) {
  const Index3 dims{5, 3, 4};
  for (const SampleType type : {SampleType::u8, SampleType::i8})
    round_trip("v.npy", make_info(dims, VoxelFormat::density8, type));
  for (const SampleType type : {SampleType::u16, SampleType::i16})
    round_trip("v.npy", make_info(dims, VoxelFormat::density16, type));
  round_trip("v.npy", make_info(dims, VoxelFormat::float32, SampleType::f32));
  round_trip("v.npy", make_info(dims, VoxelFormat::bitmap, SampleType::bit));
  EXPECT_EQ(read_info_.format, VoxelFormat::bitmap);
  round_trip("v.npy", make_info(dims, VoxelFormat::rgb24));
  round_trip("v.npy", make_info({1, 1, 1}, VoxelFormat::rgba32));
  EXPECT_EQ(read_info_.format, VoxelFormat::rgba32);
}

TEST_F(NpyTest, EveryTypeInBothOrdersAndVersions) {
  for (const bool big : {false, true})
    for (int version = 1; version <= 3; ++version) {
      const std::string order = big ? ">" : "<";
      const auto file = [&](const std::string& type, const std::string& data) {
        return npy(order + type, false, "2", data, version);
      };
      expect_voxels(file("i2", sample_text<int16_t>({-3, 1000}, big)),
                    sample_text<uint16_t>({32765, 33768}, false));
      expect_voxels(file("u2", sample_text<uint16_t>({3, 1000}, big)),
                    sample_text<uint16_t>({3, 1000}, false));
      expect_voxels(file("f2", sample_text<uint16_t>({0x3c00, 0xc100}, big)),
                    sample_text<float>({1, -2.5}, false));
      EXPECT_EQ(read_info_.sample_type, SampleType::f16);
      expect_voxels(file("f4", sample_text<float>({-3.5, 1e9f}, big)),
                    sample_text<float>({-3.5, 1e9f}, false));
      expect_voxels(file("f8", sample_text<double>({-3.5, 0.1}, big)),
                    sample_text<float>({-3.5, 0.1f}, false));
      expect_voxels(file("i4", sample_text<int32_t>({-70000, -69999}, big)), std::string("\0\1", 2));
      EXPECT_EQ(read_info_.sample(0), -70000);
      expect_voxels(file("u8", sample_text<uint64_t>({~uint64_t{0} - 1, ~uint64_t{0}}, big)),
                    std::string("\0\1", 2));
      expect_voxels(file("i8", sample_text<int64_t>({-5, -4}, big)), std::string("\0\1", 2));
      expect_voxels(file("u4", sample_text<uint32_t>({7, 8}, big)), std::string("\0\1", 2));
    }
  expect_voxels(npy("|u1", false, "2", "\3\xff"), "\3\xff");
  expect_voxels(npy("|i1", false, "2", "\xfd\x64"), "\x7d\xe4");
  expect_voxels(npy("|b1", false, "3", std::string("\1\0\1", 3)), std::string("\1\0\1", 3));
}

TEST_F(NpyTest, TheLastAxisIsXInBothOrdersOfMemory) {
  // a[z, y, x] = 100 z + 10 y + x
  std::string c, f;
  for (int z = 0; z < 2; ++z)
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 4; ++x) c += static_cast<char>(100 * z + 10 * y + x);
  for (int x = 0; x < 4; ++x)
    for (int y = 0; y < 3; ++y)
      for (int z = 0; z < 2; ++z) f += static_cast<char>(100 * z + 10 * y + x);
  expect_voxels(npy("|u1", false, "2, 3, 4", c), c);
  EXPECT_EQ(read_info_.dims, Index3(4, 3, 2));
  expect_voxels(npy("|u1", true, "2, 3, 4", f), c);
  EXPECT_EQ(read_info_.dims, Index3(4, 3, 2));
  // Fewer axes are the faster ones.
  expect_voxels(npy("|u1", false, "6, 4", c), c);
  EXPECT_EQ(read_info_.dims, Index3(4, 6, 1));
  expect_voxels(npy("|u1", true, "2, 2", "abcd"), "acbd");
  expect_voxels(npy("|u1", true, "24,", c), c);
  EXPECT_EQ(read_info_.dims, Index3(24, 1, 1));
}

TEST_F(NpyTest, ColoursChannelsAndTimes) {
  expect_voxels(npy("|u1", false, "1, 1, 2, 3", "abcdef"), "abcdef");
  EXPECT_EQ(read_info_.format, VoxelFormat::rgb24);
  expect_voxels(npy("|u1", true, "1, 1, 2, 4", "aAbBcCdD"), "abcdABCD");
  EXPECT_EQ(read_info_.format, VoxelFormat::rgba32);
  const std::string data = sample_text<uint16_t>({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}, false);
  OpenOptions options;
  options.time = 1, options.channel = 2;
  expect_voxels(npy("<u2", false, "2, 3, 1, 1, 2", data), data.substr(20, 4), options);
  // In Fortran's order time runs fastest.
  expect_voxels(npy("<u2", true, "2, 3, 1, 1, 2", data), data.substr(10, 2) + data.substr(22, 2), options);
  expect_error(put("v.npy", npy("<u2", false, "2, 3, 1, 1, 2", data)),
               "has 2 time steps and 3 channels: expected --time");
}

TEST_F(NpyTest, WhatIsNoArrayOfNumbersIsRefused) {
  const auto refused = [&](const std::string& content, const std::string& part) {
    expect_error(put("v.npy", content), part);
  };
  refused("hello world", "not a NumPy array: expected the magic \\x93NUMPY at byte 0");
  refused(npy("<f4", false, "2", std::string(7, 'x')),
          "voxel data at byte 128 end after 7 bytes: expected 8");
  refused(npy("<f4", false, "", std::string(4, 'x')), "shape (): expected 1 to 5 axes");
  refused(npy("<f4", false, "1, 1, 1, 1, 1, 1", "abcd"), "expected 1 to 5 axes");
  refused(npy("<f4", false, "2, 0", ""), "shape (2, 0): there are no voxels");
  refused(npy("<f4", false, "4611686018427387904, 4611686018427387904", ""), "expected at most 2^62 bytes");
  refused(npy("<f4", false, "-1", ""), "expected a side of the array");
  refused(npy("<c8", false, "1", std::string(8, 'x')), "elements of type \"<c8\": expected u1");
  refused(npy("|O", false, "1", ""), "elements of type \"|O\"");
  refused(npy("xf4", false, "1", "abcd"), "elements of type \"xf4\"");
  std::string records = npy("<f4", false, "1", "abcd");
  records.replace(records.find("'<f4'"), 5, "[('a'");
  refused(records, "has records of several fields: expected an array of numbers");
  std::string version = npy("<f4", false, "1", "abcd");
  version[6] = 4;
  refused(version, "NumPy format 4.0 is unsupported: expected 1.0 to 3.0");
  std::string longer = npy("<f4", false, "1", "abcd", 2);
  longer[10] = 0x7f;
  refused(longer, "NumPy header of 8323188 bytes: expected at most 1048576");
  std::string twice = npy("<f4", false, "1", "abcd");
  twice.replace(twice.find("'shape'"), 7, "'descr'");
  refused(twice, "expected descr, fortran_order and shape, once each");
}

TEST_F(NpyTest, WhatComesAfterTheArrayIsNamed) {
  expect_voxels(npy("|u1", false, "2", "abc"), "ab");
  EXPECT_TRUE(noted("v.npy: 1 bytes after the array are dropped")) << all_notes();
}

TEST_F(NpyTest, PlacesAreNamedAsDropped) {
  VolumeInfo info = make_info({2, 1, 1}, VoxelFormat::density8);
  info.affine.origin = {1, 2, 3};
  ASSERT_TRUE(create_volume(path("a.npy"), info, false, ctx_));
  EXPECT_TRUE(noted("NumPy")) << all_notes();
}

TEST_F(NpyTest, StreamsAreKnownByTheirFirstBytes) {
  const auto known = recognise(std::move(*open_stream(put("v", npy("|u1", false, "2", "ab")))));
  ASSERT_TRUE(known);
  EXPECT_EQ(known->format->name, "npy");
  const auto other = recognise(std::move(*open_stream(put("v", ""))));
  ASSERT_TRUE(other);
  EXPECT_EQ(other->format->name, "nrrd");
}

TEST_F(NpyTest, Hostile) {
  hostile("v.npy",
          npy("<i2", true, "2, 3, 2", sample_text<int16_t>({1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}, false)));
}

}  // namespace
}  // namespace voxkit
