// Points in PCD files.
#include <cmath>
#include <limits>

#include "formats/mesh/lzf.h"
#include "tests/formats/point_cloud_test.h"

namespace voxkit {
namespace {

class PcdTest : public PointReadingTest {};

float packed(uint32_t argb) {
  float value;
  std::memcpy(&value, &argb, 4);
  return value;
}

TEST_F(PcdTest, Ascii) {
  const auto points = read("a.pcd", PcdFile{}.ascii("1 2 3\n\n -4.5\t5e1 .25 \r\n"));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].at, glm::dvec3(1, 2, 3));
  EXPECT_EQ(points[1].at, glm::dvec3(-4.5, 50, 0.25));
  EXPECT_EQ(points[0].color, (Rgb{255, 255, 255}));
  EXPECT_TRUE(notes_.empty());
}

TEST_F(PcdTest, AsciiColors) {
  // As bits of a float, and as a number.
  PcdFile file{"rgb x y z", "4 4 4 4", "F F F F", "1 1 1 1"};
  auto points = read(
      "a.pcd", file.ascii(fmt::format("{:.9g} 1 2 3\n{:.9g} 4 5 6\n", packed(0x00ff8001), packed(0x42))));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].color, (Rgb{255, 128, 1}));
  EXPECT_EQ(points[0].at, glm::dvec3(1, 2, 3));
  EXPECT_EQ(points[1].color, (Rgb{0, 0, 0x42}));
  EXPECT_TRUE(notes_.empty());
  // What is no number has lost its bits.
  points = read("a.pcd", file.ascii("nan 1 2 3\n0 4 5 6\n"));
  EXPECT_EQ(points.at(0).color, (Rgb{255, 255, 255}));
  EXPECT_EQ(points.at(1).color, (Rgb{0, 0, 0}));
  EXPECT_TRUE(noted("1 points have a color that is no number"));
  file.types = "U F F F";
  points = read("a.pcd", file.ascii("4294901770 1 2 3\n66051 4 5 6\n"));
  EXPECT_EQ(points.at(0).color, (Rgb{255, 0, 10}));
  EXPECT_EQ(points.at(1).color, (Rgb{1, 2, 3}));
}

TEST_F(PcdTest, BinaryOfManyTypesAndRuns) {
  constexpr uint32_t count = 40000;
  PcdFile file{
      "_ x label z y rgba normal", "1 8 2 1 4 4 4", "U F U I I U F", "3 1 1 1 1 1 3", count / 100, 100};
  std::string data;
  const auto add = [&](auto value) { data.append(reinterpret_cast<const char*>(&value), sizeof value); };
  for (uint32_t i = 0; i < count; ++i) {
    data += "pad";
    add(i + 0.125);
    add(static_cast<uint16_t>(7));
    add(static_cast<int8_t>(-3));
    add(-static_cast<int32_t>(i));
    add((i == 5 ? 0x7fu : 0xffu) << 24 | 0x0a0b00u | (i & 255));
    for (int k = 0; k < 3; ++k) add(0.5f);
  }
  missing_ = 1;  // less than half opaque
  const auto points = read("a.pcd", file.binary(data + "\0\0"));
  ASSERT_EQ(points.size(), count - 1);
  for (uint32_t i = 6; i < count; ++i) {
    ASSERT_EQ(points[i - 1].at, glm::dvec3(i + 0.125, -static_cast<double>(i), -3));
    ASSERT_EQ(points[i - 1].color, (Rgb{10, 11, static_cast<uint8_t>(i)}));
  }
  EXPECT_TRUE(noted("dropped: label, normal")) << all_notes();
  EXPECT_EQ(notes_.size(), 1u);
}

TEST_F(PcdTest, AlphaThatIsNowhereIsNotCounted) {
  const PcdFile file{"x y z rgba", "4 4 4 4", "F F F U", "1 1 1 1"};
  const auto points = read("a.pcd", file.ascii("1 2 3 255\n4 5 6 65280\n"));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[1].color, (Rgb{0, 255, 0}));
  EXPECT_TRUE(noted("alpha is 0 everywhere"));
}

TEST_F(PcdTest, IntensityIsGray) {
  PcdFile file{"x y z intensity", "4 4 4 2", "F F F U", "1 1 1 1", 3};
  auto points = read("a.pcd", file.ascii("1 2 3 100\n4 5 6 0\n7 8 9 400\n"));
  EXPECT_EQ(points.at(0).color, (Rgb{64, 64, 64}));
  EXPECT_EQ(points.at(1).color, (Rgb{0, 0, 0}));
  EXPECT_EQ(points.at(2).color, (Rgb{255, 255, 255}));
  EXPECT_TRUE(noted("no colors: intensity, 0 to 400, is taken as gray")) << all_notes();
  // Below 0 it begins at the least; points that are nowhere do not count.
  file.types = "F F F F";
  file.sizes = "4 4 4 4";
  missing_ = 1;
  points = read("a.pcd", file.ascii("nan 2 3 900\n4 5 6 -1\n7 8 9 1\n"));
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].color, (Rgb{0, 0, 0}));
  EXPECT_EQ(points[1].color, (Rgb{255, 255, 255}));
  missing_ = 0;
  points = read("a.pcd", file.ascii("1 2 3 0\n4 5 6 0\n7 8 9 0\n"));
  EXPECT_EQ(points.at(0).color, (Rgb{255, 255, 255}));
  EXPECT_TRUE(noted("no intensity that differs"));
  // Beside colours it is dropped.
  file = {"x y z rgb intensity", "4 4 4 4 4", "F F F U F", "1 1 1 1 1"};
  points = read("a.pcd", file.ascii("1 2 3 255 1\n4 5 6 255 2\n"));
  EXPECT_EQ(points.at(0).color, (Rgb{0, 0, 255}));
  EXPECT_TRUE(noted("dropped: intensity"));
}

TEST_F(PcdTest, Compressed) {
  // Column by column: x, y, z as floats, and colours.
  PcdFile file{"x y z rgb", "4 4 4 4", "F F F F", "1 1 1 1", 3};
  const std::string data = bytes_of(std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8, 9}) +
                           bytes_of(std::vector<uint32_t>{0xff0000, 0xff00, 0xff});
  auto points = read("a.pcd", file.compressed(lzf_literals(data), data.size()));
  ASSERT_EQ(points.size(), 3u);
  EXPECT_EQ(points[0].at, glm::dvec3(1, 4, 7));
  EXPECT_EQ(points[2].at, glm::dvec3(3, 6, 9));
  EXPECT_EQ(points[0].color, (Rgb{255, 0, 0}));
  EXPECT_EQ(points[2].color, (Rgb{0, 0, 255}));

  // A float, copied 8 more times, then a colour, twice: copies of 32 bytes from 4 back, and of 8.
  file.width = 3;
  const std::string one = bytes_of(std::vector<float>{1}), color = bytes_of(std::vector<uint32_t>{0x010203});
  const std::string packed =
      "\x03" + one + std::string("\xe0\x17\x03", 3) + "\x03" + color + std::string("\xc0\x03", 2);
  points = read("a.pcd", file.compressed(packed, 48));
  ASSERT_EQ(points.size(), 3u);
  for (const CloudPoint& point : points) {
    EXPECT_EQ(point.at, glm::dvec3(1));
    EXPECT_EQ(point.color, (Rgb{1, 2, 3}));
  }
  const auto broken = [&](const std::string& bytes, const std::string& part) {
    expect_error("a.pcd", file.compressed(bytes, 48), part);
  };
  broken(std::string("\xe0\x17\x04", 3) + packed, "a copy of what is 5 bytes back: expected at most 0");
  broken("\x03" + one + std::string("\xe0\x17\x04", 3), "a copy of what is 5 bytes back: expected at most 4");
  broken(packed.substr(0, packed.size() - 1), "the data ends within a copy");
  broken(packed.substr(0, 7), "the data ends within a copy");
  broken(packed.substr(0, packed.size() - 4), "bytes follow: there are");
  broken(packed + std::string("\0x", 2), "it becomes more than 48 bytes");
  broken(packed.substr(0, 8), "the data ends after 36 unpacked bytes: expected 48");
  expect_error("a.pcd", file.compressed(packed, 47),
               "unpacked data of 47 bytes: expected 3 points of 16 bytes");
  const std::string whole = file.compressed(packed, 48);
  expect_error("a.pcd", whole.substr(0, whole.size() - 1), "packed bytes: there are");
  expect_error("a.pcd", file.header("binary_compressed") + "1234567",
               "expected the sizes of the packed data");
}

TEST_F(PcdTest, CompressedBeyondTheWindow) {
  // 70000 zeros, with copies of 264 bytes, then what is 8192 back: more than is unpacked at once.
  std::string packed("\x01\x05\x00", 3), want("\x05\x00", 2);
  while (want.size() < 70000) {
    packed += std::string("\xe0\xff\x00", 3);
    want += std::string(264, '\0');
  }
  packed += std::string("\x00\x09", 2);
  want += "\x09";
  for (int i = 0; i < 31; ++i) {
    packed += std::string("\xe0\xff\x00", 3);
    want += std::string(264, '\x09');
  }
  packed += std::string("\x3f\xff", 2);  // 3 bytes, 8192 back
  want += want.substr(want.size() - 8192, 3);
  std::string have;
  const auto bytes = [](const std::string& text) { return std::as_bytes(std::span(text)); };
  const Status status =
      unpack_lzf(bytes(packed), want.size(), "a", [&](std::span<const std::byte> run) -> Status {
        have.append(reinterpret_cast<const char*>(run.data()), run.size());
        return {};
      });
  ASSERT_TRUE(status) << status.error().what;
  EXPECT_TRUE(have == want);
}

TEST_F(PcdTest, TheViewpointIsSaid) {
  PcdFile file;
  file.viewpoint = "10 0 0 1 0 0 0";
  const auto points = read("a.pcd", file.ascii("1 2 3\n4 5 6\n"));
  EXPECT_EQ(points.at(0).at, glm::dvec3(1, 2, 3));
  EXPECT_TRUE(noted("the viewpoint is not applied"));
}

TEST_F(PcdTest, OldAndShortHeaders) {
  const auto points =
      read("a.pcd", "VERSION .5\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3");
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].at, glm::dvec3(1, 2, 3));
}

TEST_F(PcdTest, Refusals) {
  const std::string good = PcdFile{}.ascii("1 2 3\n4 5 6\n");
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    return text.replace(text.find(from), from.size(), to);
  };
  expect_error("a.pcd", "", "not a PCD file");
  expect_error("a.pcd", "ply\n", "not a PCD file");
  expect_error("a.pcd", good.substr(0, 90), "ends within its header");
  expect_error("a.pcd", changed("0.7\nF", "0.8\nF"), "version 0.8: expected 0.7");
  expect_error("a.pcd", changed("x y z", "x y w"), "expected the fields x, y and z");
  expect_error("a.pcd", changed("SIZE 4 4 4", "SIZE 4 4"), "expected SIZE, TYPE and COUNT of 3 fields");
  expect_error("a.pcd", changed("SIZE 4", "SIZE 3"), "field x of type F, 3 bytes");
  expect_error("a.pcd", changed("TYPE F", "TYPE Q"), "field x of type Q");
  expect_error("a.pcd", changed("COUNT 1", "COUNT 0"), "COUNT 0: expected 1 to");
  expect_error("a.pcd", changed("COUNT 1", "COUNT 2"), "expected the fields x, y and z");
  expect_error("a.pcd", changed("POINTS 2", "POINTS 3"), "as many POINTS as WIDTH times HEIGHT");
  expect_error("a.pcd", changed("WIDTH 2", "WIDTH -2"), "WIDTH: expected a number of points");
  expect_error("a.pcd", changed("DATA ascii", "DATA binary_lzma"),
               "expected ascii, binary or binary_compressed");
  expect_error("a.pcd", changed("HEIGHT", "DEPTH"), "expected VERSION, FIELDS");
  expect_error("a.pcd", changed("1 0 0 0\n", "1 0 0\n"), "VIEWPOINT: expected 7 numbers");
  expect_error("a.pcd", changed("4 5 6\n", "4 5000\n"), "a line of 2 numbers: expected 3");
  expect_error("a.pcd", changed("4 5 6\n", "4 5 6 7\n"), "a line of more than 3 numbers");
  expect_error("a.pcd", changed("4 5 6\n", "4 five 6\n"), "expected a number");
  expect_error("a.pcd", changed("4 5 6\n", ""), "PCD file ends after");
  expect_error("a.pcd", changed("4 5 6\n", "\n\n \n  \n\n"), "PCD file ends after 1 of 2 points");
  expect_error("a.pcd", good + "7 8 9\n", "more than the 2 points of its header");
  expect_error("a.pcd", PcdFile{.width = 0}.ascii(""), "no points");
  expect_error("a.pcd", PcdFile{}.binary(std::string(23, '\0')), "PCD file ends after");
  PcdFile huge;
  huge.width = uint64_t{1} << 62;
  expect_error("a.pcd", huge.binary(""), "expected fewer");
  huge.width = uint64_t{1} << 40;
  expect_error("a.pcd", huge.binary(std::string(24, '\0')), "PCD file ends after");
  EXPECT_FALSE(open_points(path("none.pcd")));
}

}  // namespace
}  // namespace voxkit
