// Attributes of surfaces that are made of compressed ones: levels, parts, merged ones, selections.
#include <gtest/gtest.h>

#include <map>

#include "libcolor/attributes/attribute_selection.h"
#include "libcolor/edit/arrangement.h"
#include "libcolor/edit/exact.h"
#include "libcolor/edit/levels.h"
#include "tests/libcolor/attribute_scenes.h"
#include "tests/libcolor/reading.h"

namespace voxkit::color {
namespace {

using Values = std::map<uint64_t, std::vector<std::byte>>;

/// By place.
Values values_by_place(SurfaceSource& source) {
  Reading reading;
  Values values;
  const size_t bytes = source.attributes().bytes();
  EXPECT_TRUE(source.read(reading.ctx, [&](const VoxelRun& run) -> Status {
    EXPECT_EQ(run.attributes.size(), run.voxels.size() * bytes);
    for (size_t i = 0; i < run.voxels.size(); ++i) {
      const auto own = run.attributes.subspan(i * bytes, bytes);
      values[run.voxels[i].place].assign(own.begin(), own.end());
    }
    return {};
  }));
  return values;
}

std::shared_ptr<const Volume> attributed(const Voxels& voxels, int64_t side, AttributeSet set, uint64_t seed,
                                         Options options = {}) {
  options.codec = ColorCodec::raw;
  AttributedSource source(voxels, Index3(side), set, interleaved(set, voxels.size(), Pattern::runs, seed));
  return opened(compressed(source, options));
}

TEST(AttributeEdits, LevelsHaveWhatCellsHave) {
  Options all;
  all.colors = Colors::all;
  for (const Voxels& voxels : {sphere_shell(4), scattered(4, 40, 2)}) {
    const auto leaf = attributed(voxels, 16, all_attributes(), 3);
    const auto cells = attributed(voxels, 16, all_attributes(), 3, all);
    ASSERT_TRUE(leaf && cells);
    for (int level = 0; level < level_count(leaf->info()); ++level) {
      SCOPED_TRACE(level);
      const auto means = surface_of(leaf, level), stored = surface_of(cells, level);
      EXPECT_EQ(means->attributes(), all_attributes());
      EXPECT_EQ(values_by_place(*means), values_by_place(*stored));
    }
  }
}

TEST(AttributeEdits, BoxesOfLevelsHaveAlpha) {
  const Voxels voxels = sphere_shell(4);
  const auto volume = attributed(voxels, 16, only(Attribute::opacity), 3);
  for (const int level : {0, 1, 2}) {
    const int64_t side = 16 >> level;
    std::vector<std::byte> box(static_cast<size_t>(side * side * side * 4));
    ASSERT_TRUE(open_level(volume, level, CellColors::stored)
                    ->read({Index3(0), Index3(side)}, packed(box.data(), Index3(side), VoxelFormat::rgba32)));
    const auto surface = surface_of(volume, level);
    const Values values = values_by_place(*surface);
    for (const auto& [place, own] : values) {
      const auto p = morton_place(place);
      EXPECT_EQ(box[static_cast<size_t>(((p.z * side + p.y) * side + p.x) * 4 + 3)],
                std::max(own[0], std::byte{1}));
    }
  }
}

TEST(AttributeEdits, PartsAndWhatIsMergedKeepThem) {
  const Voxels voxels = sphere_shell(4);
  const auto whole = attributed(voxels, 16, all_attributes(), 7);
  ASSERT_TRUE(whole);
  const auto surface = surface_of(whole);
  const Values expected = values_by_place(*surface);
  // Cut in two, away from multiples of 4, and put together again.
  std::vector<Placed> parts;
  for (const auto& [at, size] :
       {std::pair{Index3(0), Index3(7, 16, 16)}, {Index3(7, 0, 0), Index3(9, 16, 16)}}) {
    VolumeInfo info = whole->info();
    info.dims = size;
    Arrangement cut({{whole, -at}}, info);
    const std::array<Params, 1> params = {whole->params()};
    auto part = opened(compressed(cut, exact_options(params)));
    ASSERT_TRUE(part);
    EXPECT_EQ(part->params().attributes, all_attributes());
    parts.push_back({part, at});
  }
  Arrangement merged(parts, whole->info());
  EXPECT_EQ(values_by_place(merged), expected);
  // Blocks with thresholds of 0 are exact as well.
  Options exact;
  exact.threshold = 0;
  exact.attribute_thresholds.fill(0);
  Arrangement again(parts, whole->info());
  const auto blocks = opened(compressed(again, exact));
  ASSERT_TRUE(blocks);
  for (const AttributeParams& p : blocks->attributes()) EXPECT_EQ(p.most_error, 0);
}

TEST(AttributeEdits, WhatNotAllHaveIsLeftOut) {
  const Voxels voxels = sphere_shell(3);
  AttributeSet two = only(Attribute::opacity);
  two.add(Attribute::id);
  Arrangement merged({{attributed(voxels, 8, two, 1), Index3(0)},
                      {attributed(voxels, 8, only(Attribute::id), 1), Index3(0)}},
                     attributed(voxels, 8, two, 1)->info());
  EXPECT_EQ(merged.attributes(), only(Attribute::id));
  for (const auto& [place, own] : values_by_place(merged)) EXPECT_EQ(own.size(), 4u);
}

TEST(AttributeEdits, ASelectionHasThoseThatAreWanted) {
  const Voxels voxels = sphere_shell(3);
  const auto values = interleaved(all_attributes(), voxels.size(), Pattern::random, 4);
  AttributeSet some = only(Attribute::normal);
  some.add(Attribute::id);
  const auto selected =
      with_attributes(std::make_unique<AttributedSource>(voxels, Index3(8), all_attributes(), values), some);
  EXPECT_EQ(selected->attributes(), some);
  const Values own = values_by_place(*selected);
  for (size_t i = 0; i < voxels.size(); ++i) {
    const auto& of = own.at(voxels[i].place);
    EXPECT_EQ(value_in(of, some, 0, Attribute::normal),
              value_in(values, all_attributes(), i, Attribute::normal));
    EXPECT_EQ(value_in(of, some, 0, Attribute::id), value_in(values, all_attributes(), i, Attribute::id));
  }
}

}  // namespace
}  // namespace voxkit::color
