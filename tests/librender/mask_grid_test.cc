// Packed volumes of colours: the picture of the masks is that of the voxels, one by one, bit by bit.
#include "librender/cast/mask_grid.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "librender/camera.h"
#include "librender/cast/ray_cast.h"
#include "libsvmm/packed/packed_layout.h"
#include "tests/damage.h"
#include "tests/memory_volume.h"

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

VolumeInfo info_of(Index3 dims, VoxelFormat format) {
  VolumeInfo info;
  info.dims = dims;
  info.format = format;
  info.sample_type = SampleType::u8;
  return info;
}

/// Voxels of a kind: none, one, a shell, crumbs, planes, all.
std::vector<std::byte> voxels_of(int kind, Index3 dims, int bytes) {
  std::mt19937 random(static_cast<uint32_t>(kind));
  std::vector<std::byte> out;
  for (int64_t z = 0; z < dims.z; ++z)
    for (int64_t y = 0; y < dims.y; ++y)
      for (int64_t x = 0; x < dims.x; ++x) {
        const int64_t r2 = (x - 20) * (x - 20) + (y - 20) * (y - 20) + (z - 20) * (z - 20);
        const uint32_t chance = static_cast<uint32_t>(random() % 90);
        const bool solid = kind == 1   ? x == 3 && y == 2 && z == 1
                           : kind == 2 ? r2 > 300 && r2 < 380
                           : kind == 3 ? chance == 0
                           : kind == 4 ? x == y || (z == 5 && x % 9 == 0)
                                       : kind == 5;
        const int64_t v[4] = {5 * x + 1, 200 - 3 * y, 4 * z, 255};
        for (int c = 0; c < bytes; ++c) out.push_back(static_cast<std::byte>(solid ? v[c] : 0));
      }
  return out;
}

Result<std::shared_ptr<const svmm::PackedVolume>> compressed(VolumeSource& source,
                                                             const svmm::PackedOptions& options,
                                                             Context& ctx) {
  const auto bytes = std::make_shared<std::vector<std::byte>>();
  const auto written = svmm::encode_packed(
      source, options,
      [&](std::span<const std::byte> part) -> Status {
        bytes->insert(bytes->end(), part.begin(), part.end());
        return {};
      },
      ctx);
  if (!written) return tl::unexpected<Error>(written.error());
  VOX_TRY(auto container, Container::open(*bytes, "file", bytes));
  return svmm::PackedVolume::open(container, *ctx.memory);
}

TEST(MaskGrid, PicturesAreThoseOfTheVoxels) {
  for (int kind = 0; kind < 6; ++kind)
    for (const VoxelFormat format : {VoxelFormat::rgba32, VoxelFormat::rgb24}) {
      Fixture f;
      const VolumeInfo info = info_of(kind == 1   ? Index3(4)
                                      : kind == 3 ? Index3(20, 70, 9)
                                                  : Index3(41, 37, 40),
                                      format);
      test::MemorySource source(info, voxels_of(kind, info.dims, voxel_bytes(format)));
      const auto dense = DenseGrid::read(source, f.ctx);
      ASSERT_TRUE(dense);
      const svmm::PackedOptions options{.levels = kind % 2 == 0, .page_side = kind < 3 ? 8 : 16};
      const auto volume = compressed(source, options, f.ctx);
      ASSERT_TRUE(volume) << volume.error().what;
      ASSERT_TRUE(MaskGrid::fits(**volume));
      const auto grid = MaskGrid::open(*volume, f.ctx);
      ASSERT_TRUE(grid) << grid.error().what;
      if ((*volume)->params().has_channels()) {
        EXPECT_EQ((*volume)->pages_decoded(), 0u);
      }
      for (const double distance : {0.2, 0.9, 1.8})
        for (const double azimuth : {0.0, 33.0, 215.0}) {
          const Camera camera = Camera::orbit(azimuth, 20, distance, 45);
          CastOptions cast_options;
          cast_options.width = 97;
          cast_options.height = 64;
          cast_options.details = true;
          Frame expected, frame;
          ASSERT_TRUE(cast(**dense, camera, cast_options, expected, f.ctx));
          for (const int way : {0, 1, 2, 3}) {
            cast_options.traversal = way == 1 ? Traversal::restart : Traversal::path;
            cast_options.skip = way != 2;
            cast_options.native = way != 3;
            ASSERT_TRUE(cast(*grid, camera, cast_options, frame, f.ctx));
            EXPECT_EQ(frame.rays_hit, expected.rays_hit);
            for (size_t i = 0; i < frame.pixels.size(); ++i) {
              for (int k = 0; k < 4; ++k) ASSERT_EQ(frame.pixels[i].color[k], expected.pixels[i].color[k]);
              ASSERT_EQ(frame.pixels[i].distance, expected.pixels[i].distance);
              for (int a = 0; a < 3; ++a) ASSERT_EQ(frame.details[i].voxel[a], expected.details[i].voxel[a]);
            }
          }
        }
    }
}

/// Boxes are void where by the book they are, as long as the search may look on.
TEST(MaskGrid, BoxesAreSearchedAsByTheBook) {
  Fixture f;
  const VolumeInfo info = info_of({70, 20, 33}, VoxelFormat::rgba32);
  const auto voxels = voxels_of(3, info.dims, 4);
  test::MemorySource source(info, voxels);
  const auto volume = compressed(source, {}, f.ctx);
  ASSERT_TRUE(volume);
  const auto grid = MaskGrid::open(*volume, f.ctx);
  ASSERT_TRUE(grid);
  const svmm::MaskView view = grid->tree().view();
  std::mt19937 random(2);
  int voids = 0;
  for (int i = 0; i < 3000; ++i) {
    uint32_t lo[3], hi[3];
    for (int a = 0; a < 3; ++a) {
      lo[a] = static_cast<uint32_t>(random() % static_cast<uint64_t>(info.dims[a]));
      hi[a] = std::min(static_cast<uint32_t>(info.dims[a]), lo[a] + 1 + static_cast<uint32_t>(random() % 9));
    }
    MaskVoidSearch search(view, 1 << 20);
    const bool is_void = search({lo[0], lo[1], lo[2]}, {hi[0], hi[1], hi[2]});
    std::set<std::array<uint32_t, 3>> solid;
    for (uint32_t z = lo[2]; z < hi[2]; ++z)
      for (uint32_t y = lo[1]; y < hi[1]; ++y)
        for (uint32_t x = lo[0]; x < hi[0]; ++x)
          if (voxels[((z * 20 + y) * 70 + x) * size_t{4} + 3] != std::byte{0}) solid.insert({x, y, z});
    ASSERT_EQ(is_void, solid.empty());
    ASSERT_EQ(search.found(), !is_void);
    if (!is_void) {
      ASSERT_TRUE(
          solid.contains({static_cast<uint32_t>(search.begin(0)), static_cast<uint32_t>(search.begin(1)),
                          static_cast<uint32_t>(search.begin(2))}));
    }
    voids += is_void ? 1 : 0;
    MaskVoidSearch short_of(view, 1);
    EXPECT_FALSE(short_of({lo[0], lo[1], lo[2]}, {hi[0], hi[1], hi[2]}) && !is_void);
  }
  EXPECT_GT(voids, 300);
  EXPECT_LT(voids, 2700);
}

TEST(MaskGrid, OnlyPagesThatAreSeenAreDecoded) {
  Fixture f;
  f.ctx.threads = 1;  // several may decode a page at once
  const VolumeInfo info = info_of({64, 64, 64}, VoxelFormat::rgba32);
  test::MemorySource source(info, voxels_of(5, info.dims, 4));
  const auto volume = compressed(source, {.levels = false}, f.ctx);
  const auto grid = MaskGrid::open(*volume, f.ctx);
  ASSERT_TRUE(grid);
  CastOptions options;
  options.width = 160;
  options.height = 120;
  Frame frame;
  ASSERT_TRUE(cast(*grid, Camera::orbit(0, 0, 1.5, 45), options, frame, f.ctx));
  EXPECT_LE((*volume)->pages_decoded(), 16u);  // one face
  EXPECT_GT((*volume)->pages_decoded(), 0u);
  const uint64_t once = (*volume)->pages_decoded();
  ASSERT_TRUE(cast(*grid, Camera::orbit(0, 0, 1.5, 45), options, frame, f.ctx));
  EXPECT_EQ((*volume)->pages_decoded(), once);
}

/// A file may say that all is opaque, and not be so.
TEST(MaskGrid, WhatIsNotOpaqueAfterAllIsDamage) {
  Fixture f;
  const VolumeInfo info = info_of({8, 8, 8}, VoxelFormat::rgba32);
  auto voxels = voxels_of(5, info.dims, 4);
  for (size_t i = 3; i < voxels.size(); i += 4) voxels[i] = std::byte{254};
  test::MemorySource source(info, voxels);
  std::vector<std::byte> file;
  ASSERT_TRUE(svmm::encode_packed(
      source, {},
      [&](std::span<const std::byte> part) -> Status {
        file.insert(file.end(), part.begin(), part.end());
        return {};
      },
      f.ctx));
  const auto honest = Container::open(file, "file", std::make_shared<std::vector<std::byte>>(file));
  ASSERT_TRUE(honest);
  const auto params = std::ranges::find((*honest)->table(), svmm::packed_kind, &ChunkEntry::kind);
  ASSERT_NE(params, (*honest)->table().end());
  file[params->offset + 3] = std::byte{1};
  test::reseal(file);
  const auto kept = std::make_shared<std::vector<std::byte>>(file);
  const auto container = Container::open(*kept, "file", kept);
  ASSERT_TRUE(container) << container.error().what;
  const auto volume = svmm::PackedVolume::open(*container, f.memory);
  ASSERT_TRUE(volume) << volume.error().what;
  const auto grid = MaskGrid::open(*volume, f.ctx);
  ASSERT_TRUE(grid);
  Frame frame;
  CastOptions options;
  options.width = options.height = 16;
  const Status status = cast(*grid, Camera::orbit(0, 0, 1.5, 45), options, frame, f.ctx);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::input);
  EXPECT_NE(status.error().what.find("byte 3"), std::string::npos);
}

TEST(MaskGrid, WhatWasCutDoesNotFit) {
  Fixture f;
  const VolumeInfo info = info_of({20, 20, 20}, VoxelFormat::rgba32);
  test::MemorySource source(info, voxels_of(2, info.dims, 4));
  const auto cut = std::make_shared<std::vector<std::byte>>();
  ASSERT_TRUE(svmm::encode_packed(
      source, {},
      [&](std::span<const std::byte> part) -> Status {
        cut->insert(cut->end(), part.begin(), part.end());
        return {};
      },
      f.ctx));
  const auto whole = compressed(source, {}, f.ctx);
  ASSERT_TRUE(whole);
  cut->resize((*whole)->levels()[1].end);
  const auto container = Container::open(*cut, "file", cut);
  ASSERT_TRUE(container) << container.error().what;
  const auto volume = svmm::PackedVolume::open(*container, f.memory);
  ASSERT_TRUE(volume) << volume.error().what;
  EXPECT_EQ((*volume)->finest(), 1);
  EXPECT_FALSE(MaskGrid::fits(**volume));
  EXPECT_EQ(MaskGrid::open(*volume, f.ctx).error().code, ErrorCode::usage);
}

TEST(MaskGrid, WhatIsTranslucentDoesNotFit) {
  Fixture f;
  const VolumeInfo info = info_of({8, 8, 8}, VoxelFormat::rgba32);
  auto voxels = voxels_of(5, info.dims, 4);
  voxels[43] = std::byte{254};
  test::MemorySource source(info, voxels);
  EXPECT_FALSE(MaskGrid::fits(**compressed(source, {}, f.ctx)));
  const VolumeInfo scalars = info_of({8, 8, 32}, VoxelFormat::density8);
  test::MemorySource grey(scalars, voxels);
  const auto volume = compressed(grey, {}, f.ctx);
  ASSERT_TRUE(volume);
  EXPECT_FALSE(MaskGrid::fits(**volume));
  EXPECT_EQ(MaskGrid::open(*volume, f.ctx).error().code, ErrorCode::usage);
}

}  // namespace
}  // namespace voxkit::render
