// Grids of one world: which lie on one lattice, and where.
#include "libcolor/edit/lattice.h"

#include <gtest/gtest.h>

#include <cmath>

namespace voxkit::color {
namespace {

VolumeInfo at(Index3 dims, const Affine::Vector& spacing, const Affine::Vector& origin) {
  VolumeInfo info;
  info.format = VoxelFormat::rgba32;
  info.dims = dims;
  info.affine = Affine::plain(spacing, origin);
  return info;
}
Result<CommonGrid> together(const std::vector<VolumeInfo>& infos) {
  std::vector<std::string> names;
  for (size_t i = 0; i < infos.size(); ++i) names.push_back(std::string(1, static_cast<char>('a' + i)));
  return common_grid(infos, names);
}

TEST(CommonGrid, HoldsAll) {
  const auto grid =
      together({at({10, 20, 30}, {0.5, 0.5, 2}, {1, 2, 3}), at({5, 5, 5}, {0.5, 0.5, 2}, {-1, 2, 9}),
                at({5, 5, 5}, {0.5, 0.5, 2}, {7, 1, 3})});
  ASSERT_TRUE(grid) << grid.error().what;
  // In steps from the first: 0, 0, 0; -4, 0, 3; 12, -2, 0.
  EXPECT_EQ(grid->info.dims, Index3(21, 22, 30));
  EXPECT_EQ(grid->at, (std::vector<Index3>{{4, 2, 0}, {0, 2, 3}, {16, 0, 0}}));
  EXPECT_EQ(grid->info.affine.origin, (Affine::Vector{-1, 1, 3}));
  EXPECT_TRUE(grid->notes.empty());
}

TEST(CommonGrid, OfOneIsThatOne) {
  VolumeInfo info = at({3, 4, 5}, {1, 1, 1}, {0.1, 0.2, 0.3});
  info.description = "a house";
  info.unit = Unit::metre;
  const auto grid = together({info});
  ASSERT_TRUE(grid);
  EXPECT_EQ(grid->info.dims, info.dims);
  EXPECT_EQ(grid->info.affine, info.affine);
  EXPECT_EQ(grid->info.description, "a house");
  EXPECT_EQ(grid->info.unit, Unit::metre);
}

TEST(CommonGrid, MayBeTurnedShearedAndRounded) {
  VolumeInfo first = at({100, 100, 100}, {1, 1, 1}, {1000, -5, 0.1});
  first.affine.axes = {{{0, 0.3, 0}, {-0.3, 0, 0.01}, {0, 0, 0.7}}};
  VolumeInfo second = first;
  second.affine = first.affine.moved_to({-3, 50, 7});
  for (double& x : second.affine.origin) x += 1e-5;
  const auto grid = together({first, second});
  ASSERT_TRUE(grid) << grid.error().what;
  EXPECT_EQ(grid->at, (std::vector<Index3>{{3, 0, 0}, {0, 50, 7}}));
}

TEST(CommonGrid, IsRefusedWhereVoxelsLieBetweenOthers) {
  const VolumeInfo first = at({10, 10, 10}, {1, 1, 1}, {0, 0, 0});
  const auto refused = [&](const VolumeInfo& second, const char* why) {
    const auto grid = together({first, second});
    return !grid && grid.error().code == ErrorCode::input && grid.error().file == "b" &&
           grid.error().what.find(why) != std::string::npos;
  };
  EXPECT_TRUE(refused(at({10, 10, 10}, {1, 1, 1}, {0.5, 0, 0}), "at 0.5, 0, 0 in steps of a"));
  EXPECT_TRUE(refused(at({10, 10, 10}, {1, 1, 1}, {0, 0, 0.02}), "whole numbers"));
  EXPECT_TRUE(refused(at({10, 10, 10}, {1, 2, 1}, {0, 0, 0}), "axes"));
  // A drift that the last voxel shows.
  EXPECT_TRUE(refused(at({2000, 1, 1}, {1.00001, 1, 1}, {0, 0, 0}), "axes"));
  EXPECT_TRUE(refused(at({10, 10, 10}, {1, 1, 1}, {1e18, 0, 0}), "whole numbers"));
  EXPECT_TRUE(refused(at({10, 10, 10}, {1, 1, 1}, {std::nan(""), 0, 0}), "whole numbers"));
  VolumeInfo other = first;
  other.unit = Unit::metre;
  EXPECT_TRUE(refused(other, "unit m: expected world unknown, unit unknown, as of a"));
  other = first;
  other.world = World::lps;
  EXPECT_TRUE(refused(other, "world LPS"));
}

TEST(CommonGrid, IsRefusedWhereItIsTooLarge) {
  constexpr double most = 1 << 21;
  const VolumeInfo one = at({1, 1, 1}, {1, 1, 1}, {0, 0, 0});
  const auto grid = together({one, at({1, 1, 1}, {1, 1, 1}, {most - 1, 0, 0})});
  ASSERT_TRUE(grid);
  EXPECT_EQ(grid->info.dims, Index3(1 << 21, 1, 1));
  EXPECT_FALSE(together({one, at({1, 1, 1}, {1, 1, 1}, {most, 0, 0})}));
  EXPECT_FALSE(together({one, at({1, 1, 1}, {1, 1, 1}, {most - 1, most - 1, most - 1})}));
}

TEST(CommonGrid, NotesWhatOnlyOthersSay) {
  VolumeInfo first = at({2, 2, 2}, {1, 1, 1}, {0, 0, 0}), second = first;
  second.description = "a door";
  second.space_code = 2;
  const auto grid = together({first, second});
  ASSERT_TRUE(grid);
  ASSERT_EQ(grid->notes.size(), 2u);
  EXPECT_NE(grid->notes[0].find("b: dropped: its description"), std::string::npos);
  EXPECT_NE(grid->notes[1].find("b: dropped: space code 2"), std::string::npos);
}

}  // namespace
}  // namespace voxkit::color
