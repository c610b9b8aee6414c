// Surfaces that are cropped, moved and merged, against sets of voxels.
#include "libcolor/edit/arrangement.h"

#include <set>

#include "formats/volume_chunks.h"
#include "libcolor/edit/exact.h"
#include "libcolor/edit/lattice.h"
#include "libcolor/edit/levels.h"
#include "libcolor/layout.h"
#include "tests/libcolor/reading.h"

namespace voxkit::color {
namespace {

Options raw() {
  Options options;
  options.codec = ColorCodec::raw;
  return options;
}

struct Part {
  Voxels voxels;
  Index3 dims;
  Index3 at;
};

/// What should come of it.
struct Expected {
  Places places;
  Arrangement::Census census;
};
Expected expected(const std::vector<Part>& parts, Index3 dims) {
  Expected all;
  std::map<std::array<int64_t, 3>, int> times;
  std::map<std::array<int64_t, 3>, bool> differ;
  for (const Part& part : parts)
    for (const auto& [from, color] : places_of(part.voxels)) {
      const std::array<int64_t, 3> to = {from[0] + part.at.x, from[1] + part.at.y, from[2] + part.at.z};
      if (!Box{Index3(0), dims}.contains(Index3(to[0], to[1], to[2]))) continue;
      ++times[to];
      const auto [found, added] = all.places.insert({to, color});
      if (found->second != color) differ[to] = true;
    }
  all.census.voxels = all.places.size();
  for (const auto& [at, count] : times) all.census.shared += count > 1 ? 1 : 0;
  all.census.differing = differ.size();
  return all;
}

/// The same voxels, each in a colour that tells of which scene it is.
Voxels painted(Voxels voxels, uint8_t by) {
  for (SurfaceVoxel& voxel : voxels) voxel.color.b = static_cast<uint8_t>(voxel.color.b / 2 + by);
  return voxels;
}

void expect_arranged(const std::vector<Part>& parts, Index3 dims, const Options& options) {
  std::vector<Placed> placed;
  for (const Part& part : parts) {
    const auto volume = volume_of(part.voxels, part.dims, options);
    ASSERT_TRUE(volume);
    placed.push_back({volume, part.at});
  }
  VolumeInfo info;
  info.dims = dims;
  Arrangement arrangement(placed, info);
  const Expected all = expected(parts, dims);
  for (int time = 0; time < 2; ++time) {
    ASSERT_EQ(places_of(all_of(arrangement)), all.places);
    EXPECT_EQ(arrangement.census().voxels, all.census.voxels);
    EXPECT_EQ(arrangement.census().shared, all.census.shared);
    EXPECT_EQ(arrangement.census().differing, all.census.differing);
  }
}

std::vector<Options> ways() {
  std::vector<Options> all(3, raw());
  all[1].colors = Colors::all;
  all[1].curve = Curve::hilbert;
  all[2].counts = Counts::pointer;
  all[2].curve = Curve::hilbert;
  return all;
}

TEST(Arrangement, OfOneSurfaceAnywhere) {
  const Voxels shell = sphere_shell(5);
  const Voxels odd = inside(scattered(6, 2000, 5), Index3(49, 33, 21));
  std::mt19937 random(9);
  const auto between = [&](int64_t least, int64_t most) {
    return least + static_cast<int64_t>(random() % static_cast<uint64_t>(most - least + 1));
  };
  for (const Options& options : ways())
    for (int round = 0; round < 40; ++round) {
      const bool first = round % 2 == 0;
      const Index3 at(between(-40, 40), between(-40, 40), between(-40, 40));
      const Index3 dims(between(1, 70), between(1, 70), between(1, 70));
      expect_arranged({{first ? shell : odd, first ? Index3(32) : Index3(49, 33, 21), at}}, dims, options);
    }
}

TEST(Arrangement, OfOneVoxelOfAllAndOfNothing) {
  const Part one{{{0, {1, 2, 3}}}, Index3(1), Index3(0)};
  expect_arranged({one}, Index3(1), raw());
  expect_arranged({{one.voxels, one.dims, Index3(5, 6, 7)}}, Index3(8), raw());
  expect_arranged({{one.voxels, one.dims, Index3(5, 6, -1)}}, Index3(8), raw());
  expect_arranged({{one.voxels, one.dims, Index3(0, 0, (1 << 21) - 1)}}, Index3(1, 1, 1 << 21), raw());
  expect_arranged({{sphere_shell(5), Index3(32), Index3(0)}}, Index3(32), raw());
  expect_arranged({{{}, Index3(32), Index3(0)}}, Index3(32), raw());
  expect_arranged({}, Index3(3), raw());
  // The hollow of a shell.
  expect_arranged({{sphere_shell(5), Index3(32), Index3(-12)}}, Index3(8), raw());
}

TEST(Arrangement, OfSeveralSurfacesTheFirstOneCounts) {
  std::mt19937 random(10);
  const auto step = [&] { return static_cast<int64_t>(random() % 31) - 15; };
  for (const Options& options : ways())
    for (int round = 0; round < 20; ++round) {
      const std::vector<Part> parts = {
          {painted(scattered(4, 900, random()), 10), Index3(16), Index3(step(), step(), step())},
          {sphere_shell(5), Index3(32), Index3(step(), step(), step())},
          {painted(scattered(5, 3000, random()), 90), Index3(32), Index3(step(), step(), step())},
          {sphere_shell(5), Index3(32), Index3(step(), step(), step())}};
      expect_arranged(parts, Index3(40, 29, 33), options);
      // Twice the same: every voxel is shared, and none differs.
      expect_arranged({parts[1], parts[1]}, Index3(48), options);
    }
}

TEST(Arrangement, EntersNothingThatIsVoidOrOutside) {
  const Voxels shell = sphere_shell(7);
  const auto volume = volume_of(shell, Index3(128), raw());
  ASSERT_TRUE(volume);
  // Cells of 4 voxels a side and larger ones, up to all, that have any: each once.
  const auto cells_with_voxels = [&](Index3 corner, int height) {
    std::set<std::pair<int, uint64_t>> cells;
    for (const SurfaceVoxel& voxel : shell) {
      const Index3 at = Index3(morton_place(voxel.place)) - corner;
      if (!Box{Index3(0), Index3(int64_t{1} << height)}.contains(at)) continue;
      for (int h = leaf_height; h <= height; ++h) cells.insert({h, voxel.place >> 3 * h});
    }
    return cells.size();
  };
  const auto cells = [&](Index3 lo, Index3 dims) {
    VolumeInfo info;
    info.dims = dims;
    Arrangement part({{volume, Index3(0) - lo}}, info);
    all_of(part);
    return part.census().cells;
  };
  const uint64_t all = cells(Index3(0), Index3(128));
  EXPECT_GT(all, 3000u);
  EXPECT_EQ(all, cells_with_voxels(Index3(0), 7));
  EXPECT_EQ(cells(Index3(64, 0, 64), Index3(64)), cells_with_voxels(Index3(64, 0, 64), 6));
  EXPECT_EQ(cells(Index3(96, 32, 96), Index3(32)), cells_with_voxels(Index3(96, 32, 96), 5));
  // Cells of the shell, of 4 voxels a side: some hundredths of the whole.
  EXPECT_LT(cells(Index3(0, 56, 56), Index3(16)), all / 20);
  EXPECT_LT(cells(Index3(1, 57, 58), Index3(16)), all / 20);
  // Inside, a few on the way down.
  EXPECT_LE(cells(Index3(40), Index3(40)), 8u);
  EXPECT_EQ(cells(Index3(200), Index3(40)), 0u);
}

TEST(Arrangement, PartsOfAFileMakeThatFile) {
  for (const Colors colors : {Colors::leaf, Colors::all})
    for (const Index3 cut : {Index3(64), Index3(33, 70, 101), Index3(1, 127, 64)}) {
      Options options = raw();
      options.colors = colors;
      ListSource source(sphere_shell(7), Index3(128));
      const std::vector<std::byte> whole = compressed(source, options);
      const auto volume = opened(whole);
      ASSERT_TRUE(volume);
      std::vector<Placed> parts;
      std::vector<VolumeInfo> infos;
      std::vector<std::string> names;
      for (uint32_t octant = 0; octant < 8; ++octant) {
        Index3 lo(0), hi(128);
        for (int a = 0; a < 3; ++a) ((octant >> a & 1) != 0 ? lo : hi)[a] = cut[a];
        VolumeInfo info = volume->info();
        info.dims = hi - lo;
        info.affine = info.affine.moved_to(
            {static_cast<double>(lo.x), static_cast<double>(lo.y), static_cast<double>(lo.z)});
        Arrangement crop({{volume, Index3(0) - lo}}, info);
        const auto part = opened(compressed(crop, options));
        ASSERT_TRUE(part);
        parts.insert(parts.begin(), {part, Index3(0)});
        infos.insert(infos.begin(), part->info());
        names.push_back("part");
      }
      const auto grid = common_grid(infos, names);
      ASSERT_TRUE(grid) << grid.error().what;
      for (size_t i = 0; i < parts.size(); ++i) parts[i].at = grid->at[i];
      Arrangement merged(parts, grid->info);
      EXPECT_EQ(compressed(merged, options), whole);
      EXPECT_EQ(merged.census().shared, 0u);
    }
}

TEST(Arrangement, CountsTheVoxelsOfABox) {
  const Voxels voxels = inside(scattered(6, 3000, 6), Index3(49, 33, 21));
  const auto volume = volume_of(voxels, Index3(49, 33, 21), raw());
  ASSERT_TRUE(volume);
  std::mt19937 random(3);
  const auto any = [&] { return static_cast<int64_t>(random() % 90) - 20; };
  for (int round = 0; round < 200; ++round) {
    Box box{{any(), any(), any()}, {any(), any(), any()}};
    if (round == 0) box = volume->info().box();
    uint64_t expected = 0;
    for (const SurfaceVoxel& voxel : voxels) expected += box.contains(Index3(morton_place(voxel.place)));
    const auto count = voxels_in(*volume, box);
    ASSERT_TRUE(count);
    EXPECT_EQ(*count, expected);
  }
}

/// Every colour that a file decodes to, in whatever way it is stored, can be stored again without a loss.
TEST(ExactOptions, KeepColorsOfAllCodecs) {
  for (const ColorCodec codec : codecs())
    for (const Colors colors : {Colors::leaf, Colors::all}) {
      Options options;
      options.codec = codec;
      options.colors = colors;
      options.quality = 50;
      options.palette = 40;
      options.curve = colors == Colors::all ? Curve::hilbert : Curve::morton;
      if (!validate(options)) continue;
      const auto volume = volume_of(scattered(5, 3000, 2), Index3(32), options);
      ASSERT_TRUE(volume);
      const auto decoded = surface_of(volume);
      const Params params = volume->params();
      const Options exact = exact_options({&params, 1});
      EXPECT_EQ(exact.colors, colors);
      EXPECT_EQ(exact.curve, options.curve);
      const auto again = opened(compressed(*decoded, exact));
      ASSERT_TRUE(again);
      EXPECT_EQ(places_of(all_of(*surface_of(again))), places_of(all_of(*decoded)))
          << "codec " << static_cast<int>(codec);
      EXPECT_EQ(again->params().grmse, 0);
    }
}

TEST(ExactOptions, TakeTheFirstFilesWayWhereItIsExact) {
  std::vector<Params> files(2);
  const auto codec = [&](ColorCodec first, ColorCodec second, uint32_t first_colors = 0,
                         uint32_t colors = 0) {
    files[0].codec = first;
    files[1].codec = second;
    files[0].palette_colors = first_colors;
    files[1].palette_colors = colors;
    return exact_options(files);
  };
  using C = ColorCodec;
  EXPECT_EQ(codec(C::raw, C::vws).codec, C::raw);
  EXPECT_EQ(codec(C::png, C::jpeg).codec, C::png);
  EXPECT_EQ(codec(C::predicted, C::vws).codec, C::predicted);
  EXPECT_EQ(codec(C::jp2, C::raw).quality, 100);
  for (const C lossy : {C::vws, C::fws, C::bc1, C::bc7, C::astc, C::jpeg}) {
    EXPECT_EQ(codec(lossy, C::raw).codec, C::vws);
    EXPECT_EQ(codec(lossy, C::raw).threshold, 0);
  }
  EXPECT_EQ(codec(C::palette, C::palette, 5, 7).palette, 12u);
  EXPECT_EQ(codec(C::palette, C::palette, 1 << 15, 1 << 15).codec, C::palette);
  EXPECT_EQ(codec(C::palette, C::palette, 1 << 15, (1 << 15) + 1).codec, C::vws);
  EXPECT_EQ(codec(C::palette, C::raw, 5).codec, C::vws);
  for (const Geometry geometry : {Geometry::dag, Geometry::octree}) {
    files[0].geometry = geometry;
    EXPECT_EQ(exact_options(files).geometry, geometry);
  }
  files[0].geometry = Geometry::ssvdag;
  EXPECT_EQ(exact_options(files).geometry, std::nullopt);
}

/// A file in which 8^17 ways lead from the root to a node that has nothing in it: no reader follows them all.
TEST(Arrangement, NodesWithoutOctantsAreFoundAtOnce) {
  VolumeInfo info;
  info.dims = Index3(1 << 20);
  info.format = VoxelFormat::rgba32;
  MemoryBudget memory;
  std::vector<std::byte> bytes;
  ContainerWriter writer(
      [&](std::span<const std::byte> some) -> Status {
        bytes.insert(bytes.end(), some.begin(), some.end());
        return {};
      },
      Codec::color, container_version_for(info), 0, memory);
  ASSERT_TRUE(add_volume_info(writer, info));
  Params params;
  params.codec = ColorCodec::raw;
  params.height = 20;
  params.leaf_voxels = params.color_count = 1;
  const uint64_t leaf = 1;
  const std::array<std::byte, 3> color{};
  ASSERT_TRUE(writer.add(colors_kind, 0, 0, color));
  ASSERT_TRUE(writer.add(leaves_kind, 0, 0, std::as_bytes(std::span(&leaf, 1))));
  const std::array<uint32_t, 9> node = {0xff | 1 << 8};
  const uint32_t nothing = 0;
  for (uint32_t h = 3; h <= 20; ++h)
    ASSERT_TRUE(writer.add(nodes_kind, h, 0,
                           h == 3 ? std::as_bytes(std::span(&nothing, 1)) : std::as_bytes(std::span(node))));
  ASSERT_TRUE(writer.add(params_kind, 0, 0, pack_params(params)));
  ASSERT_TRUE(writer.finish());
  const auto volume = opened(bytes);
  ASSERT_TRUE(volume);
  Reading reading;
  const auto refused = [](const auto& result) { return !result && result.error().code == ErrorCode::input; };
  const SurfaceSource::Sink nowhere = [](std::span<const SurfaceVoxel>) -> Status { return {}; };
  EXPECT_TRUE(refused(volume->check(reading.ctx)));
  EXPECT_TRUE(refused(volume->for_each_voxel(nowhere, reading.ctx)));
  EXPECT_TRUE(refused(surface_of(volume, 3, CellColors::means)->read(reading.ctx, nowhere)));
  EXPECT_TRUE(refused(Level(volume, 1).count(level_info(volume->info(), 1).box())));
  EXPECT_TRUE(refused(voxels_in(*volume, {Index3(0), Index3(1 << 19)})));
  std::vector<std::byte> room(8 * 8 * 8 * 4);
  const VoxelSpan span = packed(room.data(), Index3(8), VoxelFormat::rgba32);
  EXPECT_TRUE(refused(open_level(volume, 4, CellColors::means)->read({Index3(0), Index3(8)}, span)));
  EXPECT_TRUE(refused(volume->decode({Index3(0), Index3(8)}, span)));
  Arrangement moved({{volume, Index3(1)}}, info);
  EXPECT_TRUE(refused(moved.read(reading.ctx, nowhere)));
}

}  // namespace
}  // namespace voxkit::color
