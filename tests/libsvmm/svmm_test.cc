#include "libsvmm/svmm.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/volume/readers.h"
#include "tests/libsvmm/reference.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::svmm {
namespace {

using namespace voxkit::svmm::test;

const Index3 sizes[] = {{1, 1, 1},   {2, 2, 2},  {17, 13, 11}, {37, 1, 1},
                        {40, 33, 3}, {1, 1, 70}, {23, 29, 31}};

/// Every level's voxels, block counts and terminal voxels are those of the plain algorithm.
TEST(Svmm, EqualsReference) {
  uint32_t seed = 0;
  int volumes = 0;
  for (VoxelFormat f : all_formats)
    for (Index3 dims : sizes)
      for (Content content :
           {Content::noise, Content::smooth, Content::blobs, Content::constant, Content::specials})
        for (int variant = 0; variant < 6; ++variant) {
          const Layout layout = variant == 5 ? Layout::thesis : Layout::plain;
          if (layout == Layout::thesis && !is_color(f) && f != VoxelFormat::density8) continue;
          const VolumeInfo info = make_info(dims, f);
          const auto voxels = make_voxels(info, content, ++seed);
          const std::vector<int> widths = variant % 3 == 0   ? std::vector<int>{}
                                          : variant % 3 == 1 ? std::vector<int>{2}
                                                             : std::vector<int>{4, 2};
          const double qualities[] = {100, 95, 90, 60, 20, 80};
          const Params params = make_params(f, qualities[(seed + static_cast<uint32_t>(variant)) % 6], widths,
                                            2 + variant, layout, variant % 2 ? Bound::local : Bound::global,
                                            variant != 3 && layout != Layout::thesis);
          voxkit::test::MemorySource source(info, bytes_of(voxels, f));
          const Encoded encoded = encode_to_memory(source, params);
          auto expected = reference::encode(voxels, info, params);
          const auto volume = encoded.open();
          SCOPED_TRACE(testing::Message()
                       << name(f) << " " << dims.x << "x" << dims.y << "x" << dims.z << " content "
                       << static_cast<int>(content) << " variant " << variant << " q " << params.quality);
          ASSERT_EQ(encoded.levels.size(), expected.size());
          for (size_t k = 0; k < expected.size(); ++k) {
            EXPECT_EQ(encoded.levels[k].blocks, expected[k].blocks) << "level " << k;
            EXPECT_EQ(encoded.levels[k].terminal_voxels, expected[k].terminal_voxels) << "level " << k;
            const auto decoded = decode_all(*volume, static_cast<int>(k));
            const Index3 size = volume->dims_at(static_cast<int>(k));
            size_t at = 0;
            for (int64_t z = 0; z < size.z; ++z)
              for (int64_t y = 0; y < size.y; ++y)
                for (int64_t x = 0; x < size.x; ++x, at += static_cast<size_t>(voxel_bytes(f))) {
                  const Voxel want = reference::decode(expected, info, params, {x, y, z}, k);
                  ASSERT_EQ(0,
                            std::memcmp(&decoded[at], want.bytes.data(), static_cast<size_t>(voxel_bytes(f))))
                      << "level " << k << " voxel " << x << "," << y << "," << z;
                }
          }
          Context ctx = context();
          const auto checked = volume->check(ctx);
          EXPECT_TRUE(checked) << checked.error().what;
          if (testing::Test::HasFailure()) return;
          ++volumes;
        }
  EXPECT_GT(volumes, 1000);
}

TEST(Svmm, QualityHundredIsBitExactForEveryFormatAndWidth) {
  uint32_t seed = 1000;
  for (VoxelFormat f : all_formats)
    for (Index3 dims : {Index3(1, 1, 1), Index3(67, 41, 19), Index3(257, 1, 1), Index3(96, 32, 7)})
      for (int w : {0, 2, 4, 8, 16, 32, 64})
        for (Content content : {Content::noise, Content::blobs, Content::specials}) {
          const VolumeInfo info = make_info(dims, f);
          const auto bytes = bytes_of(make_voxels(info, content, ++seed), f);
          voxkit::test::MemorySource source(info, bytes);
          const Params params = make_params(f, 100, w ? std::vector<int>{w} : std::vector<int>{}, 4);
          ASSERT_EQ(decode_all(*encode_to_memory(source, params).open()), bytes)
              << name(f) << " " << dims.x << " w " << w << " content " << static_cast<int>(content);
        }
}

TEST(Svmm, GlobalBoundHolds) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 400; ++trial) {
    const VoxelFormat f = all_formats[random() % 6];
    const VolumeInfo info = make_info({1 + random() % 60, 1 + random() % 40, 1 + random() % 40}, f);
    const auto voxels =
        make_voxels(info, static_cast<Content>(random() % 5), static_cast<uint32_t>(random()));
    std::vector<int> widths;
    for (uint32_t n = static_cast<uint32_t>(random()) % 4; n > 0; --n) widths.push_back(2 << random() % 4);
    const Params params =
        make_params(f, static_cast<double>(random() % 1001) / 10, widths, 1 + random() % 12);
    voxkit::test::MemorySource source(info, bytes_of(voxels, f));
    const auto decoded = decode_all(*encode_to_memory(source, params).open());
    for (size_t i = 0; i < voxels.size(); ++i) {
      Voxel v;
      std::memcpy(v.bytes.data(), &decoded[i * static_cast<size_t>(voxel_bytes(f))],
                  static_cast<size_t>(voxel_bytes(f)));
      ASSERT_LE(reference::distance_between(v, voxels[i], f, params), params.delta * params.full_scale)
          << name(f) << " voxel " << i << " q " << params.quality;
    }
  }
}

TEST(Svmm, BytesDependOnNeitherThreadsNorTheKindOfSource) {
  for (VoxelFormat f : all_formats) {
    const VolumeInfo info = make_info({130, 70, 90}, f);
    const auto bytes = bytes_of(make_voxels(info, Content::blobs, 5), f);
    for (std::vector<int> widths : {std::vector<int>{}, std::vector<int>{4}, std::vector<int>{32}}) {
      const Params params = make_params(f, 90, widths, 8);
      voxkit::test::MemorySource random_access(info, bytes);
      const auto one = encode_to_memory(random_access, params, 1).bytes;
      EXPECT_EQ(one, encode_to_memory(random_access, params, 2).bytes);
      EXPECT_EQ(one, encode_to_memory(random_access, params, 7).bytes);
      voxkit::test::ForwardSource forward(info, bytes), forward_again(info, bytes);
      EXPECT_EQ(one, encode_to_memory(forward, params, 1).bytes);
      EXPECT_EQ(one, encode_to_memory(forward_again, params, 3).bytes);
    }
  }
}

TEST(Svmm, UniformRegionsAreNotRead) {
  const VolumeInfo info = make_info({2000, 1000, 3000}, VoxelFormat::density16);
  voxkit::test::FlatSource source(info, Voxel::of<uint16_t>(777));  // fails when it is read
  const Encoded encoded = encode_to_memory(source, make_params(info.format, 100, {8}, 32));
  EXPECT_EQ(encoded.levels[0].blocks, 0u);
  EXPECT_LT(encoded.bytes.size(), 200'000u);
  EXPECT_EQ(encoded.open()->sample({1999, 999, 2999})->as<uint16_t>(), 777);
}

/// The sizes that the thesis' encoder gives for the Menger sponge (chapter 4; header of 64 bytes and 24 a
/// level).
TEST(Svmm, ThesisLayoutHasThePublishedSizes) {
  struct Row {
    const char* volume;
    std::vector<int> widths;
    Base base;
    int64_t rootwidth;
    double quality;
    uint64_t bytes;
  };
  const Row rows[] = {
      {"menger:5", {}, Base::raw, 32, 80, 27'000'072},
      {"menger:5", {4}, Base::bitmap, 32, 80, 4'758'408},
      {"menger:5", {8}, Base::bitmap, 32, 80, 5'354'608},
      {"menger:5", {2}, Base::raw, 2, 99, 26'348'832},
      {"menger:5", {2}, Base::raw, 2, 100, 27'861'120},
      {"menger:6", {}, Base::raw, 32, 80, 536'733'568},
      {"menger:6", {4}, Base::bitmap, 32, 80, 93'854'528},
      {"menger:6", {8}, Base::bitmap, 32, 80, 104'793'480},
      {"menger:6", {2}, Base::raw, 2, 99, 524'716'560},
  };
  for (const Row& row : rows) {
    auto source = open_builtin(row.volume);
    ASSERT_TRUE(source);
    Params params = make_params(VoxelFormat::rgba32, row.quality, row.widths, row.rootwidth, Layout::thesis,
                                Bound::local, false);
    params.base = row.base;
    Context ctx = context();
    auto levels = encode(
        **source, params, [](auto) { return Status{}; }, ctx);
    ASSERT_TRUE(levels);
    EXPECT_EQ(thesis_bytes(*levels), row.bytes) << row.volume << " q " << row.quality;
  }
}

TEST(Svmm, AVolumeWhoseSumsWouldOverflowIsRefused) {
  VolumeInfo info;
  info.format = VoxelFormat::rgba32;
  info.dims = {1 << 17, 1 << 16, 1 << 16};
  voxkit::test::FlatSource source(info, Voxel::of(~uint32_t{0}));
  Context ctx = test::context();
  const auto levels = encode(
      source, {}, [](std::span<const std::byte>) { return Status{}; }, ctx);
  ASSERT_FALSE(levels);
  EXPECT_EQ(levels.error().code, ErrorCode::limit);
  EXPECT_NE(levels.error().what.find("2^48"), std::string::npos) << levels.error().what;
}

TEST(Svmm, ParametersThatDoNotGoTogetherAreRefused) {
  const auto refused = [](Params params, VoxelFormat f, const char* word) {
    const auto status = validate(params, make_info({64, 64, 64}, f));
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::usage);
    EXPECT_NE(status.error().what.find(word), std::string::npos) << status.error().what;
  };
  const auto with = [](auto change) {
    Params params;
    change(params);
    return params;
  };
  refused(with([](Params& p) { p.blockwidths = {3}; }), VoxelFormat::rgba32, "blockwidth");
  refused(with([](Params& p) { p.blockwidths = {2, 2048}; }), VoxelFormat::rgba32, "blockwidth");
  refused(with([](Params& p) { p.rootwidth = 0; }), VoxelFormat::rgba32, "rootwidth");
  refused(with([](Params& p) { p.delta = -1; }), VoxelFormat::rgba32, "delta");
  refused(with([](Params& p) { p.delta = NAN; }), VoxelFormat::rgba32, "delta");
  refused(with([](Params& p) { p.layout = Layout::thesis; }), VoxelFormat::float32, "thesis");
  refused(with([](Params& p) { p.base = Base::alpha; }), VoxelFormat::rgb24, "alpha");
  refused(with([](Params& p) { p.base = Base::gray; }), VoxelFormat::density8, "gray");
  refused(with([](Params& p) { p.base = Base::bc1; }), VoxelFormat::rgba32, "bc1");
}

TEST(Svmm, MemoryLimitIsKept) {
  MemoryBudget small(1 << 20);
  Context ctx = context();
  ctx.memory = &small;
  const VolumeInfo info = make_info({300, 300, 300}, VoxelFormat::rgba32);
  voxkit::test::FlatSource source(info, {});
  const auto levels = encode(
      source, make_params(info.format, 90, {64}, 32), [](auto) { return Status{}; }, ctx);
  ASSERT_FALSE(levels);
  EXPECT_EQ(levels.error().code, ErrorCode::limit);
  EXPECT_NE(levels.error().what.find("--max-memory"), std::string::npos);
}

}  // namespace
}  // namespace voxkit::svmm
