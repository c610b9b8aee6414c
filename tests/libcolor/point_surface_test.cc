// Points as surfaces, in one part and in many.
#include "libcolor/surface/point_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "libcolor/surface/linear_light.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

class ListCloud final : public PointCloud {
 public:
  explicit ListCloud(std::vector<CloudPoint> points) : points_(std::move(points)) { size_ = points_.size(); }
  Status read(const Sink& sink) const override {
    for (size_t i = 0; i < points_.size(); i += 999)
      VOX_CHECK(sink(std::span(points_).subspan(i, std::min<size_t>(999, points_.size() - i))));
    return {};
  }

 private:
  std::vector<CloudPoint> points_;
};

/// Reads with so much memory.
Result<Voxels> voxels_of(const std::vector<CloudPoint>& points, int64_t resolution, uint64_t bytes,
                         VolumeInfo* info = nullptr) {
  MemoryBudget memory(bytes);
  Context ctx;
  ctx.memory = &memory;
  VOX_TRY(const auto surface, surface_of_points(std::make_unique<const ListCloud>(points), resolution, ctx));
  if (info != nullptr) *info = surface->info();
  Voxels voxels;
  VOX_CHECK(surface->read(ctx, [&](std::span<const SurfaceVoxel> run) -> Status {
    voxels.insert(voxels.end(), run.begin(), run.end());
    return {};
  }));
  return voxels;
}

TEST(PointSurface, PointsOfAVoxelAreAveragedInLinearLight) {
  VolumeInfo info;
  const auto voxels = voxels_of(
      {{{0, 0, 0}, {255, 0, 0}}, {{0.1, 0.2, 0.05}, {0, 0, 0}}, {{8, 2, 1}, {0, 255, 0}}}, 8, 1 << 30, &info);
  ASSERT_TRUE(voxels) << voxels.error().what;
  EXPECT_EQ(info.dims, Index3(8, 3, 2));
  ASSERT_EQ(voxels->size(), 2u);
  EXPECT_EQ((*voxels)[0].color, (Rgb{188, 0, 0}));
  EXPECT_EQ((*voxels)[1].place, morton_code(7, 2, 1));
  EXPECT_EQ((*voxels)[1].color, (Rgb{0, 255, 0}));
}

TEST(PointSurface, PartsDoNotMatter) {
  std::mt19937_64 random(1);
  std::vector<CloudPoint> points;
  for (int i = 0; i < 100000; ++i) {
    const auto at = [&] { return static_cast<double>(random() % 6400) / 100; };
    const auto channel = [&] { return static_cast<uint8_t>(random()); };
    points.push_back({{at(), at(), at() / 8}, {channel(), channel(), channel()}});
  }
  points.push_back({{0, 0, 0}, {}});
  points.push_back({{64, 64, 8}, {}});
  // Every voxel by itself.
  const LightTables& tables = light_tables();
  std::map<uint64_t, std::array<uint64_t, 4>> sums;
  for (const CloudPoint& point : points) {
    const auto place = [&](double v, int most) {
      return static_cast<uint32_t>(std::min<int>(static_cast<int>(v), most));
    };
    auto& sum = sums[morton_code(place(point.at.x, 63), place(point.at.y, 63), place(point.at.z, 8))];
    for (size_t k = 0; k < 3; ++k) sum[k] += tables.linear[point.color[k]];
    ++sum[3];
  }
  // In one part, and in seven.
  for (const uint64_t bytes : {uint64_t{1} << 30, uint64_t{1} << 20}) {
    const auto voxels = voxels_of(points, 64, bytes);
    ASSERT_TRUE(voxels) << voxels.error().what;
    ASSERT_EQ(voxels->size(), sums.size());
    size_t i = 0;
    for (const auto& [place, sum] : sums) {
      const auto mean = [&](size_t k) { return tables.stored[(2 * sum[k] + sum[3]) / (2 * sum[3])]; };
      ASSERT_EQ((*voxels)[i].place, place);
      ASSERT_EQ((*voxels)[i].color, (Rgb{mean(0), mean(1), mean(2)}));
      ++i;
    }
  }
}

TEST(PointSurface, OnePointAndWhatCannotBe) {
  VolumeInfo info;
  const auto one = voxels_of({{{3, 4, 5}, {1, 2, 3}}}, 1000, 1 << 30, &info);
  ASSERT_TRUE(one);
  EXPECT_EQ(info.dims, Index3(1));
  EXPECT_EQ(one->size(), 1u);
  for (const int64_t resolution : {int64_t{0}, (int64_t{1} << 21) + 1}) {
    const auto none = voxels_of({{{3, 4, 5}, {}}}, resolution, 1 << 30);
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().code, ErrorCode::usage);
  }
  const auto poor = voxels_of(std::vector<CloudPoint>(100000), 8, 1 << 10);
  ASSERT_FALSE(poor);
  EXPECT_EQ(poor.error().code, ErrorCode::limit);
}

/// A cloud that says it has more points than come.
class HoledCloud final : public PointCloud {
 public:
  explicit HoledCloud(uint64_t come) : come_(come) { size_ = 3; }
  Status read(const Sink& sink) const override {
    const std::vector<CloudPoint> points(come_, {{1, 2, 3}, {4, 5, 6}});
    return sink(points);
  }

 private:
  uint64_t come_;
};

TEST(PointSurface, WhatIsDroppedIsCounted) {
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  const auto surface = surface_of_points(std::make_unique<const HoledCloud>(1), 8, ctx);
  ASSERT_TRUE(surface);
  ASSERT_EQ((*surface)->notes().size(), 1u);
  EXPECT_NE((*surface)->notes()[0].find("2 of 3 points"), std::string::npos);
  const auto none = surface_of_points(std::make_unique<const HoledCloud>(0), 8, ctx);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::input);
}

}  // namespace
}  // namespace voxkit::color
