// The kernel of direct volume rendering for GPUs, warp by warp and lane by lane on the host, gives the pixels
// of the host's renderer.
#include <gtest/gtest.h>

#include <cstring>

#include "formats/volume/readers.h"
#include "librender/device/vq_flat_pools.h"
#include "librender/device/warp_kernel.h"
#include "librender/dvr/dvr_job.h"
#include "librender/dvr/dvr_lanes.h"
#include "tests/libvq/volumes.h"

namespace voxkit::render {
namespace {

using vq::test::context;
using WarpLanes = VectorLanes<8, 4>;

DvrScene scene_of(auto volume, const TransferFunction& transfer) {
  Context ctx = context();
  auto opened = DvrVolume::open(std::move(volume), ctx);
  EXPECT_TRUE(opened) << opened.error().what;
  auto scene = DvrScene::create(std::make_shared<const DvrVolume>(std::move(*opened)), transfer, ctx);
  EXPECT_TRUE(scene) << scene.error().what;
  return std::move(*scene);
}
DvrFrame draw_on_host(const DvrScene& scene, const Camera& camera, const DvrOptions& options) {
  Context ctx = context();
  DvrFrame frame;
  const Status status = scene.draw(camera, options, frame, ctx);
  EXPECT_TRUE(status) << status.error().what;
  return frame;
}

/// A launch of one warp after the other.
template <DvrGradient kind, class View>
DvrFrame launch_kind(const DvrJob& job, const View& view) {
  Context ctx = context();
  DvrFrame frame;
  EXPECT_TRUE(begin_frame(job, frame, ctx));
  const CastParams& cast = job.params.cast;
  const auto width = static_cast<size_t>(cast.right - cast.left),
             height = static_cast<size_t>(cast.bottom - cast.top);
  const int64_t warps = warps_of(cast, WarpLanes::width, WarpLanes::height);
  std::vector<Pixel> pixels(width * height);
  std::vector<PixelDetail> details(width * height);
  std::vector<uint32_t> decoded(static_cast<size_t>(warps));
  for (int64_t warp = 0; warp < warps; ++warp) {
    WarpCache cache;
    std::memset(&cache, 0xa5, sizeof cache);  // shared memory begins with anything
    auto sampler = view.template sampler<WarpLanes>(cache);
    draw_warp<WarpLanes, kind>(job.params, sampler, warp, {pixels.data(), details.data(), decoded.data()});
  }
  for (size_t i = 0; i < pixels.size(); ++i) {
    const size_t at = (static_cast<size_t>(cast.top) + i / width) * static_cast<size_t>(cast.width) +
                      static_cast<size_t>(cast.left) + i % width;
    frame.pixels[at] = pixels[i];
    frame.details[at] = details[i];
    frame.samples += details[i].cells;
    frame.rays_hit += details[i].voxel[0] >= 0;
  }
  for (const uint32_t count : decoded) frame.blocks_touched += count;
  return frame;
}
template <class View>
DvrFrame launch(const DvrScene& scene, const View& view, const Camera& camera, const DvrOptions& options) {
  const auto job = dvr_job(scene, camera, options);
  EXPECT_TRUE(job);
  switch (job->gradient) {
    case DvrGradient::none:
      return launch_kind<DvrGradient::none>(*job, view);
    case DvrGradient::analytic:
      return launch_kind<DvrGradient::analytic>(*job, view);
    default:
      return launch_kind<DvrGradient::neighbour>(*job, view);
  }
}

void expect_same(const DvrFrame& a, const DvrFrame& b) {
  ASSERT_EQ(a.pixels.size(), b.pixels.size());
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    ASSERT_EQ(0, std::memcmp(&a.pixels[i], &b.pixels[i], sizeof(Pixel))) << "pixel " << i;
    ASSERT_EQ(0, std::memcmp(&a.details[i], &b.details[i], sizeof(PixelDetail))) << "pixel " << i;
  }
  EXPECT_EQ(a.rays_hit, b.rays_hit);
  EXPECT_EQ(a.samples, b.samples);
}

/// A VQ file as it is uploaded.
class Uploaded {
 public:
  explicit Uploaded(const vq::Volume& volume) {
    const auto allocate = [&](uint64_t bytes) -> Result<std::byte*> {
      memory_.push_back(std::make_unique<std::byte[]>(bytes));
      return memory_.back().get();
    };
    const auto copy = [](std::byte* to, std::span<const std::byte> from) -> Status {
      std::memcpy(to, from.data(), from.size());
      return {};
    };
    const auto pools = flatten(volume, allocate, copy);
    EXPECT_TRUE(pools);
    const Index3& dims = volume.info().dims;
    view = {volume.view(), *pools, code_values(volume), {dims.x, dims.y, dims.z}};
  }
  WarpVq<FlatVqPools> view{};

 private:
  std::vector<std::unique_ptr<std::byte[]>> memory_;
};

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
template <class View>
void expect_the_hosts(const DvrScene& scene, const View& view) {
  for (const Camera& camera : cameras)
    for (const bool lit : {false, true})
      for (const auto kind : {Gradient::analytic, Gradient::neighbour})
        for (const bool skip : {true, false}) {
          DvrOptions options = small();
          options.lit = lit;
          options.gradient = kind;
          options.skip = skip;
          options.modulate = lit && skip ? 4 : 0;
          const DvrFrame expected = draw_on_host(scene, camera, options);
          EXPECT_GT(expected.rays_hit, 100u);
          expect_same(launch(scene, view, camera, options), expected);
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
    const std::byte* const voxels = (*grid)->view().voxels;
    if (bits == 8)
      expect_the_hosts(scene, WarpDense<uint8_t>{voxels, {23, 18, 29}});
    else
      expect_the_hosts(scene, WarpDense<uint16_t>{voxels, {23, 18, 29}});
  }
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
        const Uploaded uploaded(*volume);
        expect_the_hosts(scene, uploaded.view);
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
    const Uploaded uploaded(*volume);
    DvrOptions drawn = small();
    const DvrFrame expected = draw_on_host(scene, cameras[0], drawn);
    EXPECT_GT(expected.rays_hit, 20u);
    expect_same(launch(scene, uploaded.view, cameras[0], drawn), expected);
  }
}

TEST(DvrDevice, WarpsKeepWhatTheyDecoded) {
  auto source = open_builtin("marschner-lobb:40");
  const auto encoded = vq::test::encode_to_memory(**source);
  const auto volume = encoded.open();
  const DvrScene scene = scene_of(volume, ramp(90, 210));
  const Uploaded uploaded(*volume);
  DvrOptions options = small();
  const DvrFrame frame = launch(scene, uploaded.view, cameras[0], options);
  // A brick is crossed by several samples of several rays.
  EXPECT_GT(frame.blocks_touched, 1000u);
  EXPECT_LT(frame.blocks_touched * 20, frame.samples);
}

TEST(DvrDevice, DamagedChunksAndCodewordsAreNotReadPast) {
  auto source = open_builtin("marschner-lobb:24");
  for (const auto codebook : {vq::Codebook::rbuc, vq::Codebook::packed}) {
    vq::Options encoding;
    encoding.codebook = codebook;
    const auto encoded = vq::test::encode_to_memory(**source, encoding);
    const auto volume = encoded.open();
    const DvrScene scene = scene_of(volume, ramp(90, 210));
    // As if what was uploaded had changed after it was checked.
    uint32_t random = 1;
    for (int round = 0; round < 20; ++round) {
      std::vector<std::vector<std::byte>> memory;
      const auto allocate = [&](uint64_t bytes) -> Result<std::byte*> {
        return memory.emplace_back(bytes).data();
      };
      const auto copy = [&](std::byte* to, std::span<const std::byte> from) -> Status {
        std::memcpy(to, from.data(), from.size());
        return {};
      };
      const auto pools = flatten(*volume, allocate, copy);
      ASSERT_TRUE(pools);
      for (size_t i = 0; i < memory.size();
           i += 2)  // chunks; between them are the tables of where they begin
        for (std::byte& byte : memory[i]) {
          random = random * 1664525 + 1013904223;
          if (random >> 24 < 16) byte = static_cast<std::byte>(random >> 16);
        }
      const WarpVq<FlatVqPools> view{volume->view(), *pools, code_values(*volume), {24, 24, 24}};
      DvrOptions options = small();
      options.skip = false;
      const DvrFrame frame = launch(scene, view, cameras[0], options);
      for (const Pixel& pixel : frame.pixels) ASSERT_TRUE(pixel.colour[3] >= 0 && pixel.colour[3] <= 1);
    }
  }
}

}  // namespace
}  // namespace voxkit::render
