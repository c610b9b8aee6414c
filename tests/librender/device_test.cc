// The kernels of the GPU, on the backend that has threads in its place, give the pixels of the host's
// renderer; so do all other ways to cast them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>

#include "formats/volume/readers.h"
#include "librender/cast/cast_params.h"
#include "librender/device/backend_run.h"
#include "librender/device/device_grid.h"
#include "librender/device/flat_pools.h"
#include "librender/device/pixel_kernel.h"
#include "tests/libsvmm/volumes.h"

namespace voxkit::render {
namespace {

using svmm::FlatPools;
using svmm::test::context;

std::shared_ptr<const Backend> threads() {
  return *Backend::open(BackendKind::threads);
}
/// A volume as it is uploaded.
template <class Grid>
std::unique_ptr<const DeviceGrid> uploaded(const Grid& grid) {
  static Context ctx = context();
  auto device = DeviceGrid::upload(grid, threads(), ctx);
  EXPECT_TRUE(device);
  return std::move(*device);
}
Frame cast_on_device(const std::unique_ptr<const DeviceGrid>& device, const Camera& camera,
                     CastOptions options, int workers = 2) {
  Context ctx = context(workers);
  Frame frame;
  EXPECT_TRUE(device->cast(camera, options, frame, ctx));
  return frame;
}

template <class Grid>
Frame cast_on_host(const Grid& grid, const Camera& camera, CastOptions options, int threads) {
  Context ctx = context(threads);
  Frame frame;
  EXPECT_TRUE(cast(grid, camera, options, frame, ctx));
  return frame;
}

/// Pixels that differ: in what was hit, where, or in any bit of the colour.
int64_t differing(const Frame& a, const Frame& b) {
  int64_t count = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i)
    count += std::memcmp(&a.pixels[i], &b.pixels[i], sizeof(Pixel)) != 0 ||
             std::memcmp(a.details[i].voxel, b.details[i].voxel, sizeof a.details[i].voxel) != 0;
  return count;
}

std::shared_ptr<const svmm::Volume> compress(VolumeSource& source, double quality) {
  return svmm::test::encode_to_memory(source, svmm::test::make_params(source.info().format, quality, {}, 4))
      .open();
}

std::shared_ptr<const DenseGrid> read_all(VolumeSource& source) {
  static MemoryBudget budget(uint64_t{4} << 30);
  Context ctx = context(2);
  ctx.memory = &budget;
  auto grid = DenseGrid::read(source, ctx);
  EXPECT_TRUE(grid);
  return *grid;
}

TEST(Device, EveryWayGivesThePixelsOfTheDenseVolumeOnTheWholePath) {
  // VOXKIT_THESIS94=menger:5@1920x1080, say, does it in full.
  std::string name = "menger:4";
  int width = 96, height = 54;
  if (const char* full = std::getenv("VOXKIT_THESIS94")) {
    const std::string text = full;
    name = text.substr(0, text.find('@'));
    ASSERT_EQ(std::sscanf(text.c_str() + name.size(), "@%dx%d", &width, &height), 2);
  }
  auto source = open_builtin(name);
  ASSERT_TRUE(source);
  const auto dense = read_all(**source);
  const auto volume = compress(**source, 100);
  const SvmmGrid svmm(volume);
  const auto device_svmm = uploaded(svmm), device_dense = uploaded(*dense);
  const auto path = camera_path("thesis94", Camera::orbit(30, 20, 1.8, 45));
  ASSERT_TRUE(path);
  int64_t hit = 0, pixels = 0;
  for (const Camera& camera : *path) {
    CastOptions options;
    options.width = width;
    options.height = height;
    options.details = true;
    const Frame expected = cast_on_host(*dense, camera, options, 2);
    hit += static_cast<int64_t>(expected.rays_hit);
    pixels += static_cast<int64_t>(expected.rays);
    for (const int threads : {1, 2, 7})
      ASSERT_EQ(differing(expected, cast_on_host(svmm, camera, options, threads)), 0)
          << threads << " threads";
    options.native = false;
    ASSERT_EQ(differing(expected, cast_on_host(*dense, camera, options, 2)), 0) << "portable, dense";
    ASSERT_EQ(differing(expected, cast_on_host(svmm, camera, options, 2)), 0) << "portable";
    options.native = true;
    options.skip = false;
    ASSERT_EQ(differing(expected, cast_on_host(svmm, camera, options, 2)), 0) << "voxel by voxel";
    options.skip = true;
    options.traversal = Traversal::restart;
    const Frame restart = cast_on_host(svmm, camera, options, 2);
    ASSERT_EQ(differing(expected, restart), 0) << "restart";
    const Frame device = cast_on_device(device_svmm, camera, options);
    ASSERT_EQ(differing(expected, device), 0) << "device, restart";
    ASSERT_EQ(restart.cells_visited, device.cells_visited);
    ASSERT_EQ(restart.blocks_touched, device.blocks_touched);
    ASSERT_EQ(restart.bytes_touched, device.bytes_touched);
    options.traversal = Traversal::path;
    for (const int workers : {1, 3})
      ASSERT_EQ(differing(expected, cast_on_device(device_svmm, camera, options, workers)), 0)
          << "device, path";
    ASSERT_EQ(differing(expected, cast_on_device(device_dense, camera, options)), 0) << "device, dense";
  }
  if (std::getenv("VOXKIT_THESIS94"))
    std::printf("%lld pixels, %lld hit\n", static_cast<long long>(pixels), static_cast<long long>(hit));
  EXPECT_GT(hit, pixels / 4);
}

TEST(Device, GivesTheHostsPixelsOfTransparentVolumesAndLevelsOfDetail) {
  for (const char* name : {"sphere:40", "marschner-lobb:32", "membrane:60,50,9:2", "noise:24:3", "menger:3"})
    for (const double quality : {100.0, 80.0}) {
      auto source = open_builtin(name);
      const auto volume = compress(**source, quality);
      const SvmmGrid svmm(volume);
      const auto device = uploaded(svmm);
      for (const Camera& camera : {Camera::orbit(30, 20, 1.8, 45), Camera::orbit(200, -50, 9, 30),
                                   Camera{{0.1, 0, 0}, {1, 0.3, 0.2}, 60}})
        for (const bool level_of_detail : {false, true}) {
          CastOptions options;
          options.width = 61;
          options.height = 45;
          options.range = {20, 200};
          options.details = true;
          options.traversal = Traversal::restart;
          options.level_of_detail = level_of_detail;
          const Frame expected = cast_on_host(svmm, camera, options, 2);
          ASSERT_EQ(differing(expected, cast_on_device(device, camera, options)), 0) << name;
          options.native = false;
          ASSERT_EQ(differing(expected, cast_on_host(svmm, camera, options, 2)), 0) << name;
        }
    }
}

TEST(Device, BaselineIsTheHosts) {
  auto source = open_builtin("menger:3");
  const auto dense = read_all(**source);
  CastOptions options;
  options.width = 97;
  options.height = 71;
  options.details = true;
  options.traversal = Traversal::baseline;
  const Camera camera = Camera::orbit(30, 20, 1.8, 45);
  EXPECT_EQ(
      differing(cast_on_host(*dense, camera, options, 2), cast_on_device(uploaded(*dense), camera, options)),
      0);
}

TEST(Device, MissingBlocksAreVoidThere) {
  auto source = open_builtin("menger:3");
  const auto volume = compress(**source, 100);
  const auto backend = threads();
  Context ctx = context();
  const auto blocks = upload_blocks(*volume, *backend, ctx);
  ASSERT_TRUE(blocks);
  FlatPools pools = blocks->pools;
  CastOptions options;
  options.width = options.height = 64;
  const auto cast_blocks = [&] {
    using View = SvmmView<FlatPools, Search::path>;
    Frame frame;
    EXPECT_TRUE(frame.begin({64, 64, true, true}, ctx));
    const PixelKernel<View> kernel{*cast_params(volume->info(), Camera::orbit(30, 20, 1.8, 45), options),
                                   View{&volume->store().view, &pools}, frame.pixels.data(),
                                   frame.details.data(), frame.costs.data()};
    EXPECT_TRUE(backend->run("casting", kernel.count(), kernel, ctx));
    add_up(frame);
    return frame;
  };
  const Frame all = cast_blocks();
  pools.levels[0].blocks /= 2;  // as if links led to blocks that are not there
  const Frame some = cast_blocks();
  EXPECT_LT(some.rays_hit, all.rays_hit);
  EXPECT_GT(some.rays_hit, 0u);
}

}  // namespace
}  // namespace voxkit::render
