// Points in LAS files.
#include <cmath>
#include <limits>

#include "tests/formats/point_cloud_test.h"

namespace voxkit {
namespace {

class LasTest : public PointReadingTest {};

TEST_F(LasTest, EveryFormat) {
  for (int format = 0; format <= 10; ++format) {
    SCOPED_TRACE(testing::Message() << "format " << format);
    LasFile file;
    file.format = format;
    file.minor = format >= 6 ? 4 : format >= 4 ? 3 : 2;
    file.offset = {500000, 4000000, -100};
    file.scale = {0.01, 0.01, 0.5};
    // Near the end of 32 bits: floats would not tell these apart.
    file.points = {{{1, 2, -3}, {0xff00, 0x80ff, 0x0101}, 1000}, {{2147483647, 3, 4}, {0, 0xffff, 0}, 4000}};
    const auto points = read("a.las", file.text());
    ASSERT_EQ(points.size(), 2u);
    EXPECT_EQ(points[0].at, glm::dvec3(1 * 0.01 + 500000, 2 * 0.01 + 4000000, -101.5));
    EXPECT_EQ(points[1].at.x, 2147483647 * 0.01 + 500000);
    const bool has_colors =
        format == 2 || format == 3 || format == 5 || format == 7 || format == 8 || format == 10;
    EXPECT_EQ(points[0].color, (has_colors ? Rgb{255, 128, 1} : Rgb{64, 64, 64}));
    EXPECT_EQ(points[1].color, (has_colors ? Rgb{0, 255, 0} : Rgb{255, 255, 255}));
    EXPECT_EQ(noted("no colors: intensity, 0 to 4000, is taken as gray"), !has_colors) << all_notes();
    EXPECT_EQ(noted("dropped: intensity, return numbers, classification"), has_colors) << all_notes();
    EXPECT_EQ(noted("GPS times"), format != 0 && format != 2) << all_notes();
    EXPECT_EQ(noted("near infrared"), format == 8 || format == 10) << all_notes();
    EXPECT_EQ(noted("waveforms"), format == 4 || format == 5 || format == 9 || format == 10) << all_notes();
  }
}

TEST_F(LasTest, ColorsOf8Bits) {
  LasFile file;
  file.points = {{{1, 2, 3}, {255, 128, 1}, 5}, {{4, 5, 6}, {0, 7, 0}, 5}};
  const auto points = read("a.las", file.text());
  EXPECT_EQ(points.at(0).color, (Rgb{255, 128, 1}));
  EXPECT_EQ(points.at(1).color, (Rgb{0, 7, 0}));
  EXPECT_TRUE(noted("no color is above 255: colors are taken as of 8 bits, not of 16"));
}

TEST_F(LasTest, BlackEverywhereIsNoColor) {
  LasFile file;
  file.points = {{{1, 2, 3}, {}, 10}, {{4, 5, 6}, {}, 20}};
  auto points = read("a.las", file.text());
  EXPECT_EQ(points.at(0).color, (Rgb{128, 128, 128}));
  EXPECT_TRUE(noted("all colors are 0: intensity, 0 to 20, is taken as gray"));
  file.points = {{{1, 2, 3}}, {{4, 5, 6}}};
  points = read("a.las", file.text());
  EXPECT_EQ(points.at(0).color, (Rgb{255, 255, 255}));
  EXPECT_TRUE(noted("all colors are 0, and no intensity: points are white"));
}

TEST_F(LasTest, WithheldPoints) {
  for (const int format : {2, 7}) {
    LasFile file;
    file.format = format;
    file.minor = 4;
    const auto withheld = static_cast<uint8_t>(format == 7 ? 4 : 0x80),
               others = static_cast<uint8_t>(~withheld);
    // Their colours do not count either.
    file.points = {
        {{1, 0, 0}, {9, 9, 9}, 1, others}, {{2, 0, 0}, {9999, 0, 0}, 1, withheld}, {{3, 0, 0}, {8, 8, 8}}};
    const auto points = read("a.las", file.text());
    ASSERT_EQ(points.size(), 2u);
    EXPECT_EQ(points[0].color, (Rgb{9, 9, 9}));
    EXPECT_EQ(points[1].at.x, 3 * 0.01);
    EXPECT_TRUE(noted("dropped: 1 of 3 points, which are marked as withheld"));
    file.points = {{{1, 0, 0}, {9, 9, 9}, 1, 0xff}};
    expect_error("a.las", file.text(), "no points that are not marked as withheld");
  }
}

TEST_F(LasTest, RecordsAreNamed) {
  LasFile file;
  file.format = 7;
  file.minor = 4;
  file.extra = 3;
  file.points = {{{1, 2, 3}, {256, 0, 0}}};
  const std::string keys = bytes_of(std::vector<uint16_t>{1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 2994});
  file.records = LasFile::record("LASF_Projection", 34735, keys) + LasFile::record("LASF_Spec", 4, "abc") +
                 LasFile::record("maker", 1, "");
  file.record_count = 3;
  read("a.las", file.text());
  EXPECT_TRUE(noted("dropped: the coordinate reference system, EPSG:2994")) << all_notes();
  EXPECT_TRUE(noted("dropped: records of maker")) << all_notes();
  EXPECT_TRUE(noted("3 extra bytes a point")) << all_notes();
  // Behind the points, as text, whose name counts.
  file.tail = LasFile::record("LASF_Projection", 2112, R"(PROJCS["NAD83 / Oregon",GEOGCS["NAD83"]])", true);
  file.tail_count = 1;
  read("a.las", file.text());
  EXPECT_TRUE(noted("dropped: the coordinate reference system, NAD83 / Oregon")) << all_notes();

  const auto broken = [&](size_t at, char byte, const std::string& part) {
    std::string text = file.text();
    text[at] = byte;
    expect_error("a.las", text, part);
  };
  broken(375 + 21, 1, "record 0 of");  // the length of the first
  broken(100, 100, "record 3 of 100: expected 54 bytes");
  broken(235 + 3, 1, "records from byte");
  broken(file.text().size() - file.tail.size() + 20, 127, "record 0 of 127 bytes");
}

TEST_F(LasTest, Refusals) {
  LasFile file;
  file.points = {{{1, 2, 3}, {1, 2, 3}}, {{4, 5, 6}, {1, 2, 3}}};
  const std::string good = file.text();
  const auto changed = [&](size_t at, auto value) {
    std::string text = good;
    std::memcpy(&text[at], &value, sizeof value);
    return text;
  };
  expect_error("a.las", "", "not a LAS file");
  expect_error("a.las", "LASF", "within its header");
  expect_error("a.las", good.substr(0, good.size() - 1), "it holds 1 of 2 points");
  expect_error("a.las", changed(25, uint8_t{5}), "LAS version 1.5: expected 1.0 to 1.4");
  expect_error("a.las", changed(24, uint8_t{2}), "LAS version 2.2");
  expect_error("a.las", changed(104, uint8_t{11}), "points of format 11: expected 0 to 10");
  expect_error("a.las", changed(104, uint8_t{2 | 128}), "LAZ: expected LAS, not compressed");
  expect_error("a.laz", good, "LAZ: expected LAS, not compressed");
  expect_error("a.las", changed(105, uint16_t{25}), "points of 25 bytes: those of format 2 have at least 26");
  expect_error("a.las", changed(94, uint16_t{100}), "a header of 100 bytes");
  expect_error("a.las", changed(96, uint32_t{10}), "points from byte 10 on");
  expect_error("a.las", changed(96, UINT32_MAX), "points from byte 4294967295 on");
  expect_error("a.las", changed(107, UINT32_MAX), "it holds 2 of 4294967295 points");
  expect_error("a.las", changed(107, uint32_t{0}), "no points");
  expect_error("a.las", changed(131, 0.0), "x: scale 0");
  expect_error("a.las", changed(163, std::numeric_limits<double>::infinity()), "y: scale 0.01, offset inf");
  expect_error("a.las", changed(147, std::numeric_limits<double>::quiet_NaN()), "z: scale nan");
  file.minor = 4;
  std::string many = file.text();
  const uint64_t most = UINT64_MAX;
  std::memcpy(&many[247], &most, 8);
  expect_error("a.las", many, "it holds 2 of 18446744073709551615 points");
  EXPECT_FALSE(open_points(path("none.las")));
}

}  // namespace
}  // namespace voxkit
