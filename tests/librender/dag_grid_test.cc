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

Result<std::shared_ptr<const color::Volume>> with_colors_of_nodes(const color::Voxels& voxels, Index3 dims) {
  color::Options options;
  options.colors = color::Colors::all;
  options.codec = color::ColorCodec::raw;
  ListSource source(voxels, dims);
  const auto bytes = std::make_shared<const std::vector<std::byte>>(color::compressed(source, options));
  VOX_TRY(auto container, Container::open(*bytes, "file", bytes));
  return color::Volume::open(container);
}
color::Voxels foliage() {  // of seven colours, with holes
  return color::voxels_where(
      7, [](uint32_t x, uint32_t y, uint32_t z) { return (x * 37 + y * 11 + z * z * 5) % 61 == 0; });
}
CastOptions square(int side) {
  CastOptions options;
  options.width = options.height = side;
  options.details = true;
  return options;
}

/// Close up, where voxels are larger than pixels, and where nodes have no colours, levels of detail change
/// nothing.
TEST(DagGrid, LevelsOfDetailAreForWhatIsFarAndHasColors) {
  Fixture f;
  for (const bool colors : {true, false}) {
    const auto volume = colors ? with_colors_of_nodes(foliage(), Index3(128))
                               : compressed(foliage(), Index3(128), color::Counts::node);
    ASSERT_TRUE(volume);
    CastOptions options = square(64);
    const Camera camera = Camera::orbit(30, 20, colors ? 0.6 : 12, colors ? 20 : 45);
    Frame all, some;
    ASSERT_TRUE(cast(DagGrid(*volume), camera, options, all, f.ctx));
    options.level_of_detail = true;
    ASSERT_TRUE(cast(DagGrid(*volume), camera, options, some, f.ctx));
    EXPECT_GT(all.rays_hit, 0u);
    EXPECT_EQ(std::memcmp(all.pixels.data(), some.pixels.data(), all.pixels.size() * sizeof(Pixel)), 0);
  }
}

/// Whatever the way of a ray through void, with packets and boxes or without, on a device, on any number of
/// threads: it sees the same.
TEST(DagGrid, LevelsOfDetailDoNotDependOnTheWay) {
  Fixture f;
  const std::vector<color::Voxels> scenes = {
      color::sphere_shell(7), foliage(),
      color::voxels_where(7, [](uint32_t x, uint32_t y, uint32_t z) { return x % 40 == y % 24 && z > 9; })};
  for (const color::Voxels& voxels : scenes) {
    const auto volume = with_colors_of_nodes(voxels, Index3(128));
    ASSERT_TRUE(volume);
    const DagGrid grid(*volume);
    const auto uploaded = DeviceGrid::upload(grid, *Backend::open(BackendKind::threads), f.ctx);
    ASSERT_TRUE(uploaded);
    for (const double distance : {0.1, 1.8, 5.0}) {
      const Camera camera = Camera::orbit(33, 20, distance, 45);
      CastOptions options = square(45);
      options.level_of_detail = true;
      Frame expected, frame;
      ASSERT_TRUE(cast(grid, camera, options, expected, f.ctx));
      EXPECT_GT(expected.rays_hit, 0u);
      const auto same = [&] {
        for (size_t i = 0; i < frame.pixels.size(); ++i) {
          ASSERT_EQ(std::memcmp(&frame.pixels[i], &expected.pixels[i], sizeof(Pixel)), 0) << i;
          ASSERT_EQ(std::memcmp(&frame.details[i].voxel, &expected.details[i].voxel, 12), 0) << i;
        }
      };
      for (const Traversal traversal : {Traversal::path, Traversal::restart}) {
        for (const bool plain : {false, true}) {
          options.traversal = traversal;
          options.native = options.skip = !plain;
          f.ctx.threads = plain ? 1 : 3;
          ASSERT_TRUE(cast(grid, camera, options, frame, f.ctx));
          same();
        }
        ASSERT_TRUE((*uploaded)->cast(camera, options, frame, f.ctx));
        same();
      }
    }
  }
}

/// The mean square error of a picture before white, against one with n x n rays for each of its pixels.
double error(const Frame& frame, const Frame& fine, int n) {
  double sum = 0;
  for (int y = 0; y < frame.height; ++y)
    for (int x = 0; x < frame.width; ++x)
      for (int k = 0; k < 3; ++k) {
        const auto seen = [k](const Frame& of, int at_x, int at_y) {
          const Pixel& pixel = of.pixels[static_cast<size_t>(at_y * of.width + at_x)];
          return static_cast<double>(pixel.color[k] + (1 - pixel.color[3]));
        };
        double mean = 0;
        for (int i = 0; i < n * n; ++i) mean += seen(fine, x * n + i % n, y * n + i / n) / (n * n);
        const double off = seen(frame, x, y) - mean;
        sum += off * off;
      }
  return sum / (3.0 * frame.width * frame.height);
}

/// Levels of detail are nearer to what many rays a pixel see than one ray is that sees all detail, and cost
/// less.
TEST(DagGrid, LevelsOfDetailAreNearerToTheTruthAndCheaper) {
  Fixture f;
  const color::Voxels leaves = color::voxels_where(7, [](uint32_t x, uint32_t y, uint32_t z) {
    const uint32_t leaf = (x / 6 * 5 + y / 4 * 3 + z / 5 * 7) % 23;
    return leaf == 0 && (x + y) % 6 == z % 5;
  });
  for (const color::Voxels& voxels : {color::sphere_shell(7), leaves}) {
    const auto volume = with_colors_of_nodes(voxels, Index3(128));
    ASSERT_TRUE(volume);
    for (const double distance : {4.0, 8.0}) {
      const Camera camera = Camera::orbit(30, 20, distance, 20);
      CastOptions options = square(40 * 8);
      Frame fine, all, some;
      ASSERT_TRUE(cast(DagGrid(*volume), camera, options, fine, f.ctx));
      options = square(40);
      ASSERT_TRUE(cast(DagGrid(*volume), camera, options, all, f.ctx));
      options.level_of_detail = true;
      ASSERT_TRUE(cast(DagGrid(*volume), camera, options, some, f.ctx));
      EXPECT_LT(error(some, fine, 8), error(all, fine, 8));
      EXPECT_LT(some.cells_visited, all.cells_visited);
    }
  }
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
