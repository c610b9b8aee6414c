#include "formats/fill.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "formats/copy.h"
#include "tests/memory_volume.h"

namespace voxkit {
namespace {

class FillTest : public testing::Test {
 protected:
  FillTest() { ctx_.memory = &budget_; }
  std::unique_ptr<VolumeSource> source(const std::vector<float>& values) {
    VolumeInfo info;
    info.dims = {static_cast<int64_t>(values.size()), 1, 1};
    info.format = VoxelFormat::float32;
    info.sample_type = SampleType::f32;
    std::vector<std::byte> voxels(values.size() * 4);
    std::memcpy(voxels.data(), values.data(), voxels.size());
    return std::make_unique<test::MemorySource>(info, voxels);
  }
  static std::vector<float> read(VolumeSource& from) {
    std::vector<float> values(static_cast<size_t>(from.info().dims.x));
    EXPECT_TRUE(from.read(from.info().box(), packed(reinterpret_cast<std::byte*>(values.data()),
                                                    from.info().dims, VoxelFormat::float32)));
    return values;
  }
  MemoryBudget budget_;
  Context ctx_;
};

TEST_F(FillTest, IsNoNumberInsideAndItselfOutside) {
  std::vector<std::string> notes;
  const auto note = [&](const std::string& text) { notes.push_back(text); };
  auto inside = with_fill(source({1, -9999, 2, NAN}), -9999, note);
  EXPECT_EQ(inside->info().fill, -9999);
  const auto values = read(*inside);
  EXPECT_EQ(values[0], 1);
  EXPECT_TRUE(std::isnan(values[1]));
  EXPECT_TRUE(std::isnan(values[3]));
  EXPECT_EQ(*measure_range(*inside, ctx_), (ValueRange{1, 2}));
  EXPECT_EQ(notes, std::vector<std::string>{"voxels that are no number become the fill value, -9999"});
  read(*with_fill(source({1, -9999, 2, 3}), -9999, note));
  read(*with_fill(source({1, NAN, 2, 3}), NAN, note));
  EXPECT_EQ(notes.size(), 1u);
  const auto outside = fill_restored(std::move(inside));
  EXPECT_EQ(read(*outside), (std::vector<float>{1, -9999, 2, -9999}));
}

TEST_F(FillTest, AFarValueIsAnOutlier) {
  const auto outlier = [&](const std::vector<float>& values) {
    auto volume = source(values);
    return take_census(*volume, ctx_)->outlier;
  };
  EXPECT_EQ(outlier({1, 2, 3, 1e20f, 1e20f}), 1e20f);
  EXPECT_EQ(outlier({-1e9f, 5, 6, 7}), -1e9f);
  EXPECT_EQ(outlier({1, 2, 3, 2002}), std::nullopt);  // 1000 extents away, not more
  EXPECT_EQ(outlier({0, 1e20f}), std::nullopt);       // one other value has no extent
  EXPECT_EQ(outlier({1, 2, 3, INFINITY}), std::nullopt);
  auto volume = source({1, NAN, 2, 1e20f});
  const auto census = take_census(*volume, ctx_);
  EXPECT_TRUE(census->has_nan);
  EXPECT_EQ(census->rest, (ValueRange{1, 2}));
}

TEST_F(FillTest, OfIntegersTheRangeLeavesItOut) {
  VolumeInfo info;
  info.dims = {4, 1, 1};
  const std::vector<std::byte> voxels{std::byte{3}, std::byte{255}, std::byte{9}, std::byte{255}};
  const auto named = with_fill(std::make_unique<test::MemorySource>(info, voxels), 255);
  EXPECT_EQ(*measure_range(*named, ctx_), (ValueRange{3, 9}));
}

}  // namespace
}  // namespace voxkit
