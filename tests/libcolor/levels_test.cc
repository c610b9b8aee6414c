// Levels of detail against a plain reduction: which voxels there are, where they are, and their colours.
#include "libcolor/edit/levels.h"

#include <cmath>

#include "libcolor/dag/dag_view.h"
#include "libcolor/store.h"
#include "tests/libcolor/reading.h"

namespace voxkit::color {
namespace {

double linear(uint8_t stored) {
  const double c = stored / 255.0;
  return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}
double stored(double light) {
  return 255 * (light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055);
}

/// The mean colour of each cube of 2^level a side that has voxels, in 0 to 255, not rounded.
std::map<std::array<int64_t, 3>, std::array<double, 3>> reduced(const Voxels& voxels, int level) {
  std::map<std::array<int64_t, 3>, std::array<double, 4>> sums;
  for (const auto& [at, color] : places_of(voxels)) {
    auto& sum = sums[{at[0] >> level, at[1] >> level, at[2] >> level}];
    sum[0] += linear(color.r);
    sum[1] += linear(color.g);
    sum[2] += linear(color.b);
    sum[3] += 1;
  }
  std::map<std::array<int64_t, 3>, std::array<double, 3>> means;
  for (const auto& [at, sum] : sums)
    means[at] = {stored(sum[0] / sum[3]), stored(sum[1] / sum[3]), stored(sum[2] / sum[3])};
  return means;
}

struct Scene {
  Voxels voxels;
  Index3 dims;
};
std::vector<Scene> scenes() {
  return {{{{0, {1, 2, 3}}}, Index3(1)},
          {{{5, {200, 100, 0}}}, Index3(2, 1, 2)},
          {sphere_shell(5), Index3(32)},
          {inside(scattered(5, 900, 3), Index3(27, 30, 9)), Index3(27, 30, 9)},
          {scattered(12, 700, 4), Index3(4096)}};
}
std::vector<Options> ways() {
  std::vector<Options> all(5);
  for (Options& options : all) options.codec = ColorCodec::raw;
  all[1].colors = Colors::all;
  all[2].curve = Curve::hilbert;
  all[2].counts = Counts::pointer;
  all[3] = all[2];
  all[3].colors = Colors::all;
  all[4].geometry = Geometry::octree;
  return all;
}

TEST(Levels, ThereIsOneUntilOneVoxelIsLeft) {
  VolumeInfo info;
  const auto count = [&](Index3 dims) {
    info.dims = dims;
    return level_count(info);
  };
  EXPECT_EQ(count({1, 1, 1}), 1);
  EXPECT_EQ(count({1, 2, 1}), 2);
  EXPECT_EQ(count({27, 5, 1}), 6);
  EXPECT_EQ(count({1, 1, 32}), 6);
  EXPECT_EQ(count({33, 1, 32}), 7);
  EXPECT_EQ(count({int64_t{1} << 21, 1, 1}), 22);
}

TEST(Levels, AreWhereTheVolumeIs) {
  VolumeInfo info;
  info.dims = {27, 30, 9};
  info.affine = Affine::plain({0.5, 0.25, 2}, {10, 20, 30});
  info.unit = Unit::millimetre;
  const VolumeInfo coarse = level_info(info, 2);
  EXPECT_EQ(coarse.dims, Index3(7, 8, 3));
  EXPECT_EQ(coarse.affine.spacing(), (Affine::Vector{2, 1, 8}));
  // The outer corner, half a voxel before the first centre, stays: 9.75, 19.875, 29.
  EXPECT_EQ(coarse.affine.origin, (Affine::Vector{10.75, 20.375, 33}));
  EXPECT_EQ(coarse.unit, Unit::millimetre);
}

TEST(Levels, HaveBoxesOfTheVolume) {
  const auto volume = volume_of({}, Index3(27, 30, 9), {});
  ASSERT_TRUE(volume);
  const Level level(volume, 2);
  // Every voxel of the level that is touched; those that are cut off are as large as they are.
  EXPECT_EQ(level.touched({{3, 4, 0}, {4, 9, 9}}), (Box{{0, 1, 0}, {1, 3, 3}}));
  EXPECT_EQ(level.touched(volume->info().box()), level.info().box());
  EXPECT_EQ(level.voxels_of({{0, 1, 2}, {1, 3, 3}}), (Box{{0, 4, 8}, {4, 12, 9}}));
  EXPECT_EQ(level.voxels_of(level.info().box()), volume->info().box());
}

TEST(Levels, HaveTheMeansOfTheirVoxels) {
  for (const auto& [voxels, dims] : scenes())
    for (const Options& options : ways()) {
      const auto volume = volume_of(voxels, dims, options);
      ASSERT_TRUE(volume);
      for (int level = 0; level < level_count(volume->info()); ++level) {
        SCOPED_TRACE(testing::Message() << voxels.size() << " voxels, level " << level);
        const auto expected = reduced(voxels, level);
        const auto surface = surface_of(volume, level, CellColors::means);
        const Voxels means = all_of(*surface);
        ASSERT_EQ(means.size(), expected.size());
        for (const auto& [at, color] : places_of(means)) {
          const auto found = expected.find(at);
          ASSERT_TRUE(found != expected.end());
          EXPECT_NEAR(color.r, found->second[0], 0.6);
          EXPECT_NEAR(color.g, found->second[1], 0.6);
          EXPECT_NEAR(color.b, found->second[2], 0.6);
        }
        const Level boxed(volume, level);
        const auto count = boxed.count(boxed.info().box());
        ASSERT_TRUE(count);
        EXPECT_EQ(*count, expected.size());
        // A file without loss has the same colours, if it has any.
        const auto told = surface_of(volume, level, CellColors::stored);
        EXPECT_EQ(places_of(all_of(*told)), places_of(means));
        // And so have boxes.
        const Places all = places_of(means);
        const auto source = open_level(volume, level, CellColors::stored);
        std::mt19937 random(5);
        for (int round = 0; round < 12; ++round) {
          const Index3 extent = source->info().dims;
          Box box;
          for (int a = 0; a < 3; ++a) {
            box.lo[a] = static_cast<int64_t>(random() % static_cast<uint64_t>(extent[a]));
            if (round % 2 == 0) box.lo[a] = Index3(morton_place(means[random() % means.size()].place))[a];
            box.hi[a] = std::min(extent[a], box.lo[a] + 1 + static_cast<int64_t>(random() % 9));
          }
          std::vector<std::byte> memory(static_cast<size_t>(box.voxels()) * 4, std::byte{0x55});
          const VoxelSpan span = packed(memory.data(), box.size(), VoxelFormat::rgba32);
          ASSERT_TRUE(source->read(box, span));
          bool any = false;
          for (int64_t z = box.lo.z; z < box.hi.z; ++z)
            for (int64_t y = box.lo.y; y < box.hi.y; ++y)
              for (int64_t x = box.lo.x; x < box.hi.x; ++x) {
                const std::byte* const p = span.row(y - box.lo.y, z - box.lo.z) + (x - box.lo.x) * 4;
                const auto found = all.find({x, y, z});
                const bool there = found != all.end();
                any |= there;
                const Rgb color = there ? found->second : Rgb{};
                ASSERT_EQ(p[3], std::byte{static_cast<uint8_t>(there ? 255 : 0)});
                ASSERT_EQ(
                    (Rgb{static_cast<uint8_t>(p[0]), static_cast<uint8_t>(p[1]), static_cast<uint8_t>(p[2])}),
                    color);
              }
          EXPECT_EQ(source->uniform(box).has_value(), !any);
          // Its voxels alone, in order.
          Voxels alone;
          for (const SurfaceVoxel& voxel : means)
            if (box.contains(Index3(morton_place(voxel.place)))) alone.push_back(voxel);
          size_t next = 0;
          ASSERT_TRUE(boxed.for_each_voxel(box, [&](std::span<const SurfaceVoxel> run) -> Status {
            for (const SurfaceVoxel& voxel : run) {
              if (next >= alone.size() || voxel.place != alone[next].place) return bad_usage("another voxel");
              EXPECT_EQ(voxel.color, alone[next++].color);
            }
            return {};
          }));
          EXPECT_EQ(next, alone.size());
          const auto count_of_box = boxed.count(box);
          ASSERT_TRUE(count_of_box);
          EXPECT_EQ(*count_of_box, alone.size());
        }
      }
    }
}

/// Those of a file with a loss are off by that, and not what the voxels' are.
TEST(Levels, TellWhatTheFileHasForThem) {
  for (const Curve curve : {Curve::morton, Curve::hilbert}) {
    Options options;
    options.colors = Colors::all;
    options.curve = curve;
    options.threshold = 20;
    const auto volume = volume_of(scattered(6, 3000, 8), Index3(64), options);
    ASSERT_TRUE(volume);
    const auto view = volume->store().dag(volume->container(), volume->params());
    ASSERT_TRUE(view);
    for (int level = 1; level <= 6; ++level) {
      const auto surface = surface_of(volume, level, CellColors::stored);
      const Voxels cells = all_of(*surface);
      for (const SurfaceVoxel& cell : cells) {
        // From the root down, for each alone.
        uint64_t place = cell.place << 3 * level;
        Found found;
        for (uint64_t i = 0; !found.there && i < uint64_t{1} << 3 * level; ++i)
          if (find_voxel(**view, place + i).there) found = find_cell(**view, place + i, level);
        ASSERT_TRUE(found.there);
        const auto color = volume->color(found.color);
        ASSERT_TRUE(color);
        EXPECT_EQ(cell.color, *color);
      }
    }
    const auto means = surface_of(volume, 1, CellColors::means), told = surface_of(volume, 1);
    EXPECT_NE(places_of(all_of(*means)), places_of(all_of(*told)));
  }
}

TEST(Levels, OfNothingHaveNothing) {
  const auto volume = volume_of({}, Index3(9, 2, 3), {});
  ASSERT_TRUE(volume);
  for (int level = 0; level < level_count(volume->info()); ++level) {
    EXPECT_EQ(all_of(*surface_of(volume, level)).size(), 0u);
    const auto count = Level(volume, level).count(level_info(volume->info(), level).box());
    ASSERT_TRUE(count);
    EXPECT_EQ(*count, 0u);
  }
}

}  // namespace
}  // namespace voxkit::color
