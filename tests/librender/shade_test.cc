// Shading: normals, ambient occlusion and anti-aliasing of surfaces that are known.
#include "librender/shade.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <glm/geometric.hpp>

#include "formats/parallel.h"
#include "librender/normals.h"
#include "librender/occlusion.h"

namespace voxkit::render {
namespace {

using glm::dvec3;
/// Whether a voxel, named by its lower corner in units of its edge, is solid.
using Solid = std::function<bool(const dvec3&)>;

constexpr double degrees = 180 / 3.14159265358979;

class ShadeTest : public testing::Test {
 protected:
  Context context(int threads = 2) { return {.threads = threads, .memory = &memory_}; }

  /// What rays through the pixels' centres find among white voxels in the unit box around the origin.
  Frame look(const Camera& camera, int width, int height, double voxel, const Solid& solid) {
    Frame frame;
    frame.width = width;
    frame.height = height;
    frame.pixels.resize(static_cast<size_t>(width * height));
    const RayGenerator rays(camera, width, height);
    const auto inside = [&](const dvec3& p) {
      const dvec3 q = (p + 0.5) / voxel;
      return std::abs(p.x) < 0.5 && std::abs(p.y) < 0.5 && std::abs(p.z) < 0.5 &&
             solid(dvec3(std::floor(q.x), std::floor(q.y), std::floor(q.z)));
    };
    const double step = voxel / 16, from = glm::length(camera.eye) - 0.9;
    EXPECT_TRUE(parallel_for(context(), height, [&](int64_t y) -> Status {
      for (int x = 0; x < width; ++x) {
        const dvec3 d = rays.direction(x + 0.5, static_cast<double>(y) + 0.5);
        double t = from;
        while (t < from + 1.8 && !inside(rays.eye() + d * t)) t += step;
        if (t >= from + 1.8) continue;
        double before = t - step;
        for (int i = 0; i < 30; ++i) {
          const double middle = (before + t) / 2;
          (inside(rays.eye() + d * middle) ? t : before) = middle;
        }
        Pixel& pixel = frame.pixels[static_cast<size_t>(y * width + x)];
        pixel.distance = static_cast<float>(t);
        for (float& c : pixel.color) c = 1;
      }
      return {};
    }));
    return frame;
  }

  struct Errors {
    double mean = 0, greatest = 0;  ///< degrees
    int count = 0;
  };
  /// Angles between the normals found and those expected; where that is zero, it does not count.
  Errors errors(const Frame& frame, const Camera& camera, double voxel,
                const std::function<dvec3(const dvec3&)>& expected) {
    Context ctx = context();
    const auto picture = shade(frame, camera, voxel, {.normals = true}, ctx);
    EXPECT_TRUE(picture && picture->normals);
    const RayGenerator rays(camera, frame.width, frame.height);
    Errors result;
    for (int y = 0; y < frame.height; ++y)
      for (int x = 0; x < frame.width; ++x) {
        const Pixel& pixel = frame.pixels[static_cast<size_t>(y * frame.width + x)];
        if (!std::isfinite(pixel.distance)) continue;
        const dvec3 d = rays.direction(x + 0.5, y + 0.5), p = rays.eye() + d * double{pixel.distance};
        const dvec3 normal = expected(p);
        if (normal == dvec3(0) || -glm::dot(normal, d) < 0.3) continue;
        const float* n = picture->normals->row(y) + 3 * x;
        EXPECT_NEAR(glm::length(dvec3(n[0], n[1], n[2])), 1, 1e-5);
        const double angle =
            std::acos(std::clamp(glm::dot(dvec3(n[0], n[1], n[2]), normal), -1.0, 1.0)) * degrees;
        result.mean += angle;
        result.greatest = std::max(result.greatest, angle);
        ++result.count;
      }
    result.mean /= result.count;
    return result;
  }

  MemoryBudget memory_{uint64_t{1} << 30};
};

const auto everything = [](const dvec3&) { return true; };

TEST_F(ShadeTest, NormalsOfASpherePointOutwards) {
  for (const int size : {120, 300}) {  // a voxel is 1.4 and 3.4 pixels wide
    const Camera camera = Camera::orbit(35, 25, 2, 40);
    const Frame frame = look(camera, size, size, 1.0 / 64,
                             [](const dvec3& v) { return glm::length(v + dvec3(0.5) - dvec3(32)) < 28; });
    const Errors e = errors(frame, camera, 1.0 / 64, [](const dvec3& p) { return p / glm::length(p); });
    EXPECT_GT(e.count, size * size / 5);
    EXPECT_LT(e.mean, 3) << size;
    EXPECT_LT(e.greatest, 30) << size;
  }
}

TEST_F(ShadeTest, AFlatFaceHasOneNormal) {
  const Camera camera = Camera::orbit(30, 20, 1.8, 45);
  const Frame frame = look(camera, 200, 150, 1.0 / 40, everything);
  int faces[3] = {};
  const Errors e = errors(frame, camera, 1.0 / 40, [&](const dvec3& p) {
    // Away from the edges of the box, which are rounded over a few voxels.
    for (int a = 0; a < 3; ++a)
      if (std::abs(p[a]) > 0.4999 && std::abs(p[(a + 1) % 3]) < 0.5 - 4.6 / 40 &&
          std::abs(p[(a + 2) % 3]) < 0.5 - 4.6 / 40) {
        ++faces[a];
        dvec3 normal(0);
        normal[a] = p[a] > 0 ? 1 : -1;
        return normal;
      }
    return dvec3(0);
  });
  for (const int count : faces) EXPECT_GT(count, 200);
  EXPECT_LT(e.greatest, 0.1);
}

TEST_F(ShadeTest, StepsOfAVoxelAreASlope) {
  const double slopes[] = {0.5, 1, 2};
  for (const double slope : slopes) {
    const Camera camera = Camera::orbit(20, 50, 1.6, 40);
    const Frame frame =
        look(camera, 200, 150, 1.0 / 50, [&](const dvec3& v) { return v.y - 25 < -slope * (v.z - 25); });
    const dvec3 normal = glm::normalize(dvec3(0, 1, slope));
    const Errors e = errors(frame, camera, 1.0 / 50, [&](const dvec3& p) {
      const double off = std::abs(p.y + slope * p.z);
      const bool border = std::abs(p.x) > 0.38 || std::abs(p.y) > 0.38 || std::abs(p.z) > 0.38;
      return border || off > 0.1 ? dvec3(0) : normal;
    });
    EXPECT_GT(e.count, 2000);
    EXPECT_LT(e.mean, 4) << slope;
    EXPECT_LT(e.greatest, 16) << slope;
  }
}

TEST_F(ShadeTest, OpennessIsThatOfTheSurface) {
  // A floor with a wall on it.
  const Solid room = [](const dvec3& v) { return v.y < 20 || v.z < 10; };
  const double voxel = 1.0 / 80;
  const Camera camera = Camera::orbit(0, 50, 2, 40);
  const Frame frame = look(camera, 220, 220, voxel, room);
  Context ctx = context();
  const auto surface = Surface::create(frame, camera, voxel, ctx);
  ASSERT_TRUE(surface);
  const auto normals = find_normals(*surface, ctx);
  ASSERT_TRUE(normals);
  const auto openness = find_openness(*surface, *normals, ctx);
  ASSERT_TRUE(openness);
  int open = 0, corner = 0, rough = 0, pixels = 0;
  for (int y = 1; y < 220; ++y)
    for (int x = 1; x < 220; ++x) {
      const float value = openness->row(y)[x];
      ASSERT_GE(value, 0);
      ASSERT_LE(value, 1);
      if (!Surface::hit((*surface)(x, y))) {
        ASSERT_EQ(value, 1);
        continue;
      }
      const dvec3 p = camera.eye + dvec3((*surface)(x, y).at);
      if (std::abs(p.x) > 0.4 || std::abs(p.y + 0.25) > 1e-3) continue;  // the floor
      if (p.z > 0.1 && p.z < 0.4) {
        EXPECT_GT(value, 0.97) << x << "," << y;
        ++open;
      }
      if (p.z > -0.375 + 3 * voxel && p.z < -0.375 + 6 * voxel) {
        EXPECT_LT(value, 0.87) << x << "," << y;
        ++corner;
      }
      // No pattern from pixel to pixel along the wall.
      rough += std::abs(value - openness->row(y)[x - 1]) > 0.04f;
      ++pixels;
    }
  EXPECT_GT(open, 1000);
  EXPECT_GT(corner, 100);
  EXPECT_LT(rough, pixels / 100);
}

TEST_F(ShadeTest, WithoutShadingTheColorsAreThoseGathered) {
  Frame frame;
  frame.width = 2;
  frame.height = 1;
  frame.pixels.resize(2);
  frame.pixels[0].distance = 1;
  const float gathered[] = {0.25f, 0.125f, 0, 0.5f};
  std::copy_n(gathered, 4, frame.pixels[0].color);
  Context ctx = context();
  const ShadeOptions options{.phong = false, .background = {1, 0.5f, 0}};
  const auto picture = shade(frame, Camera{}, 0.01, options, ctx);
  ASSERT_TRUE(picture);
  EXPECT_FALSE(picture->normals);
  const float expected[] = {0.75f, 0.375f, 0, 1, 1, 0.5f, 0, 1};
  for (int i = 0; i < 8; ++i) EXPECT_EQ(picture->rgba.row(0)[i], expected[i]) << i;
}

TEST_F(ShadeTest, LightComesOverTheLeftShoulder) {
  // A ball: brighter at the upper left than at the lower right.
  const Camera camera = Camera::orbit(0, 0, 2, 40);
  const Frame frame = look(camera, 101, 101, 1.0 / 64,
                           [](const dvec3& v) { return glm::length(v + dvec3(0.5) - dvec3(32)) < 30; });
  Context ctx = context();
  const auto picture = shade(frame, camera, 1.0 / 64, {}, ctx);
  ASSERT_TRUE(picture);
  const auto grey = [&](int x, int y) { return picture->rgba.row(y)[4 * x]; };
  EXPECT_GT(grey(35, 35), grey(50, 50));
  EXPECT_GT(grey(50, 50), grey(65, 65));
  EXPECT_GT(grey(65, 65), 0.25f);
}

TEST_F(ShadeTest, DepthAntialiasingBlendsStepsOnly) {
  const Camera camera = Camera::orbit(45, 35, 2, 45);
  const Frame frame = look(camera, 120, 90, 1.0 / 40, everything);
  Context ctx = context();
  const auto sharp = shade(frame, camera, 1.0 / 40, {}, ctx);
  const auto soft = shade(frame, camera, 1.0 / 40, {.depth_antialias = true}, ctx);
  ASSERT_TRUE(sharp && soft);
  const auto hit = [&](int x, int y) {
    return std::isfinite(frame.pixels[static_cast<size_t>(y * 120 + x)].distance);
  };
  // At the silhouette every pixel changes, and well inside none; near it the faces are too oblique to tell.
  const auto near_silhouette = [&](int x, int y, int distance) {
    for (int v = -distance; v <= distance; ++v)
      for (int u = -distance; u <= distance; ++u)
        if (hit(x + u, y + v) != hit(x, y)) return true;
    return false;
  };
  int edges = 0, inside = 0;
  for (int y = 3; y < 87; ++y)
    for (int x = 3; x < 117; ++x) {
      const bool same = std::memcmp(sharp->rgba.row(y) + 4 * x, soft->rgba.row(y) + 4 * x, 16) == 0;
      if (near_silhouette(x, y, 1)) {
        EXPECT_FALSE(same) << x << "," << y;
        ++edges;
      } else if (!near_silhouette(x, y, 3)) {
        EXPECT_TRUE(same) << x << "," << y;
        inside += hit(x, y);
      }
    }
  EXPECT_GT(edges, 200);
  EXPECT_GT(inside, 1000);
}

TEST_F(ShadeTest, AnyNumberOfThreadsGivesTheSame) {
  const Camera camera = Camera::orbit(30, 20, 1.8, 45);
  const Frame frame = look(camera, 97, 71, 1.0 / 40, [](const dvec3& v) {
    return (static_cast<int>(v.x) / 8 + static_cast<int>(v.y) / 8 + static_cast<int>(v.z) / 8) % 2 == 0;
  });
  const ShadeOptions options{.ssao = true, .depth_antialias = true, .normals = true};
  Context one = context(1), seven = context(7);
  const auto a = shade(frame, camera, 1.0 / 40, options, one);
  const auto b = shade(frame, camera, 1.0 / 40, options, seven);
  ASSERT_TRUE(a && b);
  EXPECT_EQ(std::memcmp(a->rgba.row(0), b->rgba.row(0), 97 * 71 * 16), 0);
  EXPECT_EQ(std::memcmp(a->normals->row(0), b->normals->row(0), 97 * 71 * 12), 0);
}

TEST_F(ShadeTest, MemoryIsLimited) {
  const Camera camera = Camera::orbit(30, 20, 1.8, 45);
  const Frame frame = look(camera, 64, 64, 1.0 / 8, everything);
  const ShadeOptions most{.ssao = true, .depth_antialias = true, .normals = true};
  MemoryBudget enough(64 * 64 * shading_bytes), little(64 * 64 * shading_bytes - 1);
  Context ctx{.threads = 1, .memory = &enough};
  EXPECT_TRUE(shade(frame, camera, 1.0 / 8, most, ctx));
  ctx.memory = &little;
  const auto refused = shade(frame, camera, 1.0 / 8, most, ctx);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::limit);
}

TEST_F(ShadeTest, DownsamplingAverages) {
  Context ctx = context();
  auto image = Image::create(6, 4, 4, SampleType::f32, ctx);
  ASSERT_TRUE(image);
  for (int i = 0; i < 6 * 4 * 4; ++i) image->row(0)[i] = static_cast<float>(i);
  const auto half = downsample(*image, 2, ctx);
  ASSERT_TRUE(half);
  ASSERT_EQ(half->width(), 3);
  ASSERT_EQ(half->height(), 2);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 3; ++x)
      for (int k = 0; k < 4; ++k)
        EXPECT_EQ(half->row(y)[4 * x + k],
                  (image->row(2 * y)[8 * x + k] + image->row(2 * y)[8 * x + 4 + k] +
                   image->row(2 * y + 1)[8 * x + k] + image->row(2 * y + 1)[8 * x + 4 + k]) /
                      4);
}

}  // namespace
}  // namespace voxkit::render
