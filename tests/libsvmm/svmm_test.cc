#include "libsvmm/svmm.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "formats/volume/readers.h"
#include "libsvmm/commonest.h"
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

/// Of integers: whole blocks of the fill value, parts of blocks, and void outside of the volume.
TEST(Svmm, FillValuesComeBackAndHaveNoPartInAverages) {
  std::mt19937 random(9);
  for (const VoxelFormat f : {VoxelFormat::density8, VoxelFormat::density16})
    for (const double quality : {100.0, 90.0})
      for (const bool all : {false, true}) {
        SCOPED_TRACE(testing::Message() << name(f) << " quality " << quality << " all " << all);
        VolumeInfo info = make_info({37, 33, 35}, f);
        const uint32_t fill = 200;
        info.fill = fill;
        std::vector<Voxel> voxels;
        for (int64_t i = 0; i < info.box().voxels(); ++i) {
          const auto value = static_cast<uint32_t>(all || i % 37 < 23 ? fill : 100 + random() % 4);
          voxels.push_back(f == VoxelFormat::density16 ? Voxel::of(static_cast<uint16_t>(value))
                                                       : Voxel::of(static_cast<uint8_t>(value)));
        }
        const Params params = make_params(f, quality, {2}, 2);
        voxkit::test::MemorySource source(info, bytes_of(voxels, f));
        const auto volume = encode_to_memory(source, params).open();
        const auto value_at = [&](const std::vector<std::byte>& bytes, size_t i) {
          return f == VoxelFormat::density16 ? load_le<uint16_t>(&bytes[2 * i]) : load_le<uint8_t>(&bytes[i]);
        };
        const auto decoded = decode_all(*volume);
        for (size_t i = 0; i < voxels.size(); ++i) {
          const auto want = static_cast<int64_t>(voxels[i].as<uint32_t>());
          const int64_t bound = want == fill ? 0 : static_cast<int64_t>(params.delta * params.full_scale);
          ASSERT_LE(std::abs(value_at(decoded, i) - want), bound) << i;
        }
        for (int level = 1; level < static_cast<int>(volume->levels().size()); ++level) {
          const auto coarser = decode_all(*volume, level);
          for (size_t i = 0; i < coarser.size() / static_cast<size_t>(voxel_bytes(f)); ++i) {
            const auto value = value_at(coarser, i);
            ASSERT_TRUE(value == fill || (!all && value >= 100 && value <= 103))
                << level << " " << i << " " << value;
          }
        }
        Context ctx = context();
        EXPECT_TRUE(volume->check(ctx));
      }
}

/// The commonest of labels that are weighed, of several such the least.
uint32_t commonest_of(const std::map<uint32_t, uint64_t>& weights) {
  auto best = weights.begin();
  for (auto at = weights.begin(); at != weights.end(); ++at)
    if (at->second > best->second) best = at;
  return best->first;
}

TEST(Svmm, LabelsAreKeptAndTheirLevelsHaveTheCommonest) {
  std::mt19937 random(3);
  for (const VoxelFormat f : {VoxelFormat::density8, VoxelFormat::density16, VoxelFormat::float32})
    for (const std::vector<int>& widths : {std::vector<int>{2}, {4, 2}, {16}}) {
      SCOPED_TRACE(testing::Message() << name(f) << " width " << widths[0]);
      VolumeInfo info = make_info({37, 22, 19}, f);
      info.is_labels = true;
      if (f != VoxelFormat::float32) info.fill = 3;  // one label of many
      std::vector<Voxel> voxels;
      for (int64_t i = 0; i < info.box().voxels(); ++i) {
        const auto label = static_cast<uint32_t>(i / 37 % 22 < 9 ? 3 : random() % 5 * 50);
        voxels.push_back(f == VoxelFormat::float32     ? Voxel::of(static_cast<float>(label))
                         : f == VoxelFormat::density16 ? Voxel::of(static_cast<uint16_t>(label * 200))
                                                       : Voxel::of(static_cast<uint8_t>(label)));
      }
      Params params = make_params(f, 100, widths, 2);
      voxkit::test::MemorySource source(info, bytes_of(voxels, f));
      const Encoded encoded = encode_to_memory(source, params);
      const auto volume = encoded.open();
      EXPECT_TRUE(volume->info().is_labels);
      ASSERT_EQ(decode_all(*volume), bytes_of(voxels, f));
      Context ctx = context();
      EXPECT_TRUE(volume->check(ctx));
      EXPECT_EQ(encode_to_memory(source, params, 1).bytes, encoded.bytes);
      // Level by level: of the labels below, each as heavy as the voxels that it stands for.
      struct Cell {
        uint32_t label;
        uint64_t weight;
      };
      std::vector<Cell> below;
      for (const Voxel& v : voxels) below.push_back({v.as<uint32_t>(), 1});
      Index3 dims = info.dims;
      for (size_t k = 0; k + 1 < encoded.levels.size(); ++k) {
        const auto w = static_cast<int64_t>(encoded.levels[k].blockwidth);
        const Index3 up = (dims + (w - 1)) / w;
        std::vector<Cell> cells;
        for (int64_t z = 0; z < up.z; ++z)
          for (int64_t y = 0; y < up.y; ++y)
            for (int64_t x = 0; x < up.x; ++x) {
              std::map<uint32_t, uint64_t> weights;
              uint64_t all = 0;
              for (int64_t c = z * w; c < std::min(dims.z, (z + 1) * w); ++c)
                for (int64_t b = y * w; b < std::min(dims.y, (y + 1) * w); ++b)
                  for (int64_t a = x * w; a < std::min(dims.x, (x + 1) * w); ++a) {
                    const Cell& cell = below[static_cast<size_t>((c * dims.y + b) * dims.x + a)];
                    weights[cell.label] += cell.weight;
                    all += cell.weight;
                  }
              cells.push_back({commonest_of(weights), all});
            }
        dims = up;
        below = std::move(cells);
        const int level = static_cast<int>(k) + 1;
        ASSERT_EQ(volume->dims_at(level), dims);
        const auto decoded = decode_all(*volume, level);
        for (size_t i = 0; i < below.size(); ++i)
          ASSERT_EQ(0, std::memcmp(&decoded[i * static_cast<size_t>(voxel_bytes(f))], &below[i].label,
                                   static_cast<size_t>(voxel_bytes(f))))
              << "level " << level << " voxel " << i;
      }
      EXPECT_GT(encoded.levels.size(), 2u);
    }
  // In runs, and so many different ones that counts are joined on the way.
  Commonest counts;
  counts.clear();
  for (uint32_t i = 0; i < 100000; ++i) counts.add(i * 7919 % 50000, i % 50000 == 777 ? 1 : 2);
  counts.add(40000, 1);
  EXPECT_EQ(counts.key(), 40000u);
}

TEST(Svmm, LabelsAndTablesHaveNoValuesBetween) {
  VolumeInfo info = make_info({64, 64, 64}, VoxelFormat::density8);
  const auto refused = [&](const Params& params, const char* word) {
    const auto status = validate(params, info);
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::usage);
    EXPECT_NE(status.error().what.find(word), std::string::npos) << status.error().what;
  };
  Params params = make_params(info.format, 100, {}, 32);
  info.is_labels = true;
  EXPECT_TRUE(validate(params, info));
  params.delta = 0.01;
  refused(params, "labels have no values between them: expected --quality 100");
  info.is_labels = false;
  EXPECT_TRUE(validate(params, info));
  info.labels = std::make_shared<const std::vector<int64_t>>(std::vector<int64_t>{-70000, 0, 1});
  refused(params, "values that are 65536 and more apart");
  info.is_labels = true;
  params.delta = 0;
  params.base = Base::bitmap;
  refused(params, "--base raw");
  params.base = Base::raw;
  params.layout = Layout::thesis;
  refused(params, "--layout plain");
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
