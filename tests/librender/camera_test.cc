// Cameras by name, and the rays that they cast.
#include "librender/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

namespace voxkit::render {
namespace {

TEST(Camera, TextIsChecked) {
  EXPECT_TRUE(parse_camera("orbit:10,20,1.5", 45));
  EXPECT_TRUE(parse_camera("lookat:0,0,2,0,0,0", 45));
  for (const char* wrong : {"", "orbit:", "orbit:1,2", "orbit:1,2,3,4", "orbit:1,91,2", "orbit:1,2,0",
                            "lookat:1,1,1,1,1,1", "orbit:a,b,c", "orbit:1,2,3x", "orbit:nan,0,1"})
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
  info.spacing = {1, 1, 4};
  const GridTransform transform(info);
  EXPECT_NEAR(transform.smallest_edge(), 1.0 / 20, 1e-12);
  EXPECT_NEAR(transform.largest_edge(), 4.0 / 20, 1e-12);
  const glm::dvec3 corner = transform.point({0.25, 0.5, 0.5});
  EXPECT_NEAR(corner.x, 10, 1e-9);
  EXPECT_NEAR(corner.y, 20, 1e-9);
  EXPECT_NEAR(corner.z, 5, 1e-9);
}

}  // namespace
}  // namespace voxkit::render
