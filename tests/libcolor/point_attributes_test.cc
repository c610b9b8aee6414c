// What voxels have beside colours, from points, models and volumes.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "libcolor/surface/linear_light.h"
#include "libcolor/surface/morton.h"
#include "libcolor/surface/octahedral.h"
#include "libcolor/surface/point_surface.h"
#include "libcolor/surface/volume_surface.h"
#include "libcolor/surface/voxel_list.h"
#include "tests/libcolor/attribute_scenes.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {
namespace {

class ListCloud final : public PointCloud {
 public:
  ListCloud(std::vector<CloudPoint> points, const PointExtras& has,
            const std::optional<VolumeInfo>& grid = {})
      : points_(std::move(points)) {
    size_ = points_.size();
    has_ = has;
    grid_ = grid;
  }
  Status read(const Sink& sink) const override { return sink(points_); }

 private:
  std::vector<CloudPoint> points_;
};

/// Voxels, and the bytes of their attributes, by place.
struct Read {
  AttributeSet attributes;
  std::vector<std::string> notes;
  Voxels voxels;
  std::vector<int> bytes;
  std::vector<int> of(size_t voxel) const {
    const auto each = static_cast<ptrdiff_t>(attributes.bytes()), at = static_cast<ptrdiff_t>(voxel) * each;
    return {bytes.begin() + at, bytes.begin() + at + each};
  }
};
Read read(Result<std::unique_ptr<SurfaceSource>> surface, Context& ctx) {
  Read out;
  EXPECT_TRUE(surface) << surface.error().what;
  if (!surface) return out;
  out.attributes = (*surface)->attributes();
  out.notes = (*surface)->notes();
  EXPECT_TRUE((*surface)->read(ctx, [&](const VoxelRun& run) -> Status {
    EXPECT_EQ(run.attributes.size(), run.voxels.size() * out.attributes.bytes());
    out.voxels.insert(out.voxels.end(), run.voxels.begin(), run.voxels.end());
    for (const std::byte b : run.attributes) out.bytes.push_back(std::to_integer<int>(b));
    return {};
  }));
  return out;
}

class PointAttributes : public testing::Test {
 protected:
  PointAttributes() { ctx_.memory = &memory_; }
  Read points(std::vector<CloudPoint> list, int64_t resolution, const std::optional<AttributeSet>& wanted,
              const PointExtras& has = {true, true, true, true}) {
    return read(
        surface_of_points(std::make_unique<const ListCloud>(std::move(list), has), resolution, ctx_, wanted),
        ctx_);
  }
  MemoryBudget memory_;
  Context ctx_;
};

CloudPoint point(const glm::dvec3& at, uint8_t gray, uint8_t alpha, const glm::vec3& normal, uint32_t label) {
  CloudPoint out;
  out.at = at;
  out.color = {gray, gray, gray};
  out.alpha = alpha;
  out.normal = normal;
  out.label = label;
  out.roughness = gray;
  out.metalness = 10;
  return out;
}

TEST_F(PointAttributes, MeansOfPoints) {
  const std::vector<CloudPoint> list = {
      point({0, 0, 0}, 100, 200, {0, 0, 5}, 7), point({0.1, 0, 0}, 200, 100, {0, 3, 0}, 4),
      point({0.2, 0, 0}, 200, 100, {0, 0, 0}, 4), point({8, 8, 8}, 50, 255, {0, 0, -1}, 9),
      point({8, 8, 7.9}, 50, 1, {0, 0, -1}, 300)};
  const auto all = set_of({Attribute::opacity, Attribute::normal, Attribute::rm, Attribute::id});
  const Read out = points(list, 4, all);
  ASSERT_EQ(out.voxels.size(), 2u);
  const Octahedral n = octahedral_of(0, 1, 2), down = octahedral_of(0, 0, -1);
  EXPECT_EQ(out.of(0), (std::vector<int>{133, n.u, n.v, 150, 10, 4, 0, 0, 0}));
  EXPECT_EQ(out.of(1), (std::vector<int>{255, down.u, down.v, 50, 10, 9, 0, 0, 0}));
  const auto& linear = light_tables().linear;
  EXPECT_EQ(out.voxels[0].color.r, light_tables().stored[(linear[100] + linear[200]) / 2]);
  // By itself: opacity only where some point is faint.
  EXPECT_EQ(points(list, 4, std::nullopt).attributes, set_of({Attribute::opacity}));
  EXPECT_EQ(points({list[3]}, 4, std::nullopt).attributes, AttributeSet());
}

TEST_F(PointAttributes, LightOfPointsIsMeantAsTheirColors) {
  std::vector<CloudPoint> list = {point({0, 0, 0}, 100, 255, {}, 0), point({0.1, 0, 0}, 200, 255, {}, 0),
                                  point({8, 0, 0}, 9, 255, {}, 0)};
  list[0].emission = {100, 0, 7};
  list[1].emission = {200, 0, 7};
  const PointExtras has{.emission = true};
  const Read out = points(list, 4, std::nullopt, has);
  EXPECT_EQ(out.attributes, set_of({Attribute::emissive}));
  ASSERT_EQ(out.voxels.size(), 2u);
  EXPECT_EQ(out.of(0), (std::vector<int>{out.voxels[0].color.r, 0, 7}));
  EXPECT_EQ(out.of(1), (std::vector<int>{0, 0, 0}));
  EXPECT_EQ(points({list[2]}, 4, std::nullopt, has).attributes, AttributeSet());
}

TEST_F(PointAttributes, NormalsThatAreNoneAreCounted) {
  std::vector<CloudPoint> list = {point({0, 0, 0}, 1, 255, {0, 1, 0}, 0), point({1, 0, 0}, 1, 255, {}, 0),
                                  point({2, 0, 0}, 1, 255, {NAN, 0, 1}, 0)};
  const Read out = points(list, 4, set_of({Attribute::normal}));
  ASSERT_EQ(out.notes.size(), 1u);
  EXPECT_EQ(out.notes[0],
            "2 of 3 points have a normal of 0, or none of numbers: a voxel of such points alone has 0, 0, 1");
  EXPECT_TRUE(points(list, 4, AttributeSet()).notes.empty());
}

TEST_F(PointAttributes, PointsInTheirOwnGrid) {
  VolumeInfo grid;
  grid.dims = {20, 7, 3};
  grid.affine.axes = {{{0, 0.25, 0}, {-0.5, 0, 0.125}, {0, 0, 3}}};  // turned, and sheared
  grid.affine.origin = {1000, -3, 0.5};
  grid.world = World::ras;
  std::vector<CloudPoint> list;
  std::map<uint64_t, uint8_t> want;
  for (int64_t z = 0; z < 3; ++z)
    for (int64_t y = z; y < 7; y += 2)
      for (int64_t x = 3; x < 17; x += 3) {
        const auto p =
            grid.affine.place({static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)});
        const auto gray = static_cast<uint8_t>(10 * x + y);
        list.push_back(point({p[0], p[1], p[2]}, gray, 255, {}, 0));
        want[morton_code(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z))] =
            gray;
      }
  const auto surface_in = [&](std::optional<int64_t> resolution) {
    return surface_of_points(std::make_unique<const ListCloud>(list, PointExtras{}, grid), resolution, ctx_);
  };
  for (const std::optional<int64_t> resolution : {std::optional<int64_t>(), std::optional<int64_t>(20)}) {
    auto surface = surface_in(resolution);
    ASSERT_TRUE(surface);
    EXPECT_EQ((*surface)->info().dims, grid.dims);
    EXPECT_EQ((*surface)->info().affine, grid.affine);
    EXPECT_EQ((*surface)->info().world, World::ras);
    const Read out = read(std::move(surface), ctx_);
    ASSERT_EQ(out.voxels.size(), want.size());
    for (const SurfaceVoxel& voxel : out.voxels) EXPECT_EQ(want.at(voxel.place), voxel.color.r);
    EXPECT_EQ(out.notes, std::vector<std::string>{"points of voxels: their own grid of 20 x 7 x 3 is taken"});
  }
  EXPECT_EQ((*surface_in(10))->info().affine.axes[0][1], 0);
  // Where one is outside: a grid around them.
  list.push_back(point({0, 0, 0}, 1, 255, {}, 0));
  const auto around = surface_in(std::nullopt);
  ASSERT_TRUE(around);
  EXPECT_EQ((*around)->info().dims.x, 1024);
  EXPECT_EQ((*around)->notes(),
            std::vector<std::string>{"their grid of 20 x 7 x 3 voxels is not around all of them: dropped"});
}

TEST_F(PointAttributes, PartsDoNotMatter) {
  std::mt19937_64 random(1);
  std::vector<CloudPoint> list;
  for (int i = 0; i < 60000; ++i) {
    const auto unit = [&] { return static_cast<double>(random() % 1000) / 1000; };
    list.push_back(point({unit(), unit(), unit()}, static_cast<uint8_t>(random()),
                         static_cast<uint8_t>(random() % 255 + 1), glm::vec3(unit() - 0.5, unit(), unit()),
                         static_cast<uint32_t>(random() % 5)));
  }
  const auto all = set_of({Attribute::opacity, Attribute::normal, Attribute::rm, Attribute::id});
  const Read want = points(list, 20, all);
  MemoryBudget little(uint64_t{2} << 20);
  Context ctx;
  ctx.memory = &little;
  const Read have =
      read(surface_of_points(std::make_unique<const ListCloud>(list, PointExtras{true, true, true, true}), 20,
                             ctx, all),
           ctx);
  ASSERT_EQ(have.voxels.size(), want.voxels.size());
  EXPECT_EQ(have.bytes, want.bytes);
  for (size_t i = 0; i < want.voxels.size(); ++i) EXPECT_EQ(have.voxels[i].color, want.voxels[i].color);
}

TEST_F(PointAttributes, WithoutOpacityColorsAreThoseOfPlainPoints) {
  std::mt19937_64 random(2);
  std::vector<CloudPoint> list;
  for (int i = 0; i < 3000; ++i)
    list.push_back(
        point(glm::dvec3(static_cast<double>(random() % 100), static_cast<double>(random() % 100), 0),
              static_cast<uint8_t>(random()), static_cast<uint8_t>(128 + random() % 128), {}, 1));
  const Read plain = points(list, 16, AttributeSet()), rich = points(list, 16, set_of({Attribute::id}));
  ASSERT_EQ(plain.voxels.size(), rich.voxels.size());
  for (size_t i = 0; i < plain.voxels.size(); ++i) EXPECT_EQ(plain.voxels[i].color, rich.voxels[i].color);
}

TEST_F(PointAttributes, WhatPointsDoNotHave) {
  const auto surface = surface_of_points(
      std::make_unique<const ListCloud>(std::vector<CloudPoint>(1), PointExtras{.labels = true}), 4, ctx_,
      set_of({Attribute::normal, Attribute::id}));
  ASSERT_FALSE(surface);
  EXPECT_EQ(surface.error().code, ErrorCode::usage);
  EXPECT_EQ(surface.error().what, "attributes: it has no normal: expected some of color, id");
}

TEST_F(PointAttributes, MaterialsOfModels) {
  const auto scene = [] {
    VoxelScene out;
    out.voxels = {{{0, 0, 0}, {200, 100, 0}, 1}, {{1, 0, 0}, {10, 20, 30}, 2}, {{2, 0, 0}, {1, 2, 3}, 255}};
    out.materials[1].emission = 1;
    out.materials[2].opacity = 0;
    out.materials[255].roughness = 0.5f;
    out.materials[255].metalness = 1;
    return out;
  };
  const Read all =
      read(surface_of(scene(), ctx_,
                      set_of({Attribute::emissive, Attribute::opacity, Attribute::rm, Attribute::id})),
           ctx_);
  ASSERT_EQ(all.voxels.size(), 3u);
  EXPECT_EQ(all.of(0), (std::vector<int>{200, 100, 0, 255, 255, 0, 1, 0, 0, 0}));
  EXPECT_EQ(all.of(1), (std::vector<int>{0, 0, 0, 1, 255, 0, 2, 0, 0, 0}));
  EXPECT_EQ(all.of(2), (std::vector<int>{0, 0, 0, 255, 128, 255, 255, 0, 0, 0}));
  EXPECT_TRUE(all.notes.empty());
  const Read by_itself = read(surface_of(scene(), ctx_), ctx_);
  EXPECT_EQ(by_itself.attributes, set_of({Attribute::emissive, Attribute::opacity}));
  const Read plain = read(surface_of(scene(), ctx_, AttributeSet()), ctx_);
  EXPECT_EQ(plain.notes,
            (std::vector<std::string>{"dropped: materials of 2 colors that are glass or shine"}));
  EXPECT_EQ(read(surface_of(scene(), ctx_, std::nullopt, false), ctx_).attributes,
            set_of({Attribute::opacity}));
  EXPECT_FALSE(surface_of(scene(), ctx_, set_of({Attribute::normal})));
}

/// Alphas along x.
class AlphaSource final : public VolumeSource {
 public:
  AlphaSource(std::vector<uint8_t> alphas, VoxelFormat format) : alphas_(std::move(alphas)) {
    info_.dims = {static_cast<int64_t>(alphas_.size()), 1, 1};
    info_.format = format;
  }
  Status read(const Box& box, VoxelSpan out) override {
    for (int64_t x = box.lo.x; x < box.hi.x; ++x) {
      std::byte* const to = out.row(0, 0) + (x - box.lo.x) * voxel_bytes(info_.format);
      to[0] = to[1] = to[2] = std::byte{9};
      if (info_.format == VoxelFormat::rgba32) to[3] = std::byte{alphas_[static_cast<size_t>(x)]};
    }
    return {};
  }

 private:
  std::vector<uint8_t> alphas_;
};

TEST_F(PointAttributes, AlphaOfVolumes) {
  const auto of = [&](std::vector<uint8_t> alphas, const std::optional<AttributeSet>& wanted) {
    return read(
        surface_of(std::make_unique<AlphaSource>(std::move(alphas), VoxelFormat::rgba32), wanted, ctx_),
        ctx_);
  };
  EXPECT_EQ(of({255, 0, 255}, std::nullopt).attributes, AttributeSet());
  const Read faint = of({255, 0, 1, 254}, std::nullopt);
  EXPECT_EQ(faint.attributes, set_of({Attribute::opacity}));
  EXPECT_EQ(faint.bytes, (std::vector<int>{255, 1, 254}));
  EXPECT_EQ(of({255, 0, 1}, AttributeSet()).voxels.size(), 2u);
  EXPECT_EQ(of({255, 0}, set_of({Attribute::opacity})).bytes, (std::vector<int>{255}));
  const auto rgb = [&](const std::optional<AttributeSet>& wanted) {
    return surface_of(std::make_unique<AlphaSource>(std::vector<uint8_t>(3), VoxelFormat::rgb24), wanted,
                      ctx_);
  };
  EXPECT_EQ(read(rgb(std::nullopt), ctx_).attributes, AttributeSet());
  EXPECT_FALSE(rgb(set_of({Attribute::opacity})));
}

}  // namespace
}  // namespace voxkit::color
