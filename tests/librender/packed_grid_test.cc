// Packed volumes drawn page by page: the picture is that of the voxels, of the levels, of what is there.
#include "librender/cast/packed_grid.h"

#include <gtest/gtest.h>

#include <random>

#include "librender/camera.h"
#include "librender/cast/ray_cast.h"
#include "tests/libsvmm/packed_files.h"
#include "tests/memory_volume.h"

namespace voxkit::render {
namespace {

using svmm::test::context;

VolumeInfo info_of(Index3 dims, VoxelFormat format) {
  VolumeInfo info;
  info.dims = dims;
  info.format = format;
  info.sample_type = format == VoxelFormat::float32     ? SampleType::f32
                     : format == VoxelFormat::density16 ? SampleType::u16
                                                        : SampleType::u8;
  return info;
}

/// A ball with a core, in nothing; of colours translucent ones.
std::vector<std::byte> ball(const VolumeInfo& info) {
  std::mt19937 random(3);
  std::vector<std::byte> out;
  const auto put = [&](auto value) {
    const auto* const bytes = reinterpret_cast<const std::byte*>(&value);
    out.insert(out.end(), bytes, bytes + sizeof(value));
  };
  const Index3 middle = info.dims / int64_t{2};
  for (int64_t z = 0; z < info.dims.z; ++z)
    for (int64_t y = 0; y < info.dims.y; ++y)
      for (int64_t x = 0; x < info.dims.x; ++x) {
        const Index3 d = Index3(x, y, z) - middle;
        const int64_t r2 = d.x * d.x + d.y * d.y + d.z * d.z;
        const auto noise = static_cast<uint32_t>(random() % 30), v = r2 > 200 ? 0 : r2 < 60 ? 90 : 10 + noise;
        switch (info.format) {
          case VoxelFormat::float32:
            put(static_cast<float>(v));
            break;
          case VoxelFormat::density16:
            put(static_cast<uint16_t>(v));
            break;
          case VoxelFormat::rgba32:
            put(v == 0 ? 0u : v << 24 | 0x30a050u);
            break;
          default:
            put(static_cast<uint8_t>(v));
        }
      }
  return out;
}

Frame draw(const auto& grid, const Camera& camera, CastOptions options) {
  Context ctx = context(2);
  options.width = 90;
  options.height = 70;
  options.details = true;
  options.range = {0, 255};
  Frame frame;
  const Status status = cast(grid, camera, options, frame, ctx);
  EXPECT_TRUE(status) << status.error().what;
  return frame;
}
std::shared_ptr<const DenseGrid> dense(VolumeSource& source) {
  Context ctx = context(2);
  auto grid = DenseGrid::read(source, ctx);
  EXPECT_TRUE(grid);
  return *grid;
}
/// Cells of one value are crossed at once, so sums are rounded otherwise.
void expect_alike(const Frame& a, const Frame& b) {
  EXPECT_EQ(a.rays_hit, b.rays_hit);
  ASSERT_EQ(a.pixels.size(), b.pixels.size());
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    for (int k = 0; k < 4; ++k) ASSERT_NEAR(a.pixels[i].color[k], b.pixels[i].color[k], 2e-6);
    for (int k = 0; k < 3; ++k) ASSERT_EQ(a.details[i].voxel[k], b.details[i].voxel[k]);
  }
}

TEST(PackedGrid, PicturesAreThoseOfTheVoxels) {
  for (const VoxelFormat format :
       {VoxelFormat::density8, VoxelFormat::density16, VoxelFormat::float32, VoxelFormat::rgba32})
    for (const bool levels : {true, false})
      for (const int page : {8, 16}) {
        const VolumeInfo info = info_of({50, 37, 45}, format);
        test::MemorySource source(info, ball(info));
        const auto file = svmm::test::encode(source, {.levels = levels, .page_side = page});
        const PackedGrid grid(svmm::test::open(file.bytes));
        const auto voxels = dense(source);
        for (const double distance : {0.2, 1.4})
          for (const double azimuth : {0.0, 200.0}) {
            const Camera camera = Camera::orbit(azimuth, 20, distance, 45);
            const Frame frame = draw(grid, camera, {}), expected = draw(*voxels, camera, {});
            EXPECT_GT(frame.rays_hit, 200u);
            EXPECT_LE(frame.cells_visited, expected.cells_visited);
            expect_alike(frame, expected);
          }
      }
}

TEST(PackedGrid, PagesAreDecodedWhereRaysCome) {
  const VolumeInfo info = info_of({64, 64, 64}, VoxelFormat::density8);
  std::vector<std::byte> voxels(64 * 64 * 64);
  std::mt19937 random(1);
  for (std::byte& v : voxels) v = static_cast<std::byte>(200 + random() % 56);  // opaque before long
  test::MemorySource source(info, voxels);
  const auto volume = svmm::test::open(svmm::test::encode(source, {.levels = false}).bytes);
  const PackedGrid grid(volume);
  EXPECT_EQ(volume->pages_decoded(), 0u);
  const Camera camera = Camera::orbit(0, 0, 1.5, 45);
  const Frame first = draw(grid, camera, {});
  EXPECT_GT(first.pages_decoded, 0u);
  EXPECT_LE(volume->pages_decoded(), 40u);  // of 64; a page may be decoded by two threads at once
  EXPECT_EQ(draw(grid, camera, {}).pages_decoded, 0u);
}

TEST(PackedGrid, LevelsOfDetailAreThoseOfTheFile) {
  for (const VoxelFormat format : {VoxelFormat::density8, VoxelFormat::rgba32}) {
    const VolumeInfo info = info_of({64, 64, 64}, format);
    test::MemorySource source(info, ball(info));
    const auto volume = svmm::test::open(svmm::test::encode(source, {}).bytes);
    const PackedGrid grid(volume);
    const Camera far = Camera::orbit(30, 20, 12, 20);
    const Frame all = draw(grid, far, {}), coarse = draw(grid, far, {.level_of_detail = true});
    EXPECT_GT(all.rays_hit, 10u);
    EXPECT_LT(coarse.cells_visited, draw(*dense(source), far, {}).cells_visited / 2);
    // The light that comes from the volume as a whole is nearly the same.
    double sums[2] = {0, 0};
    for (size_t i = 0; i < all.pixels.size(); ++i) {
      sums[0] += static_cast<double>(all.pixels[i].color[3]);
      sums[1] += static_cast<double>(coarse.pixels[i].color[3]);
    }
    EXPECT_NEAR(sums[1] / sums[0], 1, 0.1);
    // Near by there is all detail.
    const Camera near = Camera::orbit(30, 20, 0.3, 20);
    expect_alike(draw(grid, near, {.level_of_detail = true}), draw(grid, near, {}));
  }
}

TEST(PackedGrid, OfAFileThatWasCutTheFinestLevelIsDrawn) {
  const VolumeInfo info = info_of({50, 37, 45}, VoxelFormat::density8);
  test::MemorySource source(info, ball(info));
  auto file = svmm::test::encode(source, {}).bytes;
  file.resize(svmm::test::open(file)->levels()[1].end);
  const auto volume = svmm::test::open(file);
  ASSERT_EQ(volume->finest(), 1);
  const PackedGrid grid(volume);
  EXPECT_EQ(grid.info().dims, Index3(25, 19, 23));
  const auto level = svmm::open_source(volume, 1);
  ASSERT_TRUE(level);
  const Camera camera = Camera::orbit(30, 20, 1.4, 45);
  expect_alike(draw(grid, camera, {}), draw(*dense(**level), camera, {}));
}

TEST(PackedGrid, DamagedPagesAreNamed) {
  const VolumeInfo info = info_of({50, 37, 45}, VoxelFormat::density8);
  test::MemorySource source(info, ball(info));
  auto file = svmm::test::encode(source, {.levels = false}).bytes;
  const auto whole = Container::open(file, "file", std::make_shared<test::Bytes>(file));
  ASSERT_TRUE(whole);
  for (const ChunkEntry& entry : (*whole)->table())
    if (entry.kind == chunk_kind("PAGE"))
      for (uint64_t i = entry.length / 2; i < entry.length; ++i) file[entry.offset + i] = std::byte{0xff};
  test::reseal(file);
  const PackedGrid grid(svmm::test::open(file));
  Context ctx = context(2);
  Frame frame;
  const Status status = cast(grid, Camera::orbit(30, 20, 1.4, 45), {.width = 40, .height = 30}, frame, ctx);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::input);
  EXPECT_NE(status.error().what.find("level 0, page at "), std::string::npos) << status.error().what;
}

}  // namespace
}  // namespace voxkit::render
