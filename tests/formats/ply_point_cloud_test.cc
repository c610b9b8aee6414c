// Points in PLY files.
#include <gtest/gtest.h>

#include <cstring>

#include "formats/mesh/ply_points.h"
#include "formats/mesh/point_cloud.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

class PlyPointsTest : public FileFormatTest {
 protected:
  std::vector<CloudPoint> read(const std::string& content) {
    const auto points = open_ply_points(put("a.ply", content));
    EXPECT_TRUE(points) << points.error().what;
    std::vector<CloudPoint> all;
    if (!points || !*points) return all;
    const Status status = (*points)->read([&](std::span<const CloudPoint> run) -> Status {
      all.insert(all.end(), run.begin(), run.end());
      return {};
    });
    EXPECT_TRUE(status) << status.error().what;
    EXPECT_EQ(all.size() + missing_, (*points)->size());
    return all;
  }
  size_t missing_ = 0;  ///< points that do not count
  /// The error of opening or reading.
  std::string error_of(const std::string& content) {
    const auto points = open_ply_points(put("a.ply", content));
    if (!points) return points.error().what;
    const Status status = (*points)->read([](std::span<const CloudPoint>) -> Status { return {}; });
    return status ? "" : status.error().what;
  }
};

const std::string three = "property float x\nproperty float y\nproperty float z\n";
const std::string colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";

TEST_F(PlyPointsTest, Ascii) {
  const auto points =
      read("ply\nformat ascii 1.0\nelement camera 1\nproperty float f\nelement vertex 2\n" + three +
           "property float quality\n" + colors + "end_header\n7.5\n1 2 3 0.5 255 0 9\n4 5 6 1 0 255 0\n");
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].at, glm::dvec3(1, 2, 3));
  EXPECT_EQ(points[0].color, (std::array<uint8_t, 3>{255, 0, 9}));
  EXPECT_EQ(points[1].at, glm::dvec3(4, 5, 6));
  EXPECT_EQ(points[1].color, (std::array<uint8_t, 3>{0, 255, 0}));
}

TEST_F(PlyPointsTest, BinaryOfEitherOrderAndManyRuns) {
  constexpr uint32_t count = 40000;
  for (const bool big : {false, true}) {
    std::string data;
    const auto add = [&](auto value) {
      char raw[sizeof value];
      std::memcpy(raw, &value, sizeof value);
      if (big) std::reverse(raw, raw + sizeof value);
      data.append(raw, sizeof value);
    };
    for (uint32_t i = 0; i < count; ++i) {
      add(static_cast<double>(i) + 0.25);
      add(static_cast<float>(i % 7));
      add(static_cast<int16_t>(-3));
      add(static_cast<uint16_t>(65535));
      add(static_cast<uint8_t>(i));
      add(0.5f);
    }
    const auto points =
        read(std::string("ply\nformat binary_") + (big ? "big" : "little") +
             "_endian 1.0\nelement vertex 40000\nproperty double x\nproperty float y\nproperty short "
             "z\nproperty ushort red\nproperty uchar green\nproperty float blue\nend_header\n" +
             data);
    ASSERT_EQ(points.size(), count);
    for (uint32_t i = 0; i < count; ++i) {
      ASSERT_EQ(points[i].at, glm::dvec3(i + 0.25, i % 7, -3));
      ASSERT_EQ(points[i].color, (std::array<uint8_t, 3>{255, static_cast<uint8_t>(i), 128}));
    }
  }
}

TEST_F(PlyPointsTest, WithoutColorsTheyAreWhite) {
  const auto points = read("ply\nformat ascii 1.0\nelement vertex 1\n" + three + "end_header\n1 2 3\n");
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].color, (std::array<uint8_t, 3>{255, 255, 255}));
}

TEST_F(PlyPointsTest, PointsThatAreNowhereOrClearAreDropped) {
  missing_ = 3;
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 5\n" + three + colors + "property uchar alpha\nend_header\n";
  const auto points =
      read(head + "1 2 3 1 2 3 255\nnan 0 0 0 0 0 255\n0 -inf 0 0 0 0 255\n4 5 6 4 5 6 128\n7 8 9 0 0 0 5\n");
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].at, glm::dvec3(1, 2, 3));
  EXPECT_EQ(points[1].at, glm::dvec3(4, 5, 6));
}

TEST_F(PlyPointsTest, DoublesWhereFloatsDoNotDo) {
  EXPECT_FALSE(needs_doubles(0, 1000, 1));
  EXPECT_FALSE(needs_doubles(-0.5, 0.5, 1.0 / 1024));
  EXPECT_FALSE(needs_doubles(0, 0, 1));
  EXPECT_TRUE(needs_doubles(500000, 500001, 1.0 / 64));
  EXPECT_TRUE(needs_doubles(-5.4e6, 0, 0.25));
  EXPECT_TRUE(needs_doubles(0, 1e39, 1e36));
  for (const bool doubles : {false, true}) {
    VolumeInfo grid;
    grid.dims = {500001, 1, 2};
    grid.affine.axes[2] = {0.25, 0, 0.5};
    grid.world = World::ras;
    auto writer = PlyPointWriter::create(path("b.ply"), grid, 2, doubles, true);
    ASSERT_TRUE(writer);
    const ColoredPoint points[] = {{{500000.015625, 0.1, -1}, {1, 2, 3}}, {{0, 0, 0}, {4, 5, 6}}};
    ASSERT_TRUE(writer->add(points));
    ASSERT_TRUE(writer->finish());
    const auto back = read(get(path("b.ply")));
    ASSERT_EQ(back.size(), 2u);
    EXPECT_EQ(back[0].at.x, doubles ? 500000.015625 : static_cast<double>(500000.015625f));
    EXPECT_EQ(back[0].at.y, doubles ? 0.1 : static_cast<double>(0.1f));
    EXPECT_EQ(back[1].color, (std::array<uint8_t, 3>{4, 5, 6}));
    const auto cloud = open_ply_points(path("b.ply"));
    ASSERT_TRUE(cloud);
    ASSERT_TRUE((*cloud)->grid());
    EXPECT_EQ((*cloud)->grid()->dims, grid.dims);
    EXPECT_EQ((*cloud)->grid()->affine, grid.affine);
    EXPECT_EQ((*cloud)->grid()->world, World::ras);
  }
}

TEST_F(PlyPointsTest, CommentsThatAreNoGridAreComments) {
  for (const char* const comment : {"voxel_grid", "voxel_grid {}", "voxel_grid [", "grid"}) {
    const auto cloud =
        open_ply_points(put("c.ply", "ply\nformat ascii 1.0\ncomment " + std::string(comment) +
                                         "\nelement vertex 1\n" + three + "end_header\n1 2 3\n"));
    ASSERT_TRUE(cloud) << comment;
    EXPECT_FALSE((*cloud)->grid()) << comment;
  }
}

TEST_F(PlyPointsTest, FacesMakeAMesh) {
  const auto points =
      open_ply_points(put("a.ply", "ply\nformat ascii 1.0\nelement vertex 3\n" + three +
                                       "element face 1\nproperty list uchar int "
                                       "vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"));
  ASSERT_TRUE(points);
  EXPECT_EQ(*points, nullptr);
}

TEST_F(PlyPointsTest, Refusals) {
  const auto file = [](const std::string& vertices, const std::string& data) {
    return "ply\nformat ascii 1.0\nelement vertex " + vertices + "\n" + three + "end_header\n" + data;
  };
  EXPECT_NE(error_of(file("0", "")).find("no points"), std::string::npos);
  EXPECT_NE(error_of(file("2", "1 2 3\n4 5\n")).find("expected further elements"), std::string::npos);
  EXPECT_NE(error_of(file("99999999999", "1 2 3\n")).find("elements vertex"), std::string::npos);
  EXPECT_NE(error_of(file("1", "1 2 x\n")).find("expected a number"), std::string::npos);
  EXPECT_NE(error_of("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n")
                .find("x, y and z"),
            std::string::npos);
  EXPECT_NE(error_of("ply\nformat binary_little_endian 1.0\nelement vertex 2\n" + three + "end_header\n" +
                     std::string(23, '\0'))
                .find("elements vertex"),
            std::string::npos);
  EXPECT_FALSE(open_ply_points(put("b.ply", "play")));
  EXPECT_FALSE(open_ply_points("none.ply"));
}

}  // namespace
}  // namespace voxkit
