// Compressed surfaces: the picture of the DAG is that of its voxels, one by one, bit by bit.
#include <gtest/gtest.h>

#include <cstring>

#include "libcolor/color.h"
#include "libcolor/store.h"
#include "librender/camera.h"
#include "librender/cast/ray_cast.h"
#include "librender/device/device_grid.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::render {
namespace {

struct Fixture {
  MemoryBudget memory;
  Context ctx;
  Fixture() {
    ctx.memory = &memory;
    ctx.threads = 3;
  }
};

using color::ListSource;

Result<std::shared_ptr<const color::Volume>> compressed(const color::Voxels& voxels, Index3 dims,
                                                        color::Counts counts) {
  ListSource source(voxels, dims);
  color::Options options;
  options.counts = counts;
  const auto bytes = std::make_shared<const std::vector<std::byte>>(color::compressed(source, options));
  VOX_TRY(auto container, Container::open(*bytes, "file", bytes));
  return color::Volume::open(container);
}

TEST(DagGrid, PicturesAreThoseOfTheVoxels) {
  const std::vector<std::pair<color::Voxels, Index3>> scenes = {
      {{}, Index3(9)},
      {{{63, {9, 200, 31}}}, Index3(4)},
      {color::sphere_shell(6), Index3(64)},
      {color::voxels_where(5,
                           [](uint32_t x, uint32_t y, uint32_t z) {
                             return x < 20 && y < 31 && z < 9 && (x * 7 + y * 3 + z) % 11 == 0;
                           }),
       Index3(20, 31, 9)},
      {color::voxels_where(
           6, [](uint32_t x, uint32_t y, uint32_t z) { return x == y || (z == 5 && x % 9 == 0); }),
       Index3(64)}};
  for (const auto& [voxels, dims] : scenes)
    for (const color::Counts counts : {color::Counts::node, color::Counts::pointer}) {
      Fixture f;
      const auto volume = compressed(voxels, dims, counts);
      ASSERT_TRUE(volume) << volume.error().what;
      const auto decoded = color::open_source(*volume);
      const auto dense = DenseGrid::read(*decoded, f.ctx);
      ASSERT_TRUE(dense);
      const DagGrid grid(*volume);
      const auto uploaded = DeviceGrid::upload(grid, *Backend::open(BackendKind::threads), f.ctx);
      ASSERT_TRUE(uploaded);
      for (const double distance : {0.2, 0.9, 1.8})
        for (const double azimuth : {0.0, 33.0, 215.0}) {
          const Camera camera = Camera::orbit(azimuth, 20, distance, 45);
          CastOptions options;
          options.width = 97;
          options.height = 64;
          options.details = true;
          Frame expected, frame;
          ASSERT_TRUE(cast(**dense, camera, options, expected, f.ctx));
          for (const Traversal traversal : {Traversal::path, Traversal::restart})
            for (const bool native : {true, false}) {
              options.traversal = traversal;
              options.native = native;
              ASSERT_TRUE(cast(grid, camera, options, frame, f.ctx));
              EXPECT_EQ(frame.rays_hit, expected.rays_hit);
              for (size_t i = 0; i < frame.pixels.size(); ++i) {
                for (int k = 0; k < 4; ++k) ASSERT_EQ(frame.pixels[i].color[k], expected.pixels[i].color[k]);
                ASSERT_EQ(frame.pixels[i].distance, expected.pixels[i].distance);
                for (int a = 0; a < 3; ++a)
                  ASSERT_EQ(frame.details[i].voxel[a], expected.details[i].voxel[a]);
              }
            }
          // The kernel of the GPU, and colours looked up after it.
          for (const Traversal traversal : {Traversal::path, Traversal::restart}) {
            options.traversal = traversal;
            Frame device;
            ASSERT_TRUE((*uploaded)->cast(camera, options, device, f.ctx));
            EXPECT_EQ(device.rays_hit, expected.rays_hit);
            for (size_t i = 0; i < frame.pixels.size(); ++i) {
              ASSERT_EQ(std::memcmp(&device.pixels[i], &expected.pixels[i], sizeof(Pixel)), 0);
              ASSERT_EQ(std::memcmp(&device.details[i].voxel, &expected.details[i].voxel, 12), 0);
            }
          }
        }
    }
}

/// Far away a ray ends at the first node that is as small as a pixel, and sees its colour.
TEST(DagGrid, LevelsOfDetail) {
  Fixture f;
  color::Options settings;
  settings.colors = color::Colors::all;
  ListSource source(color::sphere_shell(7), Index3(128));
  auto bytes = std::make_shared<std::vector<std::byte>>(color::compressed(source, settings));
  auto container = Container::open(*bytes, "file", bytes);
  ASSERT_TRUE(container);
  const auto volume = color::Volume::open(*container);
  ASSERT_TRUE(volume);
  const DagGrid grid(*volume);
  CastOptions options;
  options.width = options.height = 64;
  options.details = true;
  // Close up voxels are larger than pixels.
  Frame all, some;
  ASSERT_TRUE(cast(grid, Camera::orbit(30, 20, 0.6, 20), options, all, f.ctx));
  options.level_of_detail = true;
  ASSERT_TRUE(cast(grid, Camera::orbit(30, 20, 0.6, 20), options, some, f.ctx));
  for (size_t i = 0; i < all.pixels.size(); ++i)
    for (int k = 0; k < 4; ++k) ASSERT_EQ(all.pixels[i].color[k], some.pixels[i].color[k]);
  // From afar each pixel has the colour of a node around the voxel, as large as the cone there or half of it.
  const Camera far = Camera::orbit(30, 20, 12, 45);
  for (const Traversal traversal : {Traversal::path, Traversal::restart}) {
    options.traversal = traversal;
    ASSERT_TRUE(cast(grid, far, options, some, f.ctx));
    EXPECT_GT(some.rays_hit, 0u);
    const auto dag = (*volume)->store().dag((*volume)->container(), (*volume)->params());
    ASSERT_TRUE(dag);
    bool coarse = false;
    for (size_t i = 0; i < some.pixels.size(); ++i) {
      const int32_t(&v)[3] = some.details[i].voxel;
      if (v[0] < 0) continue;
      const uint64_t place = color::morton_code(static_cast<uint32_t>(v[0]), static_cast<uint32_t>(v[1]),
                                                static_cast<uint32_t>(v[2]));
      bool found = false;
      for (int h = 0; h <= 7; ++h) {
        const color::Found cell = color::find_cell(**dag, place, h);
        if (!cell.there) continue;
        const color::Rgb c = *(*volume)->color(cell.color);
        const bool same = std::abs(some.pixels[i].color[0] * 255 - c.r) < 0.01f &&
                          std::abs(some.pixels[i].color[1] * 255 - c.g) < 0.01f &&
                          std::abs(some.pixels[i].color[2] * 255 - c.b) < 0.01f;
        found |= same;
        coarse |= same && h > 2;
      }
      EXPECT_TRUE(found);
    }
    EXPECT_TRUE(coarse);
  }
  options.level_of_detail = false;
  ASSERT_TRUE(cast(grid, far, options, all, f.ctx));
  EXPECT_LT(some.blocks_touched, all.blocks_touched);
}

TEST(DagGrid, EmptySpaceIsCrossedInFewSteps) {
  Fixture f;
  const auto volume = compressed({{(uint64_t{1} << 36) - 1, {}}}, Index3(4096), color::Counts::node);
  ASSERT_TRUE(volume);
  CastOptions options;
  options.width = options.height = 32;
  Frame frame;
  ASSERT_TRUE(cast(DagGrid(*volume), Camera::orbit(30, 20, 1.8, 45), options, frame, f.ctx));
  EXPECT_LT(frame.cells_visited, frame.rays * 40);
}

TEST(DagGrid, DamagedColorsAreAnError) {
  Fixture f;
  ListSource source(color::sphere_shell(5), Index3(32));
  const auto bytes = std::make_shared<std::vector<std::byte>>(color::compressed(source, {}));
  auto container = Container::open(*bytes, "file", bytes);
  ASSERT_TRUE(container);
  for (const ChunkEntry& entry : (*container)->table())
    if (entry.kind == chunk_kind("COLR")) (*bytes)[entry.offset + 9] ^= std::byte{1};
  container = Container::open(*bytes, "file", bytes);
  ASSERT_TRUE(container);
  const auto volume = color::Volume::open(*container);
  ASSERT_TRUE(volume);
  Frame frame;
  const Status status = cast(DagGrid(*volume), Camera::orbit(30, 20, 1.8, 45), {}, frame, f.ctx);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::input);
}

}  // namespace
}  // namespace voxkit::render
