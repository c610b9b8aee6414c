#include "tests/formats/file_format_test.h"
#include "tests/formats/packing_test.h"

namespace voxkit {
namespace {

std::string base64(const std::string& bytes) {
  constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    unsigned bits = 0;
    for (size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : digits[bits >> (18 - 6 * k) & 63];
  }
  return text;
}

class VtiTest : public FileFormatTest {
 protected:
  /// `file`: attributes of VTKFile; `image`: of ImageData; `arrays` with what is around them.
  static std::string document(const std::string& file, const std::string& extent, const std::string& image,
                              const std::string& arrays, const std::string& after = "") {
    return "<?xml version=\"1.0\"?>\n<!-- <a comment> -->\n<VTKFile type=\"ImageData\" version=\"1.0\" " +
           file + ">\n<ImageData WholeExtent=\"" + extent + "\" " + image + ">\n<Piece Extent=\"" + extent +
           "\">\n" + arrays + "\n</Piece>\n</ImageData>\n" + after + "</VTKFile>\n";
  }
  static std::string array(const std::string& type, const std::string& format, const std::string& data,
                           const std::string& more = "") {
    return "<PointData><DataArray type=\"" + type + "\" Name='a' format=\"" + format + "\" " + more + ">" +
           data + "</DataArray></PointData>";
  }
  void expect_voxels(const std::string& content, const std::string& expected,
                     const OpenOptions& options = {}) {
    FileFormatTest::expect_voxels(open_volume(put("v.vti", content), options, ctx_), expected);
  }
  static VoxelSpan packed_span(std::vector<uint16_t>& values, Index3 size) {
    return packed(reinterpret_cast<std::byte*>(values.data()), size, VoxelFormat::density16);
  }
  void refused(const std::string& content, const std::string& part) {
    expect_error(put("v.vti", content), part);
  }
};

const std::string little = "byte_order=\"LittleEndian\"", zlib = " compressor=\"vtkZLibDataCompressor\"";

TEST_F(VtiTest, RoundTrips) {
  VolumeInfo info = make_info({5, 3, 4}, VoxelFormat::density8, SampleType::i8);
  info.affine.axes = {{{0, 2, 0}, {-1, 0, 0}, {0, 0, 3}}};
  info.affine.origin = {10, 20, 30.5};
  round_trip("v.vti", info);
  EXPECT_EQ(read_info_.affine, info.affine);
  for (const SampleType type : {SampleType::u16, SampleType::i16})
    round_trip("v.vti", make_info({5, 3, 4}, VoxelFormat::density16, type));
  round_trip("v.vti", make_info({1, 1, 1}, VoxelFormat::float32, SampleType::f32));
  round_trip("v.vti", make_info({2, 3, 4}, VoxelFormat::rgb24));
  round_trip("v.vti", make_info({2, 3, 4}, VoxelFormat::rgba32));
}

TEST_F(VtiTest, EveryCodingInBothOrders) {
  for (const bool big : {false, true})
    for (const bool wide : {false, true}) {
      SCOPED_TRACE(testing::Message() << big << wide);
      const std::string file = std::string("byte_order=\"") + (big ? "Big" : "Little") +
                               "Endian\" header_type=\"UInt" + (wide ? "64" : "32") + "\"";
      const auto counts = [&](const std::vector<uint64_t>& values) {
        return wide ? sample_text(values, big)
                    : sample_text(std::vector<uint32_t>(values.begin(), values.end()), big);
      };
      const std::vector<uint16_t> values{1, 2, 3, 4, 5, 60000};
      const std::string data = sample_text(values, big), expected = sample_text(values, false);
      const std::string extent = "0 2 0 1 0 0", image = "Origin=\"1 2 3\" Spacing=\"1 2 4\"";
      const auto inline_file = [&](const std::string& more, const std::string& format,
                                   const std::string& text) {
        return document(file + more, extent, image, array("UInt16", format, text));
      };
      expect_voxels(inline_file("", "ascii", "\n1 2 3\n4 5 60000\n"), expected);
      EXPECT_EQ(read_info_.dims, Index3(3, 2, 1));
      EXPECT_EQ(read_info_.affine, Affine::plain({1, 2, 4}, {1, 2, 3}));
      expect_voxels(inline_file("", "binary", "\n  " + base64(counts({12}) + data) + "\n"), expected);
      // Two blocks of 8 bytes and 4.
      const std::string one = zlib_text(data.substr(0, 8)), two = zlib_text(data.substr(8));
      const std::string sizes = counts({2, 8, 4, one.size(), two.size()});
      expect_voxels(inline_file(zlib, "binary", base64(sizes) + base64(one + two)), expected);
      const auto appended = [&](const std::string& more, const std::string& encoding,
                                const std::string& bytes, const std::string& offset) {
        return document(file + more, extent, image,
                        array("UInt16", "appended", "", "offset=\"" + offset + "\""),
                        "<AppendedData encoding=\"" + encoding + "\">\n _" + bytes + "</AppendedData>");
      };
      expect_voxels(appended("", "raw", "xy" + counts({12}) + data, "2"), expected);
      expect_voxels(appended("", "base64", "AAAA" + base64(counts({12}) + data), "4"), expected);
      expect_voxels(appended(zlib, "raw", sizes + one + two, "0"), expected);
      expect_voxels(appended(zlib, "base64", base64(sizes) + base64(one + two), "0"), expected);
      // Blocks of one size.
      expect_voxels(
          appended(zlib, "raw",
                   counts({2, 6, 0, zlib_text(data.substr(0, 6)).size(), zlib_text(data.substr(6)).size()}) +
                       zlib_text(data.substr(0, 6)) + zlib_text(data.substr(6)),
                   "0"),
          expected);
    }
}

TEST_F(VtiTest, BlocksOfLz4) {
  // Two bytes as they are; and "abcabcabcabcabcabc": three, 10 from 3 before, and the last five as they are.
  const auto file = [&](const std::string& extent, uint32_t bytes, const std::string& block) {
    return document(
        little + " compressor=\"vtkLZ4DataCompressor\"", extent, "",
        array("UInt8", "binary",
              base64(sample_text<uint32_t>({1, bytes, 0, static_cast<uint32_t>(block.size())}, false)) +
                  base64(block)));
  };
  expect_voxels(file("0 1 0 0 0 0", 2,
                     "\x20"
                     "ab"),
                "ab");
  const std::string run = std::string(
                              "\x36"
                              "abc\3\0\x50",
                              7) +
                          "bcabc";
  expect_voxels(file("0 17 0 0 0 0", 18, run), "abcabcabcabcabcabc");
  refused(file("0 17 0 0 0 0", 18, run.substr(0, 11)), "corrupt data: expected 18 bytes");
  refused(file("0 18 0 0 0 0", 19, run), "corrupt data: expected 19 bytes");
}

TEST_F(VtiTest, AnyBoxOfBlocks) {
  // 7 x 5 x 4 voxels of 16 bits in blocks of 36 bytes, whatever rows are.
  std::vector<uint16_t> values(140);
  for (uint16_t& v : values) v = static_cast<uint16_t>(random_());
  const std::string data = sample_text(values, true);
  std::string packed;
  std::vector<uint32_t> counts{8, 36, 280 - 7 * 36};
  for (size_t at = 0; at < data.size(); at += 36) {
    const std::string block = zlib_text(data.substr(at, 36));
    counts.push_back(static_cast<uint32_t>(block.size()));
    packed += block;
  }
  const std::string content = document(
      "byte_order=\"BigEndian\"" + zlib, "0 6 0 4 0 3", "", array("UInt16", "appended", "", "offset=\"0\""),
      "<AppendedData encoding=\"raw\">_" + sample_text(counts, true) + packed);
  auto source = open_volume(put("v.vti", content), {}, ctx_);
  ASSERT_TRUE(source) << source.error().what;
  EXPECT_FALSE((*source)->forward_only());
  for (int i = 0; i < 300; ++i) {
    const auto side = [&](int64_t n, int64_t& lo, int64_t& hi) {
      lo = static_cast<int64_t>(random_() % static_cast<uint64_t>(n));
      hi = lo + 1 + static_cast<int64_t>(random_() % static_cast<uint64_t>(n - lo));
    };
    Box box;
    side(7, box.lo.x, box.hi.x), side(5, box.lo.y, box.hi.y), side(4, box.lo.z, box.hi.z);
    std::vector<uint16_t> got(static_cast<size_t>(box.voxels())), expected;
    ASSERT_TRUE((*source)->read(box, packed_span(got, box.size())));
    for (int64_t z = box.lo.z; z < box.hi.z; ++z)
      for (int64_t y = box.lo.y; y < box.hi.y; ++y)
        for (int64_t x = box.lo.x; x < box.hi.x; ++x)
          expected.push_back(values[static_cast<size_t>((z * 5 + y) * 7 + x)]);
    ASSERT_EQ(got, expected);
  }
}

TEST_F(VtiTest, PlacesCellsAndColours) {
  // Columns of Direction are axes, and voxels count from the extent's first.
  expect_voxels(
      document(little, "2 3 0 0 0 0", "Direction=\"0 -1 0 1 0 0 0 0 1\" Spacing=\"2 3 4\" Origin=\"1 1 1\"",
               array("UInt8", "ascii", "7 8")),
      "\7\10");
  EXPECT_EQ(read_info_.affine.axes, (std::array<Affine::Vector, 3>{{{0, 2, 0}, {-3, 0, 0}, {0, 0, 4}}}));
  EXPECT_EQ(read_info_.affine.origin, (Affine::Vector{1, 5, 1}));
  std::string cells = array("UInt8", "ascii", "7 8");
  for (size_t at; (at = cells.find("PointData")) != cells.npos;) cells.replace(at, 9, "CellData");
  expect_voxels(document(little, "0 2 0 1 0 0", "Spacing=\"2 2 2\"", cells), "\7\10");
  EXPECT_EQ(read_info_.dims, Index3(2, 1, 1));
  EXPECT_EQ(read_info_.affine.origin, (Affine::Vector{1, 1, 0}));
  expect_voxels(
      document(little, "0 1 0 0 0 0", "", array("UInt8", "ascii", "1 2 3 4 5 6", "NumberOfComponents='3'")),
      "\1\2\3\4\5\6");
  EXPECT_EQ(read_info_.format, VoxelFormat::rgb24);
}

TEST_F(VtiTest, OneArrayOfSeveral) {
  const std::string two =
      "<PointData Scalars=\"b\"><DataArray type=\"UInt8\" Name=\"a\" format=\"ascii\">1</DataArray>"
      "<DataArray type=\"UInt8\" Name=\"b\" format=\"ascii\">2</DataArray></PointData>";
  const std::string file = document(little, "0 0 0 0 0 0", "", two);
  refused(file, "has 2 arrays: expected --grid NAME, one of a, b");
  OpenOptions options;
  options.grid = "b";
  expect_voxels(file, "\2", options);
  EXPECT_EQ(read_info_.parts, std::vector<std::string>{"--grid b of a, b"});
}

TEST_F(VtiTest, WhatIsRefused) {
  const auto file = [&](const std::string& arrays) { return document(little, "0 1 0 0 0 0", "", arrays); };
  refused("hello", "not a VTK file");
  refused("<VTKFile type=\"PolyData\">", "expected a VTKFile of type=\"ImageData\"");
  refused(file(array("UInt8", "ascii", "7")), "voxel data end after 1 bytes: expected 2");
  refused(file(array("UInt8", "binary", base64("\1" + std::string(3, '\0') + "a"))),
          "an array of 1 bytes: expected 2");
  refused(file(array("UInt8", "binary", base64("\2" + std::string(3, '\0') + "a"))),
          "voxel data end after 1 bytes");
  refused(file(array("UInt8", "binary", "AgAAAGE?")), "expected groups of four characters");
  refused(file(array("UInt8", "appended", "", "offset=\"0\"")), "expected an element AppendedData");
  refused(file(array("Bit", "ascii", "1 0")), "an array of type \"Bit\"");
  refused(file("<PointData></PointData>"), "expected a DataArray of points or cells");
  refused(document(little, "1 0 0 0 0 0", "", ""), "expected an extent of six whole numbers");
  refused(document(little + " compressor=\"vtkLZMADataCompressor\"", "0 1 0 0 0 0", "", ""),
          "data compressed by \"vtkLZMADataCompressor\" are unsupported: expected vtkZLibDataCompressor or "
          "vtkLZ4");
  std::string pieces = file(array("UInt8", "ascii", "7 8"));
  pieces.replace(pieces.find("<Piece Extent=\"0 1"), 18, "<Piece Extent=\"0 0");
  refused(pieces, "expected one piece of the WholeExtent");
  const std::string packed = zlib_text("ab");
  const auto blocks = [&](uint32_t count, uint32_t block, uint32_t last, uint32_t size) {
    return document(little + zlib, "0 1 0 0 0 0", "",
                    array("UInt8", "binary",
                          base64(sample_text<uint32_t>({count, block, last, size}, false)) + base64(packed)));
  };
  const auto size = static_cast<uint32_t>(packed.size());
  expect_voxels(blocks(1, 2, 0, size), "ab");
  refused(blocks(1, 3, 0, size), "expected 2 bytes in all");
  refused(blocks(0xffffffff, 2, 0, size), "of which the file has the sizes");
  refused(blocks(1, 2, 0, size - 1), "block 0 of voxel data at byte 0: corrupt data: expected 2 bytes");
  refused(blocks(1, 2, 0, 0xffffffff), "not 4294967295");
}

TEST_F(VtiTest, Hostile) {
  const std::string packed = zlib_text("abcdefghijkl");
  const std::string file = document(
      little + zlib, "0 1 0 2 0 1", "Spacing=\"1 2 3\"", array("UInt8", "appended", "", "offset=\"0\""),
      "<AppendedData encoding=\"raw\">_" +
          sample_text<uint32_t>({1, 12, 0, static_cast<uint32_t>(packed.size())}, false) + packed);
  hostile("v.vti", file.substr(0, file.rfind("</VTKFile>")), 1000);
}

}  // namespace
}  // namespace voxkit
