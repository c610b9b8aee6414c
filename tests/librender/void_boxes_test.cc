// Boxes of void are void, and as large as they get; asking all voxels of a box agrees with looking at each.
#include "librender/cast/void_boxes.h"

#include <gtest/gtest.h>

#include <random>

#include "formats/volume/readers.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::render {
namespace {

class VoidBoxTest : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    auto source = open_builtin(GetParam());
    ASSERT_TRUE(source);
    volume_ =
        svmm::test::encode_to_memory(**source, svmm::test::make_params((*source)->info().format, 90, {}, 4))
            .open();
    voxels_ = svmm::test::decode_all(*volume_);
    info_ = volume_->info();
    // Half of the voxels, at least, are void.
    std::vector<uint32_t> values;
    const auto bytes = static_cast<size_t>(voxel_bytes(info_.format));
    for (size_t i = 0; i < voxels_.size(); i += bytes) {
      Voxel v;
      std::memcpy(v.bytes.data(), &voxels_[i], bytes);
      values.push_back(v.as<uint32_t>());
    }
    std::nth_element(values.begin(), values.begin() + static_cast<int64_t>(values.size() / 2), values.end());
    const double median = values[values.size() / 2];
    color_of_ = ColorOf(info_.format, {median, median + 1});
  }
  bool is_void(const Voxel& v) const { return color_of_.is_void(v); }
  bool is_void_at(int64_t x, int64_t y, int64_t z) const {
    const auto bytes = static_cast<size_t>(voxel_bytes(info_.format));
    Voxel v;
    std::memcpy(v.bytes.data(),
                &voxels_[static_cast<size_t>((z * info_.dims.y + y) * info_.dims.x + x) * bytes], bytes);
    return is_void(v);
  }
  bool is_void_in(const VoidBox& box) const {
    for (uint32_t z = box.lo[2]; z < box.hi[2]; ++z)
      for (uint32_t y = box.lo[1]; y < box.hi[1]; ++y)
        for (uint32_t x = box.lo[0]; x < box.hi[0]; ++x)
          if (!is_void_at(x, y, z)) return false;
    return true;
  }
  VoidBox random_box(std::mt19937& random) const {
    VoidBox box;
    for (int a = 0; a < 3; ++a) {
      const auto side = static_cast<uint32_t>(info_.dims[a]);
      box.lo[a] = static_cast<uint32_t>(random()) % side;
      box.hi[a] = box.lo[a] + 1 + static_cast<uint32_t>(random()) % std::min(side - box.lo[a], 9u);
    }
    return box;
  }

  std::shared_ptr<const svmm::Volume> volume_;
  std::vector<std::byte> voxels_;
  VolumeInfo info_;
  ColorOf color_of_{VoxelFormat::rgba32, {}};
};

TEST_P(VoidBoxTest, AskingAllVoxelsIsLookingAtEach) {
  const svmm::MappedPools pools(*volume_);
  const auto is = [this](const Voxel& v) { return is_void(v); };
  std::mt19937 random(5);
  int all = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const VoidBox box = random_box(random);
    svmm::EveryVoxel every(volume_->store().view, pools, is, 1 << 20);
    const bool expected = is_void_in(box);
    ASSERT_EQ(every(box.lo, box.hi), expected);
    ASSERT_EQ(every.found(), !expected);
    if (!expected) {  // and where it is not: all that lies there and in the box
      VoidBox where = box;
      for (int a = 0; a < 3; ++a) {
        where.lo[a] = static_cast<uint32_t>(std::max<uint64_t>(box.lo[a], every.begin(a)));
        where.hi[a] = static_cast<uint32_t>(std::min<uint64_t>(box.hi[a], every.end(a)));
        ASSERT_LT(where.lo[a], where.hi[a]);
      }
      for (uint32_t z = where.lo[2]; z < where.hi[2]; ++z)
        for (uint32_t y = where.lo[1]; y < where.hi[1]; ++y)
          for (uint32_t x = where.lo[0]; x < where.hi[0]; ++x) ASSERT_FALSE(is_void_at(x, y, z));
    }
    all += expected;
    svmm::EveryVoxel poor(volume_->store().view, pools, is, 1);
    if (poor(box.lo, box.hi)) {
      ASSERT_TRUE(expected);
    }
  }
  EXPECT_GT(all, 10);
  EXPECT_LT(all, 2900);
}

TEST_P(VoidBoxTest, BoxesAreVoidAndDoNotGrowFurther) {
  const svmm::MappedPools pools(*volume_);
  const auto is = [this](const Voxel& v) { return is_void(v); };
  const int64_t dims[3] = {info_.dims.x, info_.dims.y, info_.dims.z};
  std::mt19937 random(6);
  int grown = 0;
  for (int trial = 0; trial < 300; ++trial) {
    VoidBox cell = random_box(random);
    for (int a = 0; a < 3; ++a) cell.hi[a] = cell.lo[a] + 1;
    if (!is_void_in(cell)) continue;
    svmm::EveryVoxel every(volume_->store().view, pools, is, 1 << 30);
    const VoidBox box = grow(cell, dims, every);
    ASSERT_TRUE(is_void_in(box));
    for (int a = 0; a < 3; ++a) {
      ASSERT_LE(box.lo[a], cell.lo[a]);
      ASSERT_GE(box.hi[a], cell.hi[a]);
      ASSERT_LE(box.hi[a], dims[a]);
      for (const bool up : {false, true}) {
        if (up ? box.hi[a] == dims[a] : box.lo[a] == 0) continue;
        VoidBox more = box;
        (up ? more.hi[a] : more.lo[a]) += up ? 1u : ~0u;
        ASSERT_FALSE(is_void_in(more));
      }
    }
    grown += is_void_in(box);
  }
  EXPECT_GT(grown, 20);
}

INSTANTIATE_TEST_SUITE_P(Volumes, VoidBoxTest,
                         testing::Values("menger:3", "sphere:40", "membrane:60,50,9:2", "marschner-lobb:24"));

}  // namespace
}  // namespace voxkit::render
