// Regions, single voxels, mip levels and `uniform` agree with decoding everything; only the chunks needed are
// touched.
#include <gtest/gtest.h>

#include "formats/volume/readers.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;

struct Case {
  VoxelFormat format;
  Base base;
  Layout layout;
  std::vector<int> widths;
};

std::vector<Case> cases() {
  std::vector<Case> out;
  for (VoxelFormat f : all_formats)
    for (Base base : {Base::raw, Base::bitmap, Base::alpha, Base::gray, Base::bc1})
      for (Layout layout : {Layout::plain, Layout::thesis})
        for (std::vector<int> widths : {std::vector<int>{}, std::vector<int>{4, 2}, std::vector<int>{8}}) {
          Params params = make_params(f, 90, widths, 4, layout);
          params.base = base;
          if (validate(params, make_info({50, 40, 30}, f))) out.push_back({f, base, layout, widths});
        }
  return out;
}

TEST(SvmmAccess, RegionsSamplesAndUniformAgreeWithTheWhole) {
  std::mt19937 random(3);
  int checked = 0;
  for (const Case& c : cases()) {
    const VolumeInfo info = make_info({50, 43, 31}, c.format);
    voxkit::test::MemorySource source(info, bytes_of(make_voxels(info, Content::blobs, 11), c.format));
    Params params = make_params(c.format, 90, c.widths, 4, c.layout);
    params.base = c.base;
    const auto volume = encode_to_memory(source, params).open();
    const size_t bytes = static_cast<size_t>(voxel_bytes(c.format));
    for (int level = 0; level < static_cast<int>(volume->levels().size()); ++level) {
      const Index3 dims = volume->dims_at(level);
      const auto all = decode_all(*volume, level);
      const auto at = [&](Index3 v) {
        return &all[static_cast<size_t>((v.z * dims.y + v.y) * dims.x + v.x) * bytes];
      };
      for (int trial = 0; trial < 20; ++trial) {
        Box box;
        for (int i = 0; i < 3; ++i) {
          const auto side = static_cast<uint64_t>(dims[i]);
          box.lo[i] = static_cast<int64_t>(random() % side);
          box.hi[i] = box.lo[i] + 1 +
                      static_cast<int64_t>(random() % (trial % 2 ? std::min<uint64_t>(4, side) : side));
          box.hi[i] = std::min(box.hi[i], dims[i]);
        }
        std::vector<std::byte> part(static_cast<size_t>(box.voxels()) * bytes);
        ASSERT_TRUE(volume->decode(box, level, packed(part.data(), box.size(), c.format)));
        const auto uniform = volume->uniform(box, level);
        const std::byte* p = part.data();
        for (int64_t z = box.lo.z; z < box.hi.z; ++z)
          for (int64_t y = box.lo.y; y < box.hi.y; ++y)
            for (int64_t x = box.lo.x; x < box.hi.x; ++x, p += bytes) {
              ASSERT_EQ(0, std::memcmp(p, at({x, y, z}), bytes));
              if (uniform) {
                ASSERT_EQ(0, std::memcmp(p, uniform->bytes.data(), bytes));
              }
            }
        const auto sample = volume->sample(box.lo, level);
        ASSERT_TRUE(sample);
        ASSERT_EQ(0, std::memcmp(sample->bytes.data(), at(box.lo), bytes))
            << name(c.format) << " base " << static_cast<int>(c.base) << " level " << level;
        ++checked;
      }
    }
  }
  EXPECT_GT(checked, 1000);
}

TEST(SvmmAccess, UniformIsFoundInVoid) {
  auto source = open_builtin("menger:4");
  const auto volume = encode_to_memory(**source, make_params(VoxelFormat::rgba32, 90, {}, 4)).open();
  const auto centre = volume->uniform({{32, 32, 32}, {48, 48, 48}}, 0);
  ASSERT_TRUE(centre);
  EXPECT_EQ(*centre, Voxel{});
  EXPECT_FALSE(volume->uniform({{0, 0, 0}, {9, 9, 9}}, 0));
}

TEST(SvmmAccess, OnlyTheChunksNeededAreTouched) {
  auto source = open_builtin("noise:256:1");
  const auto volume = encode_to_memory(**source, make_params(VoxelFormat::density8, 100, {4}, 16)).open();
  const size_t all = volume->container().table().size();
  ASSERT_GT(all, 15u);
  ASSERT_LE(volume->container().chunks_touched(), 2u);  // volume and parameters
  decode_all(*volume, static_cast<int>(volume->levels().size()) - 1);
  EXPECT_LE(volume->container().chunks_touched(), 3u);  // the root
  std::vector<std::byte> out(8 * 8 * 8);
  ASSERT_TRUE(volume->decode({{100, 100, 100}, {108, 108, 108}}, 0,
                             packed(out.data(), Index3(8), VoxelFormat::density8)));
  EXPECT_LE(volume->container().chunks_touched(), 8u);
}

TEST(SvmmAccess, LossyBasesKeepVoidAndComeClose) {
  auto source = open_builtin("menger:3");
  const Index3 dims = (*source)->info().dims;
  std::vector<std::byte> original(static_cast<size_t>(dims.x * dims.y * dims.z * 4));
  ASSERT_TRUE((*source)->read({Index3(0), dims}, packed(original.data(), dims, VoxelFormat::rgba32)));
  for (Base base : {Base::bitmap, Base::alpha, Base::gray, Base::bc1})
    for (int w : {2, 4, 8}) {
      Params params = make_params(VoxelFormat::rgba32, 99, {w}, 4);
      params.base = base;
      if (!validate(params, (*source)->info())) continue;
      const auto decoded = decode_all(*encode_to_memory(**source, params).open());
      int worst = 0;
      for (size_t i = 0; i < original.size(); i += 4) {
        ASSERT_EQ(original[i + 3], decoded[i + 3]);  // alpha is 0 or 255: every base keeps that
        for (size_t c = 0; c < 3; ++c) {
          const int want = std::to_integer<int>(original[i + c]), got = std::to_integer<int>(decoded[i + c]);
          if (original[i + 3] == std::byte{0}) {
            ASSERT_EQ(got, 0);
          }
          worst = std::max(worst, std::abs(want - got));
        }
      }
      // The gradient changes by 9 to 10 a voxel: the mean of a 2^3 subblock is within 5, S3TC within a
      // quantum of that tile.
      if (base == Base::bitmap || base == Base::alpha) {
        EXPECT_LE(worst, 10) << w;
      }
      if (base == Base::bc1) {
        EXPECT_LE(worst, 40) << w;
      }
    }
}

}  // namespace
}  // namespace voxkit::svmm
