// Fewer voxels within a distance, against distances between all pairs; what a surface is tight by stays.
#include <cmath>
#include <cstring>

#include "libcolor/simplify/ball.h"
#include "libcolor/simplify/hausdorff.h"
#include "libcolor/simplify/simplified_surface.h"
#include "tests/libcolor/dag_cases.h"
#include "tests/libcolor/reading.h"

namespace voxkit::color {
namespace {

int64_t squared_between(const SurfaceVoxel& a, const SurfaceVoxel& b) {
  const Index3 step = Index3(morton_place(a.place)) - Index3(morton_place(b.place));
  return step.x * step.x + step.y * step.y + step.z * step.z;
}
/// From all pairs.
int64_t squared_distance(const Voxels& a, const Voxels& b) {
  std::array<std::vector<glm::i64vec3>, 2> places;
  for (const SurfaceVoxel& voxel : a) places[0].emplace_back(morton_place(voxel.place));
  for (const SurfaceVoxel& voxel : b) places[1].emplace_back(morton_place(voxel.place));
  int64_t greatest = 0;
  for (size_t i = 0; i < 2; ++i)
    for (const auto& from : places[i]) {
      int64_t least = INT64_MAX;
      for (const auto& to : places[1 - i]) {
        const int64_t x = from.x - to.x, y = from.y - to.y, z = from.z - to.z;
        least = std::min(least, x * x + y * y + z * z);
      }
      greatest = std::max(greatest, least);
    }
  return greatest;
}

Voxels simplified(const Voxels& voxels, Index3 dims, double distance, int threads = 1, size_t run = 999) {
  ListSource source(voxels, dims, run);
  SimplifiedSurface surface(source, distance);
  Reading reading;
  reading.ctx.threads = threads;
  Voxels left;
  EXPECT_TRUE(surface.read(reading.ctx, [&](std::span<const SurfaceVoxel> some) -> Status {
    left.insert(left.end(), some.begin(), some.end());
    return {};
  }));
  EXPECT_TRUE(reading.memory.reserve(reading.memory.limit(), "what has been given back"));
  return left;
}

bool same(const Voxels& a, const Voxels& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const SurfaceVoxel& x, const SurfaceVoxel& y) {
    return x.place == y.place && x.color == y.color;
  });
}

struct Scene {
  Voxels voxels;
  Index3 dims;
};
std::vector<Scene> scenes() {
  std::vector<Scene> all = {{{{0, {1, 2, 3}}}, Index3(1)},
                            {{{0, {9, 9, 9}}, {7, {200, 100, 0}}}, Index3(2)},
                            {sphere_shell(4), Index3(16)},
                            {inside(scattered(6, 900, 3), Index3(61, 63, 13)), Index3(61, 63, 13)},
                            {scattered(4, 1500, 7), Index3(16)},
                            {scattered(8, 200, 4), Index3(256)},
                            {scattered(20, 60, 5), Index3(1 << 20)}};
  // A scan: a slope that has been hit here and there.
  std::mt19937_64 random(1);
  all.push_back({voxels_where(6, [&](uint32_t x, uint32_t y,
                                     uint32_t z) { return (x + 2 * y) / 5 == z && random() % 3 != 0; }),
                 Index3(64)});
  return all;
}

TEST(Simplify, BallsHaveThePlacesWithinADistance) {
  const std::pair<double, size_t> sizes[] = {
      {0, 1},    {0.99, 1},          {1, 7},  {1.4, 7},  {std::sqrt(2), 19},
      {1.5, 19}, {std::sqrt(3), 27}, {2, 33}, {2.9, 93}, {8, 2109}};
  for (const auto& [distance, size] : sizes) {
    const auto steps = ball(squared_of(distance));
    EXPECT_EQ(steps.size(), size) << distance;
    for (size_t i = 1; i < steps.size(); ++i) EXPECT_GE(steps[i].squared, steps[i - 1].squared);
    EXPECT_LE(std::sqrt(steps.back().squared), distance);
  }
}

TEST(Simplify, DistancesOfSurfacesAreThoseOfAllPairs) {
  Reading reading;
  std::mt19937_64 random(2);
  for (const Case& c : cases()) {
    if (c.voxels.size() > 4500) continue;
    for (const int most : {1, 3, 8}) {
      Voxels moved;  // some are away, others moved, up to three steps along each axis
      for (const SurfaceVoxel& voxel : c.voxels) {
        const auto at = morton_place(voxel.place);
        const auto end = (uint32_t{1} << c.height) - 1,
                   by = static_cast<uint32_t>(random() % 4 * (random() % 9 == 0));
        if (random() % 3 != 0)
          moved.push_back({morton_code(std::min(at.x + by, end), std::min(at.y + by, end), at.z), {}});
      }
      std::sort(moved.begin(), moved.end(),
                [](const SurfaceVoxel& a, const SurfaceVoxel& b) { return a.place < b.place; });
      moved.erase(
          std::unique(moved.begin(), moved.end(),
                      [](const SurfaceVoxel& a, const SurfaceVoxel& b) { return a.place == b.place; }),
          moved.end());
      const auto a = build(c.voxels, c.height), b = build(moved, c.height);
      const auto distance = hausdorff_distance(view_of(*a), view_of(*b), most, reading.ctx);
      const int64_t squared = squared_distance(c.voxels, moved);
      ASSERT_EQ(distance.has_value(), squared <= most * most) << c.name << squared;
      if (distance) {
        EXPECT_EQ(*distance, std::sqrt(squared)) << c.name;
      }
      const auto none = hausdorff_distance(view_of(*a), view_of(*a), 0, reading.ctx);
      EXPECT_TRUE(none && *none == 0);
    }
  }
  EXPECT_TRUE(reading.memory.reserve(reading.memory.limit(), "what has been given back"));
}

TEST(Simplify, FewerVoxelsAreWithinTheDistance) {
  for (const Scene& scene : scenes()) {
    for (const double distance : {0.9, 1.0, 1.5, 2.0, 8.0}) {
      const Voxels left = simplified(scene.voxels, scene.dims, distance);
      ListSource again(left, scene.dims);
      all_of(again);  // in order, and inside
      EXPECT_LE(left.size(), scene.voxels.size());
      EXPECT_LE(squared_distance(scene.voxels, left), distance * distance);
      if (distance < 1) {
        EXPECT_TRUE(same(left, scene.voxels));
      }
      EXPECT_TRUE(same(left, simplified(scene.voxels, scene.dims, distance, 3, 7)));
    }
  }
}

TEST(Simplify, HowManyAreLeft) {
  // Of a line half of its voxels or less, of points that are apart all, of two that have one between them
  // that one.
  const auto line =
      voxels_where(4, [](uint32_t x, uint32_t y, uint32_t z) { return y == 5 && z == 5 && x > 0 && x < 13; });
  EXPECT_LE(simplified(line, Index3(16), 1).size(), 6u);
  const auto apart = voxels_where(
      4, [](uint32_t x, uint32_t y, uint32_t z) { return x % 3 == 1 && y % 3 == 1 && z % 3 == 1; });
  EXPECT_EQ(simplified(apart, Index3(16), 1).size(), apart.size());
  Voxels pair = {{morton_code(4, 5, 6), {255, 0, 0}}, {morton_code(6, 5, 6), {255, 255, 0}}};
  std::sort(pair.begin(), pair.end(), [](auto& a, auto& b) { return a.place < b.place; });
  const Voxels one = simplified(pair, Index3(16), 1);
  ASSERT_EQ(one.size(), 1u);
  EXPECT_EQ(one[0].place, morton_code(5, 5, 6));
  EXPECT_EQ(one[0].color, (Rgb{255, 188, 0}));  // the mean in linear light
}

/// Whether a voxel of a cube may go: all that is void around it comes together without it, and there is void
/// on both sides along some axis. What is outside of the cube of 64^3 is not void.
bool may_go(const Places& places, std::array<int64_t, 3> at) {
  const auto open = [&](int64_t x, int64_t y, int64_t z) {
    const std::array<int64_t, 3> there = {at[0] + x, at[1] + y, at[2] + z};
    for (const int64_t v : there)
      if (v < 0 || v > 63) return false;
    return std::max({std::abs(x), std::abs(y), std::abs(z)}) <= 1 && places.count(there) == 0;
  };
  const std::array<std::array<int64_t, 3>, 6> faces = {
      {{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}}};
  std::set<std::array<int64_t, 3>> reached;
  const std::function<void(int64_t, int64_t, int64_t)> flood = [&](int64_t x, int64_t y, int64_t z) {
    if (!open(x, y, z) || !reached.insert({x, y, z}).second) return;
    for (const auto& f : faces) flood(x + f[0], y + f[1], z + f[2]);
  };
  const auto is_open = [&](const std::array<int64_t, 3>& f) { return open(f[0], f[1], f[2]); };
  const auto first = std::find_if(faces.begin(), faces.end(), is_open);
  if (first != faces.end()) flood((*first)[0], (*first)[1], (*first)[2]);
  bool between = false;
  for (size_t axis = 0; axis < 3; ++axis) between |= is_open(faces[2 * axis]) && is_open(faces[2 * axis + 1]);
  return between && std::all_of(faces.begin(), faces.end(),
                                [&](const auto& f) { return !is_open(f) || reached.count(f) == 1; });
}

TEST(Simplify, WhatIsTightStays) {
  const auto slab = voxels_where(6, [](uint32_t x, uint32_t, uint32_t z) { return (x + z) / 2 == 20; });
  const auto hole =
      voxels_where(6, [](uint32_t x, uint32_t y, uint32_t z) { return x == 20 && (y != 30 || z != 30); });
  const auto solid = voxels_where(4, [](uint32_t x, uint32_t y, uint32_t z) {
    return x > 2 && x < 9 && y > 2 && y < 9 && z > 2 && z < 9;
  });
  for (const Voxels& voxels : {sphere_shell(6), slab, solid})
    EXPECT_TRUE(same(simplified(voxels, Index3(64), 2), voxels));
  for (const Voxels& voxels : {hole, scattered(5, 3000, 7), scattered(6, 4000, 8)}) {
    const Places before = places_of(voxels), after = places_of(simplified(voxels, Index3(64), 1.5));
    size_t gone = 0;
    for (const auto& [at, color] : before) {
      if (after.count(at) != 0) continue;
      ++gone;
      EXPECT_TRUE(may_go(before, at));
    }
    EXPECT_GT(gone, 0u);
  }
}

/// Voxels with numbers.
class Numbered final : public SurfaceSource {
 public:
  explicit Numbered(Voxels voxels) : voxels_(std::move(voxels)) {
    info_.dims = Index3(64);
    info_.format = VoxelFormat::rgba32;
    attributes_.add(Attribute::id);
  }
  Status read(Context&, const Sink& sink) override {
    std::vector<uint32_t> numbers(voxels_.size());
    for (uint32_t i = 0; i < numbers.size(); ++i) numbers[i] = i;
    return sink(VoxelRun(voxels_, std::as_bytes(std::span(numbers))));
  }

 private:
  Voxels voxels_;
};

TEST(Simplify, AttributesAndColorsAreOfTheNearest) {
  const Voxels voxels = scattered(6, 3000, 9);
  Numbered source(voxels);
  SimplifiedSurface surface(source, 2);
  Reading reading;
  size_t count = 0;
  ASSERT_TRUE(surface.read(reading.ctx, [&](const VoxelRun& run) -> Status {
    EXPECT_EQ(run.attributes.size(), 4 * run.voxels.size());
    for (size_t i = 0; i < run.voxels.size(); ++i, ++count) {
      uint32_t number;
      std::memcpy(&number, &run.attributes[4 * i], 4);
      int64_t least = INT64_MAX;
      for (const SurfaceVoxel& voxel : voxels) least = std::min(least, squared_between(voxel, run.voxels[i]));
      EXPECT_EQ(squared_between(voxels.at(number), run.voxels[i]), least);
    }
    return {};
  }));
  EXPECT_GT(count, 0u);
  EXPECT_LT(count, voxels.size());
  // Colours do not leave the range of those around.
  Voxels gray = voxels;
  for (SurfaceVoxel& voxel : gray) voxel.color = {77, 77, 77};
  for (const SurfaceVoxel& voxel : simplified(gray, Index3(64), 2)) EXPECT_EQ(voxel.color, (Rgb{77, 77, 77}));
}

TEST(Simplify, FilesSayHowFarTheyAreOff) {
  for (const Scene& scene : scenes()) {
    for (const Geometry geometry : {Geometry::dag, Geometry::ssvdag, Geometry::octree}) {
      Options options;
      options.codec = ColorCodec::raw;
      options.geometry = geometry;
      options.simplify = 1.5;
      options.curve = geometry == Geometry::dag ? Curve::hilbert : Curve::morton;
      const auto volume = volume_of(scene.voxels, scene.dims, options);
      ASSERT_TRUE(volume);
      const Voxels left = simplified(scene.voxels, scene.dims, 1.5);
      EXPECT_EQ(volume->params().simplify, 1.5);
      EXPECT_EQ(volume->params().hausdorff, std::sqrt(squared_distance(scene.voxels, left)));
      EXPECT_EQ(volume->params().leaf_voxels, left.size());
      Reading reading;
      Voxels read;
      ASSERT_TRUE(volume->for_each_voxel(
          [&](std::span<const SurfaceVoxel> some) -> Status {
            read.insert(read.end(), some.begin(), some.end());
            return {};
          },
          reading.ctx));
      EXPECT_TRUE(same(read, left));
    }
  }
  for (const double distance : {-1.0, 8.1, std::nan("")}) {
    Options options;
    options.simplify = distance;
    EXPECT_EQ(validate(options).error().code, ErrorCode::usage);
  }
}

}  // namespace
}  // namespace voxkit::color
