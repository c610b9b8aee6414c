// Cameras by name, and the rays that they cast.
#include "librender/camera.h"

#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <string>

#include "librender/camera_file.h"

namespace voxkit::render {
namespace {

TEST(Camera, TextIsChecked) {
  EXPECT_TRUE(parse_camera("orbit:10,20,1.5", 45));
  EXPECT_TRUE(parse_camera("lookat:0,0,2,0,0,0", 45));
  for (const char* wrong :
       {"", "orbit:", "orbit:1,2", "orbit:1,2,3,4", "orbit:1,91,2", "orbit:1,2,0", "lookat:1,1,1,1,1,1",
        "lookat:0,0,2,1e300,0,0", "orbit:0,0,1e10", "orbit:a,b,c", "orbit:1,2,3x", "orbit:nan,0,1"})
    EXPECT_FALSE(parse_camera(wrong, 45)) << wrong;
  EXPECT_EQ(camera_path("thesis94", Camera{})->size(), 94u);
  EXPECT_EQ(camera_path("orbit:7", Camera{})->size(), 7u);
  for (const char* wrong : {"", "thesis", "orbit:0", "orbit:1.5", "orbit:-3"})
    EXPECT_FALSE(camera_path(wrong, Camera{})) << wrong;
}

TEST(Camera, RaysGoThroughTheirPixels) {
  // From +z with the x axis to the right and y up; 90 degrees high, so the edges are at 45 degrees.
  const RayGenerator rays(Camera{{0, 0, 2}, {0, 0, 0}, 90}, 300, 200);
  const auto expect_direction = [&](double x, double y, glm::dvec3 expected) {
    const glm::dvec3 d = rays.direction(x, y);
    expected = glm::normalize(expected);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(d[k], expected[k], 1e-12) << x << "," << y;
  };
  expect_direction(150, 100, {0, 0, -1});
  expect_direction(150, 0, {0, 1, -1});
  expect_direction(150, 200, {0, -1, -1});
  expect_direction(300, 100, {1.5, 0, -1});
  EXPECT_NEAR(rays.pixel_width(), 2.0 / 200, 1e-12);
}

TEST(Camera, TransformPutsTheLongestSideFromMinusAHalfToAHalf) {
  VolumeInfo info;
  info.dims = {10, 20, 5};
  info.affine = Affine::plain({1, 1, 4}, info.affine.origin);
  const GridTransform transform(info);
  EXPECT_NEAR(transform.smallest_edge(), 1.0 / 20, 1e-12);
  EXPECT_NEAR(transform.largest_edge(), 4.0 / 20, 1e-12);
  const glm::dvec3 corner = transform.point({0.25, 0.5, 0.5});
  EXPECT_NEAR(corner.x, 10, 1e-9);
  EXPECT_NEAR(corner.y, 20, 1e-9);
  EXPECT_NEAR(corner.z, 5, 1e-9);
}

TEST(Camera, AxesPointWhereTheAffineSays) {
  VolumeInfo info;
  info.dims = {10, 20, 5};
  info.affine = {{{{0, -2, 0}, {0, 0, 1}, {3, 0, 1}}}, {7, 8, 9}};
  info.world = World::ras;
  const GridTransform transform(info);
  const double longest = 20;  // along x and y alike
  // Two voxels along x and y from the middle, and one along z.
  const glm::dvec3 place = glm::dvec3(3, -4, 2 + 1) / longest;
  const glm::dvec3 at = transform.point(place);
  EXPECT_NEAR(at.x, 5 + 2, 1e-9);
  EXPECT_NEAR(at.y, 10 + 2, 1e-9);
  EXPECT_NEAR(at.z, 2.5 + 1, 1e-9);
  const glm::dvec3 along_z = transform.direction(glm::dvec3(3, 0, 1) / longest);
  EXPECT_NEAR(along_z.x, 0, 1e-9);
  EXPECT_NEAR(along_z.y, 0, 1e-9);
  EXPECT_NEAR(along_z.z, 1, 1e-9);
  for (int i = 0; i < 8; ++i) {
    const glm::dvec3 corner = transform.point(transform.corner(i));
    EXPECT_NEAR(corner.x, i & 1 ? 10 : 0, 1e-9);
    EXPECT_NEAR(corner.y, i & 2 ? 20 : 0, 1e-9);
    EXPECT_NEAR(corner.z, i & 4 ? 5 : 0, 1e-9);
    EXPECT_LE(glm::length(transform.corner(i)), transform.radius());
  }
  // The same patient in another world is the same picture.
  VolumeInfo other = info;
  other.affine = in_world(info.affine, World::ras, World::lps);
  other.world = World::lps;
  EXPECT_EQ(GridTransform(other).along, transform.along);
}

class CameraFile : public testing::Test {
 protected:
  CameraFile() {
    std::string name = (std::filesystem::temp_directory_path() / "voxkit-camera-XXXXXX").string();
    EXPECT_GE(fd_ = mkstemp(name.data()), 0);
    path_ = name;
  }
  ~CameraFile() override {
    close(fd_);
    std::filesystem::remove(path_);
  }
  Result<std::vector<Camera>> read(const std::string& text) {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << text;
    return read_camera_file(path_, 45);
  }
  /// Reads a file whose frames are `frames`.
  Result<std::vector<Camera>> frames(const std::string& frames) {
    return read("{\"frames\": [" + frames + "]}");
  }

  void expect_wrong(const Result<std::vector<Camera>>& got, const std::string& what) {
    ASSERT_FALSE(got) << what;
    EXPECT_EQ(got.error().code, ErrorCode::input);
    EXPECT_EQ(got.error().file, path_);
    EXPECT_EQ(got.error().what, what);
  }
  static void expect_near(const glm::dvec3& a, const glm::dvec3& b) {
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(a[k], b[k], 1e-12);
  }

  std::string path_;
  int fd_ = -1;
};

TEST_F(CameraFile, HoldsACameraForEachFrame) {
  const auto path = frames(R"(
    {"eye": [0, 0.5, 2], "target": [0.1, 0, -1e-1], "fov": 30},
    {"eye": [1, 2, 3]},
    {"fov": 60.5, "orbit": [90, 0, 1.5]})");
  ASSERT_TRUE(path) << path.error().what;
  ASSERT_EQ(path->size(), 3u);
  expect_near((*path)[0].eye, {0, 0.5, 2});
  expect_near((*path)[0].target, {0.1, 0, -0.1});
  EXPECT_EQ((*path)[0].fov, 30);
  expect_near((*path)[1].eye, {1, 2, 3});
  expect_near((*path)[1].target, {0, 0, 0});
  EXPECT_EQ((*path)[1].fov, 45);
  expect_near((*path)[2].eye, {1.5, 0, 0});
  EXPECT_EQ((*path)[2].fov, 60.5);
}

TEST_F(CameraFile, FramesBetweenKeysAreInterpolated) {
  const auto path = frames(R"(
    {"orbit": [0, 0, 2], "fov": 40},
    {"orbit": [360, 60, 1], "fov": 20, "at": 4},
    {"eye": [0, 0, 2]},
    {"eye": [3, 6, 5], "target": [0, 0, 3], "at": 8})");
  ASSERT_TRUE(path) << path.error().what;
  ASSERT_EQ(path->size(), 9u);
  for (int i = 0; i <= 4; ++i) {
    const Camera expected = Camera::orbit(90.0 * i, 15.0 * i, 2 - 0.25 * i, 40 - 5.0 * i);
    expect_near((*path)[static_cast<size_t>(i)].eye, expected.eye);
    EXPECT_NEAR((*path)[static_cast<size_t>(i)].fov, expected.fov, 1e-12);
  }
  for (int i = 0; i <= 3; ++i) {
    expect_near((*path)[static_cast<size_t>(5 + i)].eye, {1.0 * i, 2.0 * i, 2.0 + i});
    expect_near((*path)[static_cast<size_t>(5 + i)].target, {0, 0, 1.0 * i});
  }
}

TEST_F(CameraFile, SaysWhereItIsWrong) {
  const std::string form = R"({"frames": [{"eye": [x, y, z]}, {"orbit": [az, el, dist]}, ...]})";
  expect_wrong(read(""), "no JSON at byte 1: expected " + form);
  expect_wrong(read("{\"frames\": [}"), "no JSON at byte 13: expected " + form);
  expect_wrong(read("[1]"), "the file is an array: expected " + form);
  expect_wrong(read("7"), "the file is a number: expected " + form);
  expect_wrong(read("{}"), "no \"frames\": expected " + form);
  expect_wrong(read("{\"frames\": {}}"), "\"frames\" is an object: expected " + form);
  expect_wrong(read("{\"frames\": null}"), "\"frames\" is null: expected " + form);
  expect_wrong(read("{\"cameras\": []}"), "unknown \"cameras\": expected \"frames\"");
  expect_wrong(frames(""), "no frames: expected at least one");
  expect_wrong(frames("5"), "frames[0] is a number: expected an object");
  expect_wrong(read(R"({"frames": [{"eye": [0, 0, 2]}], "frames": []})"),
               "\"frames\" twice: expected it once");
  expect_wrong(read(R"({"frames": [{"eye": [0, 0, 2]}]} x)"), "no JSON at byte 34: expected " + form);
  const std::string good = R"({"eye": [0, 0, 2]}, )";
  expect_wrong(frames(good + "[]"), "frames[1] is an array: expected an object");
  expect_wrong(frames(good + "{}"), "frames[1]: no \"eye\" and no \"orbit\": expected one of them");
  expect_wrong(frames(good + R"({"eye": [1, 1, 1], "orbit": [1, 1, 1]})"),
               "frames[1]: \"eye\" and \"orbit\": expected one of them");
  expect_wrong(frames(good + R"({"orbit": [1, 1, 1], "target": [1, 1, 1]})"),
               "frames[1]: \"target\" beside \"orbit\": expected it beside \"eye\"");
  expect_wrong(frames(good + R"({"eye": [1, 1]})"), "frames[1]: \"eye\" has 2 numbers: expected 3");
  expect_wrong(frames(good + R"({"eye": [1, 1, 1, 1]})"), "frames[1]: \"eye\" has 4 numbers: expected 3");
  expect_wrong(frames(good + R"({"eye": [1, 1, [1]]})"),
               "frames[1]: \"eye\" holds an array: expected 3 numbers");
  expect_wrong(frames(good + R"({"eye": [1, 1, "1"]})"),
               "frames[1]: \"eye\" holds a text: expected 3 numbers");
  expect_wrong(frames(good + R"({"eye": 1})"),
               "frames[1]: \"eye\" is a number: expected 3 numbers in brackets");
  expect_wrong(frames(good + R"({"eye": [1, 1, 1], "fov": [3]})"),
               "frames[1]: \"fov\" is an array: expected a number");
  expect_wrong(frames(good + R"({"eye": [1, 1, 1], "fov": true})"),
               "frames[1]: \"fov\" is true or false: expected a number");
  expect_wrong(frames(good + R"({"eye": [1, 1, 1], "fov": 180})"),
               "frames[1]: \"fov\" is 180: expected degrees from 0.01 to 179");
  expect_wrong(frames(good + R"({"eye": [1, 1, 1], "roll": 180})"),
               "frames[1]: unknown \"roll\": expected eye, target, orbit, fov or at");
  expect_wrong(frames(good + R"({"eye": [1, 1, 1], "eye": [1, 1, 1]})"),
               "frames[1]: \"eye\" twice: expected it once");
  expect_wrong(frames(good + R"({"eye": [0, 0, 0]})"),
               "frames[1]: frame 1: expected an eye that is not the target");
  expect_wrong(frames(good + R"({"eye": [1e10, 0, 0]})"),
               "frames[1]: frame 1: expected coordinates from -1e9 to 1e9");
  expect_wrong(frames(good + R"({"eye": [1e999, 0, 0]})"),
               "frames[1]: a number too large at byte 46: expected " + form);
  expect_wrong(frames(good + R"({"orbit": [0, 91, 1]})"),
               "frames[1]: \"orbit\": expected an elevation from -90 to 90 and a distance above 0");
  expect_wrong(frames(good + R"({"orbit": [0, 0, 0]})"),
               "frames[1]: \"orbit\": expected an elevation from -90 to 90 and a distance above 0");
}

TEST_F(CameraFile, NumbersOfFramesAscend) {
  const std::string key = R"({"eye": [0, 0, 2], "at": )";
  EXPECT_EQ(frames(key + "0}, " + key + "99999}")->size(), 100000u);
  expect_wrong(frames(key + "1}"), "frames[0]: this is frame 1: expected 0, the first");
  const std::string expected = ": expected a whole number from 3 to 99999";
  for (const char* at : {"2", "1.5", "-1", "3.5", "100000"})
    expect_wrong(frames(key + "0}, " + key + "2}, " + key + at + "}"),
                 std::string("frames[2]: this is frame ") + at + expected);
  expect_wrong(frames(key + R"(0}, {"orbit": [0, 0, 1], "at": 2})"),
               "frames[1]: frames between \"eye\" and \"orbit\": expected both the same");
  // The way leads through the target.
  expect_wrong(frames(key + R"(0}, {"eye": [0, 0, -2], "at": 2})"),
               "frames[1]: frame 1: expected an eye that is not the target");
}

TEST_F(CameraFile, HostileFilesAreRefused) {
  // As deep as a file may be, and as many frames.
  expect_wrong(frames(R"({"eye": )" + std::string(8 << 20, '[')),
               "frames[0]: \"eye\" holds an array: expected 3 numbers");
  std::string deep;
  for (int i = 0; i < 1 << 20; ++i) deep += "{\"frames\":";
  expect_wrong(read(deep),
               "\"frames\" is an object: expected {\"frames\": [{\"eye\": [x, y, z]}, "
               "{\"orbit\": [az, el, dist]}, ...]}");
  std::string many = R"({"eye":[0,0,2]})";
  for (int i = 0; i < 100000; ++i) many += R"(,{"eye":[0,0,2]})";
  expect_wrong(frames(many), "frames[100000]: too many frames: expected at most 100000");
  expect_wrong(read(std::string((16 << 20) + 1, ' ')),
               "a camera path of 16777217 bytes: expected at most 16777216");
  // Every cut of a good file.
  const std::string whole =
      R"({"frames": [{"eye": [0, 0.5, 2], "fov": 30}, {"orbit": [9, 0, 1.5], "at": 1}]})";
  for (size_t length = 0; length < whole.size(); ++length)
    EXPECT_FALSE(read(whole.substr(0, length))) << length;
  EXPECT_TRUE(read(whole));
  EXPECT_FALSE(read_camera_file(path_ + ".none", 45));
}

}  // namespace
}  // namespace voxkit::render
