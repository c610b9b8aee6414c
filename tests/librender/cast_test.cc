// Pictures of compressed volumes are those of the volumes themselves, pixel by pixel.
#include <gtest/gtest.h>

#include <cmath>

#include "formats/volume/readers.h"
#include "librender/cast/ray_cast.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::render {
namespace {

using svmm::test::context;

std::shared_ptr<const svmm::Volume> compress(const char* name, double quality, std::vector<int> widths,
                                             svmm::Base base = svmm::Base::raw) {
  auto source = open_builtin(name);
  svmm::Params params = svmm::test::make_params((*source)->info().format, quality, std::move(widths), 4);
  params.base = base;
  return svmm::test::encode_to_memory(**source, params).open();
}

std::shared_ptr<const DenseGrid> dense(VolumeSource& source) {
  static MemoryBudget budget(uint64_t{1} << 32);
  Context ctx = context();
  ctx.memory = &budget;
  auto grid = DenseGrid::read(source, ctx);
  EXPECT_TRUE(grid);
  return *grid;
}

CastOptions small() {
  CastOptions options;
  options.width = 97;
  options.height = 71;
  options.range = {0, 255};
  return options;
}

/// A picture with all that is known of its pixels.
template <class Grid>
Result<Frame> cast(const Grid& grid, const Camera& camera, CastOptions options, Context& ctx) {
  Frame frame;
  options.details = true;
  VOX_CHECK(render::cast(grid, camera, options, frame, ctx));
  return frame;
}

/// What was seen, without what it cost.
void expect_same_pixels(const Frame& a, const Frame& b, double tolerance) {
  ASSERT_EQ(a.pixels.size(), b.pixels.size());
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    for (int k = 0; k < 3; ++k) ASSERT_EQ(a.details[i].voxel[k], b.details[i].voxel[k]) << "pixel " << i;
    ASSERT_EQ(a.pixels[i].distance, b.pixels[i].distance) << "pixel " << i;
    for (int k = 0; k < 4; ++k)
      ASSERT_NEAR(a.pixels[i].color[k], b.pixels[i].color[k], tolerance) << "pixel " << i;
  }
}

TEST(Cast, CompressedEqualsDenseForEveryTraversalAndThreadCount) {
  for (const char* name : {"menger:3", "menger:4", "sphere:40", "membrane:60,50,9:2"}) {
    auto source = open_builtin(name);
    const auto grid = dense(**source);
    // Opaque voxels give the same colours to the bit; gathered opacity is rounded once a cell instead of once
    // a voxel.
    const double tolerance = (*source)->info().format == VoxelFormat::rgba32 ? 0 : 2e-6;
    for (std::vector<int> widths : {std::vector<int>{}, std::vector<int>{4}}) {
      const SvmmGrid compressed(compress(name, 100, widths));
      for (const Camera& camera :
           {Camera::orbit(30, 20, 1.8, 45), Camera::orbit(0, 0, 2, 45), Camera::orbit(45, -35, 0.6, 70),
            Camera::orbit(90, 90, 1.5, 45), Camera{{0, 0, 0}, {1, 0.3, 0.2}, 60}}) {
        CastOptions options = small();
        Context one = context(1), seven = context(7);
        const auto expected = cast(*grid, camera, options, one);
        ASSERT_TRUE(expected);
        EXPECT_GT(expected->rays_hit, 100u);
        const auto path = cast(compressed, camera, options, one);
        ASSERT_TRUE(path);
        expect_same_pixels(*expected, *path, tolerance);
        EXPECT_LE(path->cells_visited, expected->cells_visited);
        const auto threads = cast(compressed, camera, options, seven);
        expect_same_pixels(*path, *threads, 0);
        options.traversal = Traversal::restart;
        const auto restart = cast(compressed, camera, options, one);
        expect_same_pixels(*path, *restart, 0);
        EXPECT_GE(restart->blocks_touched, path->blocks_touched);
        options.level_of_detail = true;
        const auto coarse_restart = cast(compressed, camera, options, one);
        options.traversal = Traversal::path;
        const auto coarse_path = cast(compressed, camera, options, one);
        expect_same_pixels(*coarse_path, *coarse_restart, 0);
      }
    }
  }
}

TEST(Cast, BaselineSeesNearlyTheSame) {
  auto source = open_builtin("menger:3");
  const auto grid = dense(**source);
  CastOptions options = small();
  Context ctx = context();
  const Camera camera = Camera::orbit(30, 20, 1.8, 45);
  const auto exact = cast(*grid, camera, options, ctx);
  options.traversal = Traversal::baseline;
  const auto baseline = cast(*grid, camera, options, ctx);
  int differing = 0;
  for (size_t i = 0; i < exact->pixels.size(); ++i)
    differing +=
        !std::equal(exact->details[i].voxel, exact->details[i].voxel + 3, baseline->details[i].voxel);
  EXPECT_LE(differing, 3);  // it adds up floats: a ray near an edge may see another voxel
  EXPECT_FALSE(cast(SvmmGrid(compress("menger:3", 100, {})), camera, options, ctx));
}

/// It is the volume that is wrong, not where the camera is.
TEST(Cast, VoxelsThatAreTooUnequalAreRefused) {
  VolumeInfo info;
  info.dims = Index3(4);
  for (const double edge : {1e12, 1e-12, 1e300}) {
    info.affine = Affine::plain({1, 1, edge}, {});
    test::MemorySource source(info, std::vector<std::byte>(64));
    const auto grid = dense(source);
    Context ctx = context();
    const auto frame = cast(*grid, Camera::orbit(30, 20, 1.8, 45), small(), ctx);
    ASSERT_FALSE(frame);
    EXPECT_EQ(frame.error().code, ErrorCode::input) << edge;
  }
}

TEST(Cast, EveryBaseIsDrawnAsItIsDecoded) {
  using svmm::Base;
  for (const Base base : {Base::bitmap, Base::alpha, Base::gray, Base::bc1})
    for (const int w : {2, 4}) {
      if (base == Base::bc1 && w == 2) continue;
      const auto volume = compress("menger:3", 90, {w}, base);
      auto decoded = svmm::open_source(volume, 0);
      ASSERT_TRUE(decoded);
      Context ctx = context();
      const Camera camera = Camera::orbit(200, 30, 1.6, 45);
      const auto expected = cast(*dense(**decoded), camera, small(), ctx);
      const auto drawn = cast(SvmmGrid(volume), camera, small(), ctx);
      expect_same_pixels(*expected, *drawn, 0);
    }
}

TEST(Cast, ASphereIsRoundAndInTheMiddle) {
  auto source = open_builtin("sphere:64");
  CastOptions options = small();
  options.width = options.height = 101;
  Context ctx = context();
  const auto frame = cast(*dense(**source), Camera::orbit(20, 10, 3, 30), options, ctx);
  double x = 0, y = 0, area = 0;
  for (int row = 0; row < 101; ++row)
    for (int column = 0; column < 101; ++column)
      if (std::isfinite(frame->pixels[static_cast<size_t>(row * 101 + column)].distance))
        x += column, y += row, ++area;
  EXPECT_NEAR(x / area, 50, 0.5);
  EXPECT_NEAR(y / area, 50, 0.5);
  // Radius 0.4 (and half a voxel of soft edge) at distance 3: the silhouette's sine is 0.4 / 3.
  const double radius =
      std::tan(std::asin((0.4 + 0.5 / 64) / 3)) / (2 * std::tan(15 * 3.14159265358979 / 180) / 101);
  EXPECT_NEAR(area / (3.14159265358979 * radius * radius), 1, 0.03);
  const auto& centre = frame->pixels[50 * 101 + 50];
  EXPECT_NEAR(centre.distance, 2.6 - 0.5 / 64, 2.0 / 64);
}

}  // namespace
}  // namespace voxkit::render
