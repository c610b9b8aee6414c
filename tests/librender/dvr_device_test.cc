// The kernels of direct volume rendering for GPUs, on the backend that has threads and vectors in place of
// warps, give the pixels of the host's renderer.
#include <gtest/gtest.h>

#include <cstring>

#include "formats/volume/readers.h"
#include "librender/device/backend_run.h"
#include "librender/device/device_dvr.h"
#include "librender/device/vq_flat_pools.h"
#include "librender/device/warp_kernel.h"
#include "librender/dvr/dvr_job.h"
#include "tests/libvq/volumes.h"

namespace voxkit::render {
namespace {

using vq::test::context;

DvrScene scene_of(auto volume, const TransferFunction& transfer) {
  Context ctx = context();
  auto opened = DvrVolume::open(std::move(volume), ctx);
  EXPECT_TRUE(opened) << opened.error().what;
  auto scene = DvrScene::create(std::make_shared<const DvrVolume>(std::move(*opened)), transfer, ctx);
  EXPECT_TRUE(scene) << scene.error().what;
  return std::move(*scene);
}
Frame draw_on_host(const DvrScene& scene, const Camera& camera, const DvrOptions& options) {
  Context ctx = context();
  Frame frame;
  const Status status = scene.draw(camera, options, frame, ctx);
  EXPECT_TRUE(status) << status.error().what;
  return frame;
}

std::shared_ptr<const Backend> threads() {
  return *Backend::open(BackendKind::threads);
}
std::unique_ptr<const DeviceDvr> uploaded(const DvrScene& scene) {
  Context ctx = context();
  auto device = DeviceDvr::upload(scene, threads(), ctx);
  EXPECT_TRUE(device) << device.error().what;
  return std::move(*device);
}
Frame draw_on_device(const std::unique_ptr<const DeviceDvr>& device, const Camera& camera,
                     const DvrOptions& options, int workers = 2) {
  Context ctx = context(workers);
  Frame frame;
  const Status status = device->draw(camera, options, frame, ctx);
  EXPECT_TRUE(status) << status.error().what;
  return frame;
}

void expect_same(const Frame& a, const Frame& b) {
  ASSERT_EQ(a.pixels.size(), b.pixels.size());
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    ASSERT_EQ(0, std::memcmp(&a.pixels[i], &b.pixels[i], sizeof(Pixel))) << "pixel " << i;
    ASSERT_EQ(0, std::memcmp(&a.details[i], &b.details[i], sizeof(PixelDetail))) << "pixel " << i;
  }
  EXPECT_EQ(a.rays_hit, b.rays_hit);
  EXPECT_EQ(a.samples, b.samples);
}

DvrOptions small() {
  DvrOptions options;
  options.width = 61;
  options.height = 45;
  options.step = 0.5;
  options.details = true;
  return options;
}
TransferFunction ramp(double lo, double hi) {
  return TransferFunction(
      {{lo, {1, 0.2, 0.1, 0}}, {(lo + hi) / 2, {0.9, 0.8, 0.3, 0.2}}, {hi, {0.2, 0.7, 1, 0.7}}});
}
const Camera cameras[] = {Camera::orbit(210, 15, 1.4, 45), Camera{{0.1, 0, 0.05}, {1, 0.3, 0.2}, 60}};

/// All ways to draw a scene.
void expect_the_hosts(const DvrScene& scene) {
  const auto device = uploaded(scene);
  for (const Camera& camera : cameras)
    for (const bool lit : {false, true})
      for (const auto kind : {Gradient::analytic, Gradient::neighbour})
        for (const bool skip : {true, false}) {
          DvrOptions options = small();
          options.lit = lit;
          options.gradient = kind;
          options.skip = skip;
          options.modulate = lit && skip ? 4 : 0;
          const Frame expected = draw_on_host(scene, camera, options);
          EXPECT_GT(expected.rays_hit, 100u);
          expect_same(draw_on_device(device, camera, options), expected);
          if (testing::Test::HasFatalFailure()) return;
        }
}

TEST(DvrDevice, GivesTheHostsPixelsOfDenseVolumes) {
  for (const int bits : {8, 16}) {
    const VolumeInfo info = vq::test::integer_info({23, 18, 29}, bits);
    voxkit::test::MemorySource source(info, vq::test::make_voxels(info, vq::test::Content::scan, bits, 7));
    Context ctx = context();
    const auto grid = DenseGrid::read(source, ctx);
    ASSERT_TRUE(grid);
    const double top = (1 << bits) - 1;
    const DvrScene scene = scene_of(*grid, ramp(0.4 * top, 0.9 * top));
    expect_the_hosts(scene);
  }
  const VolumeInfo info = voxkit::test::scalar_info({23, 18, 29}, SampleType::f32);
  voxkit::test::MemorySource source(info, vq::test::make_voxels(info, vq::test::Content::scan, 8, 7));
  Context ctx = context();
  const auto range = measure_range(source, ctx);
  ASSERT_TRUE(range);
  const auto grid = DenseGrid::read(source, ctx);
  ASSERT_TRUE(grid);
  expect_the_hosts(scene_of(*grid, ramp(range->lo, range->hi)));
}

TEST(DvrDevice, GivesTheHostsPixelsOfBothCodebooksAndMappings) {
  uint32_t seed = 0;
  for (const int bits : {8, 12, 16})
    for (const auto content : {vq::test::Content::scan, vq::test::Content::noise, vq::test::Content::blobs})
      for (const auto codebook : {vq::Codebook::rbuc, vq::Codebook::packed}) {
        const VolumeInfo info = vq::test::integer_info({37, 13, 18}, bits);
        voxkit::test::MemorySource source(info, vq::test::make_voxels(info, content, bits, ++seed));
        vq::Options options;
        options.codebook = codebook;
        if (codebook == vq::Codebook::rbuc)
          options.mapping = seed % 2 ? vq::Mapping::direct : vq::Mapping::indirect;
        const auto encoded = vq::test::encode_to_memory(source, options);
        const auto volume = encoded.open();
        const double top = (1 << bits) - 1;
        const DvrScene scene = scene_of(volume, ramp(0.4 * top, 0.9 * top));
        expect_the_hosts(scene);
        ASSERT_FALSE(HasFatalFailure()) << bits << " bits, seed " << seed;
      }
}

TEST(DvrDevice, GivesTheHostsPixelsOfQuantisedFloatsAndThinVolumes) {
  for (const Index3 dims : {Index3(19, 8, 23), Index3(1, 30, 17), Index3(12, 1, 9)}) {
    const VolumeInfo info = voxkit::test::scalar_info(dims, SampleType::f32);
    voxkit::test::MemorySource source(info, vq::test::make_voxels(info, vq::test::Content::scan, 8, 4));
    Context ctx = context();
    vq::Options options;
    const auto range = measure_range(source, ctx);
    ASSERT_TRUE(range);
    options.range = *range;
    const auto encoded = vq::test::encode_to_memory(source, options);
    const auto volume = encoded.open();
    const DvrScene scene = scene_of(volume, ramp(range->lo, range->hi));
    DvrOptions drawn = small();
    const Frame expected = draw_on_host(scene, cameras[0], drawn);
    EXPECT_GT(expected.rays_hit, 20u);
    expect_same(draw_on_device(uploaded(scene), cameras[0], drawn), expected);
  }
}

TEST(DvrDevice, WarpsKeepWhatTheyDecoded) {
  auto source = open_builtin("marschner-lobb:40");
  const auto encoded = vq::test::encode_to_memory(**source);
  const auto volume = encoded.open();
  const DvrScene scene = scene_of(volume, ramp(90, 210));
  DvrOptions options = small();
  const Frame frame = draw_on_device(uploaded(scene), cameras[0], options);
  // A brick is crossed by several samples of several rays: of the eight of a group, on threads.
  EXPECT_GT(frame.blocks_touched, 1000u);
  EXPECT_LT(frame.blocks_touched * 8, frame.samples);
}

TEST(DvrDevice, DamagedChunksAndCodewordsAreNotReadPast) {
  auto source = open_builtin("marschner-lobb:24");
  for (const auto codebook : {vq::Codebook::rbuc, vq::Codebook::packed}) {
    vq::Options encoding;
    encoding.codebook = codebook;
    const auto encoded = vq::test::encode_to_memory(**source, encoding);
    const auto volume = encoded.open();
    const DvrScene scene = scene_of(volume, ramp(90, 210));
    const auto backend = threads();
    Context ctx = context();
    // As if what was uploaded had changed after it was checked.
    uint32_t random = 1;
    for (int round = 0; round < 20; ++round) {
      const auto flat = upload_chunks(*volume, *backend, ctx);
      ASSERT_TRUE(flat);
      for (const auto& chunk : flat->chunks)
        for (std::byte& byte : std::span(chunk.data(), chunk.size())) {
          random = random * 1664525 + 1013904223;
          if (random >> 24 < 16) byte = static_cast<std::byte>(random >> 16);
        }
      DvrOptions options = small();
      options.skip = false;
      const auto job = dvr_job(scene, cameras[0], options);
      ASSERT_TRUE(job);
      Frame frame;
      ASSERT_TRUE(frame.begin({options.width, options.height, true, true}, ctx));
      const CastParams& cast = job->params.cast;
      const auto at = cast.top * cast.width;
      using View = WarpVq<FlatVqPools>;
      const WarpKernel<DvrGradient::analytic, View> kernel{
          job->params, View{volume->view(), flat->pools, code_values(*volume), {24, 24, 24}},
          WarpPicture{frame.pixels.data() + at, frame.details.data() + at, frame.costs.data() + at}};
      ASSERT_TRUE(backend->run_groups("rendering", kernel, ctx));
      ASSERT_TRUE(blank_around(*job, frame, ctx));
      for (const Pixel& pixel : frame.pixels) ASSERT_TRUE(pixel.color[3] >= 0 && pixel.color[3] <= 1);
    }
  }
}

/// Chunks that are all missing.
struct NoPools {
  static vq::Bytes offsets(uint64_t) { return {}; }
  static vq::Bytes addresses(uint64_t) { return {}; }
  static vq::Bytes codebook(uint64_t) { return {}; }
};
TEST(DvrDevice, AnEmptySlotIsNoBrick) {
  using Lanes = PortableLanes;
  WarpCache cache;
  std::memset(&cache, 0xa5, sizeof cache);
  const int64_t dims[3] = {8, 8, 8};
  const vq::View view;
  const NoPools pools;
  WarpBricks<Lanes, NoPools> bricks(view, pools, {.base = 7, .step = 1, .most = 255, .is_float = false}, dims,
                                    cache);
  DvrPlaces<Lanes> places{};
  Lanes::Real corners[8];
  bricks.fetch(places, Lanes::all(-1), corners);
  for (const auto& corner : corners)
    for (int i = 0; i < Lanes::count; ++i) EXPECT_EQ(corner[i], 7) << "what was in the cache";
}

}  // namespace
}  // namespace voxkit::render
