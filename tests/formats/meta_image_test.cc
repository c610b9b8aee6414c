#include "formats/volume/volume_formats.h"
#include "tests/formats/file_format_test.h"
#include "tests/formats/packing_test.h"

namespace voxkit {
namespace {

class MetaImageTest : public FileFormatTest {
 protected:
  /// A header of a volume of `sides`, then the line of its data.
  static std::string header(const std::string& sides, const std::string& type, const std::string& more = "",
                            const std::string& data = "LOCAL") {
    const auto axes = 1 + std::count(sides.begin(), sides.end(), ' ');
    return "ObjectType = Image\nNDims = " + std::to_string(axes) + "\nDimSize = " + sides +
           "\nElementType = " + type + "\n" + more + "ElementDataFile = " + data + "\n";
  }
  void expect_voxels(const std::string& content, const std::string& expected,
                     const OpenOptions& options = {}) {
    FileFormatTest::expect_voxels(open_volume(put("v.mha", content), options, ctx_), expected);
  }
  void refused(const std::string& content, const std::string& part) {
    expect_error(put("v.mha", content), part);
  }
};

TEST_F(MetaImageTest, RoundTrips) {
  for (const char* name : {"v.mha", "v.mhd"}) {
    VolumeInfo info = make_info({5, 3, 4}, VoxelFormat::density8, SampleType::i8);
    info.affine = Affine::plain({0.5, 0.25, 3}, {1, -2, 3.125});
    info.world = World::lps;
    info.unit = Unit::millimetre;
    info.slope = 0.1, info.intercept = -1000;
    info.description = "a scan";
    round_trip(name, info);
    EXPECT_EQ(read_info_.affine, info.affine);
    EXPECT_EQ(read_info_.world, World::lps);
    EXPECT_EQ(read_info_.unit, Unit::millimetre);
    EXPECT_EQ(read_info_.description, "a scan");
    EXPECT_EQ(read_info_.sample_type, SampleType::i8);
    for (const SampleType type : {SampleType::u16, SampleType::i16})
      round_trip(name, make_info({5, 3, 4}, VoxelFormat::density16, type));
    round_trip(name, make_info({1, 1, 1}, VoxelFormat::float32, SampleType::f32));
    EXPECT_EQ(read_info_.world, World::unknown);
    EXPECT_EQ(read_info_.unit, Unit::unknown);
    round_trip(name, make_info({2, 3, 4}, VoxelFormat::rgb24));
    round_trip(name, make_info({2, 3, 4}, VoxelFormat::rgba32));
  }
  EXPECT_TRUE(std::filesystem::exists(path("v.raw")));
}

TEST_F(MetaImageTest, WhatIsWritten) {
  VolumeInfo info = make_info({2, 1, 1}, VoxelFormat::density16, SampleType::i16);
  info.affine.axes = {{{0, 2, 0}, {-1, 0, 0}, {0, 0, 3}}};
  info.affine.origin = {10, 20, 30};
  info.world = World::ras;
  info.unit = Unit::metre;
  auto sink = create_volume(path("v.mha"), info, false, ctx_);
  ASSERT_TRUE(sink);
  const auto voxels = sample_text<uint16_t>({32768, 32769}, false);
  ASSERT_TRUE((*sink)->write(
      0, 1, packed(reinterpret_cast<const std::byte*>(voxels.data()), info.dims, info.format)));
  ASSERT_TRUE((*sink)->finish());
  // To the left and to the back are negative in RAS.
  EXPECT_EQ(get(path("v.mha")),
            "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
            "CompressedData = False\nTransformMatrix = 0 -1 0 1 0 0 0 0 1\nOffset = -10000 -20000 30000\n"
            "CenterOfRotation = 0 0 0\nAnatomicalOrientation = PRI\nElementSpacing = 2000 1000 3000\n"
            "DistanceUnits = mm\nDimSize = 2 1 1\nElementType = MET_SHORT\nElementDataFile = LOCAL\n" +
                sample_text<int16_t>({0, 1}, false));
}

TEST_F(MetaImageTest, EveryTypeInBothOrders) {
  for (const bool big : {false, true})
    for (const char* order : {"BinaryDataByteOrderMSB", "ElementByteOrderMSB"}) {
      const auto file = [&](const std::string& type, const std::string& data) {
        return header("2 1 1", type, std::string(order) + (big ? " = True\n" : " = False\n")) + data;
      };
      expect_voxels(file("MET_SHORT", sample_text<int16_t>({-3, 1000}, big)),
                    sample_text<uint16_t>({32765, 33768}, false));
      expect_voxels(file("MET_USHORT", sample_text<uint16_t>({3, 1000}, big)),
                    sample_text<uint16_t>({3, 1000}, false));
      expect_voxels(file("MET_FLOAT", sample_text<float>({-3.5, 1e9f}, big)),
                    sample_text<float>({-3.5, 1e9f}, false));
      expect_voxels(file("MET_DOUBLE", sample_text<double>({-3.5, 0.1}, big)),
                    sample_text<float>({-3.5, 0.1f}, false));
      for (const char* type : {"MET_INT", "MET_LONG"})
        expect_voxels(file(type, sample_text<int32_t>({-70000, -69999}, big)), std::string("\0\1", 2));
      for (const char* type : {"MET_UINT", "MET_ULONG"})
        expect_voxels(file(type, sample_text<uint32_t>({~0u - 1, ~0u}, big)), std::string("\0\1", 2));
      expect_voxels(file("MET_LONG_LONG", sample_text<int64_t>({-5, -4}, big)), std::string("\0\1", 2));
      EXPECT_EQ(read_info_.sample(0), -5);
      expect_voxels(file("MET_ULONG_LONG", sample_text<uint64_t>({5, 6}, big)), std::string("\0\1", 2));
    }
  expect_voxels(header("2 1 1", "MET_UCHAR") + "\3\xff", "\3\xff");
  expect_voxels(header("2 1 1", "MET_CHAR") + "\xfd\x64", "\x7d\xe4");
}

TEST_F(MetaImageTest, CompressedAndText) {
  const std::string data = "abcdefghijkl";
  expect_voxels(
      header("2 3 2", "MET_UCHAR", "CompressedData = True\nCompressedDataSize = 20\n") + zlib_text(data),
      data);
  expect_voxels(header("2 3 2", "MET_UCHAR", "CompressedData = True\n") + gzip_text(data), data);
  expect_voxels(
      header("3 1 1", "MET_SHORT", "BinaryData = False\nBinaryDataByteOrderMSB = True\n") + "1 -2\n3",
      sample_text<uint16_t>({32769, 32766, 32771}, false));
  put("d.zraw", zlib_text(data));
  expect_voxels(header("2 3 2", "MET_UCHAR", "CompressedData = True\n", "d.zraw"), data);
  const std::string packed = zlib_text(data);
  refused(header("2 3 2", "MET_UCHAR", "CompressedData = True\n") + packed.substr(0, packed.size() - 1),
          "zlib data end");
  refused(header("2 3 3", "MET_UCHAR", "CompressedData = True\n") + packed,
          "voxel data end after 12 bytes: expected 18");
}

TEST_F(MetaImageTest, FilesOfData) {
  put("d.raw", "xxabcdef");
  for (const char* size : {"2", "-1"})
    expect_voxels(header("3 2 1", "MET_UCHAR", std::string("HeaderSize = ") + size + "\n", "d.raw"),
                  "abcdef");
  put("s1.raw", "abc"), put("s2.raw", "def"), put("s03.raw", "ghi"), put("s05.raw", "jkl");
  expect_voxels(header("3 1 2", "MET_UCHAR", "", "LIST\ns2.raw\ns1.raw"), "defabc");
  expect_voxels(header("3 1 2", "MET_UCHAR", "", "LIST 2D\ns2.raw\ns1.raw"), "defabc");
  expect_voxels(header("3 2 1", "MET_UCHAR", "", "LIST 1\ns2.raw\ns1.raw"), "defabc");
  expect_voxels(header("3 1 2", "MET_UCHAR", "", "s%d.raw"), "abcdef");
  expect_voxels(header("3 1 2", "MET_UCHAR", "", "s%02d.raw 3 5 2"), "ghijkl");
  EXPECT_EQ(read_info_.files.size(), 3u);
  refused(header("3 1 2", "MET_UCHAR", "", "LIST\ns1.raw"), "expected 2 files, not 1");
  refused(header("3 1 2", "MET_UCHAR", "", "s%02d.raw 3 9 2"), "expected 2 files, not 4");
  refused(header("4 1 2", "MET_UCHAR", "", "s%d.raw"), "voxel data end after 3 bytes: expected 4");
  refused(header("3 1 2", "MET_UCHAR", "", "../s1.raw"), "expected --allow-outside");
  refused(header("3 1 2", "MET_UCHAR", "", "none.raw"), "No such file");
}

TEST_F(MetaImageTest, Places) {
  const std::string data = "ab";
  // Row i of the matrix is the direction of axis i; coordinates are LPS unless the header says that it does
  // not know.
  expect_voxels(header("2 1 1", "MET_UCHAR",
                       "TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 1 2 3\nElementSpacing = 2 3 4\n"
                       "AnatomicalOrientation = RAI\nDistanceUnits = um\n") +
                    data,
                data);
  EXPECT_EQ(read_info_.affine.axes, (std::array<Affine::Vector, 3>{{{0, 2, 0}, {-3, 0, 0}, {0, 0, 4}}}));
  EXPECT_EQ(read_info_.affine.origin, (Affine::Vector{1, 2, 3}));
  EXPECT_EQ(read_info_.world, World::lps);
  EXPECT_EQ(read_info_.unit, Unit::micrometre);
  expect_voxels(
      header("2 1 1", "MET_UCHAR", "AnatomicalOrientation = ???\nPosition = 5 6 7\nElementSize = 1 2 3\n") +
          data,
      data);
  EXPECT_EQ(read_info_.affine, Affine::plain({1, 2, 3}, {5, 6, 7}));
  EXPECT_EQ(read_info_.world, World::unknown);
  expect_voxels(header("2 1", "MET_UCHAR", "ElementSpacing = 2 3\nOffset = 1 1\n") + data, data);
  EXPECT_EQ(read_info_.affine, Affine::plain({2, 3, 1}, {1, 1, 0}));
  EXPECT_TRUE(notes_.empty()) << all_notes();
  expect_voxels(header("2 1 1", "MET_UCHAR", "Modality = MET_MOD_CT\nKVP = 120\n") + data, data);
  EXPECT_TRUE(noted("2 fields (\"kvp\" ...): dropped")) << all_notes();
  refused(header("2 1 1", "MET_UCHAR", "ElementSpacing = 1 0 1\n") + data,
          "expected distances that are not zero");
  refused(header("2 1 1", "MET_UCHAR", "TransformMatrix = 1 0 0 1 0 0 0 0 1\n") + data, "lie in one plane");
  refused(header("2 1 1", "MET_UCHAR", "Offset = 1 nan 1\n") + data, "expected 3 numbers");
}

TEST_F(MetaImageTest, ColoursChannelsAndTimes) {
  expect_voxels(header("2 1 1", "MET_UCHAR", "ElementNumberOfChannels = 3\n") + "abcdef", "abcdef");
  EXPECT_EQ(read_info_.format, VoxelFormat::rgb24);
  OpenOptions options;
  options.channel = 1;
  expect_voxels(header("3 1 1", "MET_UCHAR", "ElementNumberOfChannels = 2\n") + "aAbBcC", "ABC", options);
  options.time = 1;
  expect_voxels(header("2 1 1 2", "MET_UCHAR", "ElementNumberOfChannels = 2\n") + "abcdABCD", "BD", options);
  refused(header("3 1 1", "MET_UCHAR", "ElementNumberOfChannels = 2\n") + "aAbBcC",
          "has 2 channels: expected --channel");
}

TEST_F(MetaImageTest, WhatIsNoMetaImageIsRefused) {
  refused("hello\n", "not a MetaImage: expected a line Name = value");
  refused("NDims = 3\n", "expected ElementDataFile as its last field");
  refused("ObjectType = Tube\n" + header("1 1 1", "MET_UCHAR").substr(19) + "a", "expected Image");
  refused(header("2 1 1", "MET_UCHAR") + "a", "end after 1 bytes: expected 2");
  refused(header("0 1 1", "MET_UCHAR"), "expected 3 whole numbers from 1 to 2^31");
  refused(header("2147483648 2147483648 2147483648", "MET_UCHAR"), "expected at most 2^62 bytes");
  refused(header("1 1 1", "MET_STRING"), "elementtype: \"MET_STRING\": expected MET_UCHAR");
  refused(header("1 1 1", "MET_UCHAR", "NDims = 3\n") + "a", "ndims comes twice");
  refused(header("1 1 1", "MET_UCHAR", "CompressedData = perhaps\n") + "a", "expected True or False");
}

TEST_F(MetaImageTest, Hostile) {
  hostile(
      "v.mha",
      header("2 3 2", "MET_UCHAR", "TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 1 2 3\n") + "abcdefghijkl",
      1000);
}

}  // namespace
}  // namespace voxkit
