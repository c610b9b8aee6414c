#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

class VtkTest : public FileFormatTest {
 protected:
  static std::string points(const std::string& coding, const std::string& dims, const std::string& rest) {
    return "# vtk DataFile Version 3.0\na title\n" + coding + "\nDATASET STRUCTURED_POINTS\nDIMENSIONS " +
           dims + "\nORIGIN 1 2 3\nSPACING 0.5 1 2\n" + rest;
  }
  void expect_voxels(const std::string& content, const std::string& expected,
                     const OpenOptions& options = {}) {
    FileFormatTest::expect_voxels(open_volume(put("v.vtk", content), options, ctx_), expected);
  }
  void refused(const std::string& content, const std::string& part) {
    expect_error(put("v.vtk", content), part);
  }
};

TEST_F(VtkTest, RoundTrips) {
  VolumeInfo info = make_info({5, 3, 4}, VoxelFormat::density8, SampleType::i8);
  info.affine = Affine::plain({0.5, 0.25, 3}, {1, -2, 3.125});
  info.description = "smoke";
  round_trip("v.vtk", info);
  EXPECT_EQ(read_info_.affine, info.affine);
  EXPECT_EQ(read_info_.description, "smoke");
  for (const SampleType type : {SampleType::u16, SampleType::i16})
    round_trip("v.vtk", make_info({50, 30, 40}, VoxelFormat::density16, type));
  round_trip("v.vtk", make_info({1, 1, 1}, VoxelFormat::float32, SampleType::f32));
  round_trip("v.vtk", make_info({2, 3, 4}, VoxelFormat::rgb24));
  round_trip("v.vtk", make_info({2, 3, 4}, VoxelFormat::rgba32));
}

TEST_F(VtkTest, WhatIsWritten) {
  VolumeInfo info = make_info({2, 1, 1}, VoxelFormat::density16, SampleType::i16);
  info.world = World::ras;
  auto sink = create_volume(path("v.vtk"), info, false, ctx_);
  ASSERT_TRUE(sink);
  const auto voxels = sample_text<uint16_t>({32769, 32766}, false);
  ASSERT_TRUE((*sink)->write(
      0, 1, packed(reinterpret_cast<const std::byte*>(voxels.data()), info.dims, info.format)));
  ASSERT_TRUE((*sink)->finish());
  EXPECT_EQ(get(path("v.vtk")),
            "# vtk DataFile Version 3.0\nvolume\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 1 1\nORIGIN "
            "0 0 0\n"
            "SPACING 1 1 1\nPOINT_DATA 2\nSCALARS voxels short 1\nLOOKUP_TABLE default\n" +
                std::string("\0\1\xff\xfe\n", 5));
  EXPECT_TRUE(noted("v.vtk: VTK")) << all_notes();
}

TEST_F(VtkTest, EveryTypeInBinary) {
  const auto file = [](const std::string& type, const std::string& data) {
    return points("BINARY", "2 1 1", "POINT_DATA 2\nSCALARS s " + type + "\nLOOKUP_TABLE default\n" + data);
  };
  expect_voxels(file("unsigned_char", "\3\xff"), "\3\xff");
  expect_voxels(file("char", "\xfd\x64"), "\x7d\xe4");
  expect_voxels(file("short", sample_text<int16_t>({-3, 1000}, true)),
                sample_text<uint16_t>({32765, 33768}, false));
  expect_voxels(file("unsigned_short", sample_text<uint16_t>({3, 1000}, true)),
                sample_text<uint16_t>({3, 1000}, false));
  expect_voxels(file("float", sample_text<float>({-3.5, 1e9f}, true)),
                sample_text<float>({-3.5, 1e9f}, false));
  expect_voxels(file("double", sample_text<double>({-3.5, 0.1}, true)),
                sample_text<float>({-3.5, 0.1f}, false));
  expect_voxels(file("int", sample_text<int32_t>({-70000, -69999}, true)), std::string("\0\1", 2));
  expect_voxels(file("unsigned_int", sample_text<uint32_t>({5, 6}, true)), std::string("\0\1", 2));
  for (const char* type : {"long", "vtktypeint64"})
    expect_voxels(file(type, sample_text<int64_t>({-5, -4}, true)), std::string("\0\1", 2));
  for (const char* type : {"unsigned_long", "vtktypeuint64"})
    expect_voxels(file(type, sample_text<uint64_t>({5, 6}, true)), std::string("\0\1", 2));
  EXPECT_EQ(read_info_.affine, Affine::plain({0.5, 1, 2}, {1, 2, 3}));
  EXPECT_EQ(read_info_.description, "a title");
}

TEST_F(VtkTest, TextCellsFieldsAndColours) {
  expect_voxels(points("ASCII", "2 1 1", "POINT_DATA 2\nSCALARS s short 1\nLOOKUP_TABLE default\n1 -2\n"),
                sample_text<uint16_t>({32769, 32766}, false));
  // Cells lie between points.
  expect_voxels(points("BINARY", "3 2 1", "CELL_DATA 2\nSCALARS s unsigned_char\nLOOKUP_TABLE default\nab"),
                "ab");
  EXPECT_EQ(read_info_.dims, Index3(2, 1, 1));
  EXPECT_EQ(read_info_.affine.origin, (Affine::Vector{1.25, 2.5, 3}));
  expect_voxels(points("BINARY", "2 1 1",
                       "METADATA\nINFORMATION 0\n\nPOINT_DATA 2\nFIELD FieldData 1\na 1 2 unsigned_char\nab"),
                "ab");
  expect_voxels(points("BINARY", "2 1 1", "POINT_DATA 2\nCOLOR_SCALARS c 3\nabcdef"), "abcdef");
  EXPECT_EQ(read_info_.format, VoxelFormat::rgb24);
  expect_voxels(points("ASCII", "2 1 1", "POINT_DATA 2\nCOLOR_SCALARS c 1\n0.0117647 1\n"), "\3\xff");
  refused(points("ASCII", "2 1 1", "POINT_DATA 2\nCOLOR_SCALARS c 1\n0.5 1.5\n"),
          "expected a colour from 0 to 1");
  OpenOptions options;
  options.channel = 1;
  expect_voxels(
      points("BINARY", "2 1 1", "POINT_DATA 2\nSCALARS s unsigned_char 2\nLOOKUP_TABLE default\nabcd"), "bd",
      options);
  expect_voxels(
      points("BINARY", "1 1 1", "POINT_DATA 1\nSCALARS s unsigned_char\nLOOKUP_TABLE default\na\nVECTORS v"),
      "a");
  EXPECT_TRUE(noted("10 bytes after the first array are dropped")) << all_notes();
}

TEST_F(VtkTest, WhatIsRefused) {
  const std::string scalars = "POINT_DATA 2\nSCALARS s unsigned_char\nLOOKUP_TABLE default\n";
  refused("hello", "not a VTK file");
  refused("# vtk DataFile Version 7.0\n", "expected a version below 6");
  refused("# vtk DataFile Version 3.0\nt\nBASE64\n", "expected ASCII or BINARY");
  refused("# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n", "expected DATASET STRUCTURED_POINTS");
  refused(points("BINARY", "2 1 1", scalars + "a"), "end after 1 bytes: expected 2");
  refused(points("BINARY", "3 1 1", scalars + "abc"), "2 points: expected 3, as DIMENSIONS say");
  refused(points("BINARY", "0 1 1", scalars), "expected whole numbers from 1 to 2^31");
  refused(points("ASCII", "2 1 1", scalars + "1 x"), "\"x\": expected a number of the header's type");
  refused(points("BINARY", "2 1 1", "POINT_DATA 2\nSCALARS s bit\nLOOKUP_TABLE default\na"),
          "expected SCALARS NAME TYPE");
  refused(points("BINARY", "2 1 1", "POINT_DATA 2\nVECTORS v float\n"),
          "expected SCALARS, COLOR_SCALARS or FIELD");
  refused(points("BINARY", "2 1 1", ""), "expected an array of points or cells");
}

TEST_F(VtkTest, Hostile) {
  const std::string file =
      points("BINARY", "2 3 2", "POINT_DATA 12\nSCALARS s unsigned_char\nLOOKUP_TABLE default\nabcdefghijkl");
  hostile("v.vtk", file, 1000);
}

}  // namespace
}  // namespace voxkit
