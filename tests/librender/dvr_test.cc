// Direct volume rendering against a plain renderer in doubles, and against itself from every form of a
// volume.
#include "librender/dvr/dvr.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>

#include "formats/volume/readers.h"
#include "librender/light.h"
#include "tests/libsvmm/packed_files.h"
#include "tests/libsvmm/volumes.h"
#include "tests/libvq/volumes.h"

namespace voxkit::render {
namespace {

using vq::test::context;

std::shared_ptr<const DenseGrid> dense(VolumeSource& source) {
  Context ctx = context();
  auto grid = DenseGrid::read(source, ctx);
  EXPECT_TRUE(grid);
  return *grid;
}
template <class T>
DvrScene scene_of(std::shared_ptr<T> volume, const TransferFunction& transfer) {
  Context ctx = context();
  auto opened = DvrVolume::open(std::move(volume), ctx);
  EXPECT_TRUE(opened) << opened.error().what;
  auto scene = DvrScene::create(std::make_shared<const DvrVolume>(std::move(*opened)), transfer, ctx);
  EXPECT_TRUE(scene) << scene.error().what;
  return std::move(*scene);
}
Frame draw(const DvrScene& scene, const Camera& camera, DvrOptions options, int threads = 2) {
  Context ctx = context(threads);
  options.details = true;
  Frame frame;
  const Status status = scene.draw(camera, options, frame, ctx);
  EXPECT_TRUE(status) << status.error().what;
  return frame;
}
DvrOptions small(double step = 0.5) {
  DvrOptions options;
  options.width = 75;
  options.height = 53;
  options.step = step;
  return options;
}
/// Nothing up to `lo`, most at `hi`, both within 0..255 or what the volume has.
TransferFunction ramp(double lo, double hi) {
  return TransferFunction(
      {{lo, {1, 0.2, 0.1, 0}}, {(lo + hi) / 2, {0.9, 0.8, 0.3, 0.2}}, {hi, {0.2, 0.7, 1, 0.7}}});
}

/// Every pixel, and every count of samples that skipping may not change.
void expect_same(const Frame& a, const Frame& b) {
  ASSERT_EQ(a.pixels.size(), b.pixels.size());
  EXPECT_EQ(0, std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Pixel)));
  EXPECT_EQ(a.rays_hit, b.rays_hit);
}

/// The plain renderer: one ray, one sample after the other, in doubles, the transfer function itself.
class Reference {
 public:
  Reference(const DenseGrid& grid, const TransferFunction& transfer, const Camera& camera,
            const DvrOptions& options)
      : grid_(grid),
        transfer_(transfer),
        options_(options),
        transform_(grid.info()),
        rays_(camera, options.width, options.height) {}

  glm::dvec4 pixel(int x, int y) const {
    const double edge = transform_.smallest_edge(), step = options_.step * edge;
    const glm::dvec3 world = rays_.direction(x + 0.5, y + 0.5);
    const double along = glm::dot(world, rays_.forward());
    const glm::dvec3 ahead = world / along;  // depth 1
    const glm::dvec3 from = transform_.point(rays_.eye()), way = transform_.direction(ahead);
    double t0 = 0, t1 = 1e9;
    for (int a = 0; a < 3; ++a) {
      const double side = static_cast<double>(grid_.info().dims[a]);
      const double p = -from[a] / way[a], q = (side - from[a]) / way[a];
      t0 = std::max(t0, std::min(p, q)), t1 = std::min(t1, std::max(p, q));
    }
    glm::dvec3 color(0);
    double through = 1;
    for (double k = std::ceil(t0 / step); k * step <= t1 && through > 0.005; ++k) {
      const glm::dvec3 at = from + way * (k * step) - 0.5;
      const auto rgba = transfer_(value(at));
      if (rgba[3] <= 0) continue;
      glm::dvec3 shown(rgba[0], rgba[1], rgba[2]);
      if (options_.lit) shown = lit(shown, at, glm::normalize(world));
      const double alpha = 1 - std::pow(1 - rgba[3], options_.step / along);
      color += through * alpha * shown;
      through *= 1 - alpha;
    }
    return {color, 1 - through};
  }

  double value(glm::dvec3 at) const {
    int64_t cell[3];
    for (int a = 0; a < 3; ++a) {
      const int64_t side = grid_.info().dims[a];
      at[a] = std::clamp(at[a], 0.0, static_cast<double>(side - 1));
      cell[a] = std::min(static_cast<int64_t>(at[a]), std::max<int64_t>(side - 2, 0));
      at[a] -= static_cast<double>(cell[a]);
    }
    double sum = 0;
    for (int i = 0; i < 8; ++i) {
      double weight = 1;
      int64_t v[3];
      for (int a = 0; a < 3; ++a) {
        weight *= i >> a & 1 ? at[a] : 1 - at[a];
        v[a] = std::min(cell[a] + (i >> a & 1), grid_.info().dims[a] - 1);
      }
      const Voxel voxel = grid_.view().at(v[0], v[1], v[2]);
      sum += weight * (grid_.info().format == VoxelFormat::float32 ? static_cast<double>(voxel.as<float>())
                                                                   : voxel.as<uint32_t>());
    }
    return sum;
  }

 private:
  glm::dvec3 lit(const glm::dvec3& color, const glm::dvec3& at, const glm::dvec3& ahead) const {
    glm::dvec3 gradient;
    for (int a = 0; a < 3; ++a) {  // of the cell, in which values are linear along each axis
      const double side = static_cast<double>(grid_.info().dims[a]);
      glm::dvec3 lo = at, hi = at;
      lo[a] = std::min(std::floor(std::clamp(at[a], 0.0, side - 1)), std::max(side - 2, 0.0)),
      hi[a] = lo[a] + 1;
      gradient[a] = (value(hi) - value(lo)) / transform_.voxel[a];
    }
    if (glm::length(gradient) == 0) return color;
    gradient = glm::transpose(transform_.along) * gradient;
    glm::dvec3 normal = glm::normalize(gradient);
    if (glm::dot(normal, ahead) > 0) normal = -normal;
    const glm::dvec3 light = light_of(rays_), half = glm::normalize(light - ahead);
    return color * (0.3 + 0.6 * std::max(0.0, glm::dot(normal, light))) +
           0.15 * std::pow(std::max(0.0, glm::dot(normal, half)), 32);
  }
  const DenseGrid& grid_;
  const TransferFunction& transfer_;
  DvrOptions options_;
  GridTransform transform_;
  RayGenerator rays_;
};

/// A built-in that is somewhere else.
class Placed final : public VolumeSource {
 public:
  Placed(std::unique_ptr<VolumeSource> source, const Affine& affine) : source_(std::move(source)) {
    info_ = source_->info();
    info_.affine = affine;
  }
  Status read(const Box& box, VoxelSpan out) override { return source_->read(box, out); }

 private:
  std::unique_ptr<VolumeSource> source_;
};

TEST(Dvr, IsThePlainRenderer) {
  const Affine affines[] = {
      Affine::plain({1, 1, 1}, {}),
      Affine::plain({1, 0.5, 1.28}, {}),
      {{{{0, -1, 0}, {0, 0, 0.5}, {1.28, 0, 0}}}, {5, 6, 7}},              // permuted and mirrored
      {{{{1, 0.2, -0.1}, {0.3, 0.9, 0.4}, {-0.2, 0.5, 1.5}}}, {0, 0, 1}},  // sheared
  };
  for (const char* name : {"marschner-lobb:21", "sphere:24", "noise:9:5"})
    for (const Affine& affine : affines)
      for (const bool lit : {false, true}) {
        Placed source(std::move(*open_builtin(name)), affine);
        const auto grid = dense(source);
        const TransferFunction transfer = ramp(90, 210);
        DvrOptions options = small(0.37);
        options.lit = lit;
        const Camera camera = Camera::orbit(33, 21, 1.7, 40);
        const Frame frame = draw(scene_of(grid, transfer), camera, options);
        const Reference reference(*grid, transfer, camera, options);
        EXPECT_GT(frame.rays_hit, 300u);
        double worst = 0, sum = 0;
        for (int y = 0; y < options.height; ++y)
          for (int x = 0; x < options.width; ++x) {
            const glm::dvec4 expected = reference.pixel(x, y);
            const Pixel& pixel = frame.pixels[static_cast<size_t>(y * options.width + x)];
            for (int k = 0; k < 4; ++k) {
              const double off = std::abs(static_cast<double>(pixel.color[k]) - expected[k]);
              worst = std::max(worst, off), sum += off;
            }
          }
        // The table has steps of 1/4095 of the transfer function; a lit sample at a cell's edge may take the
        // gradient of the next one, and rays end a sample apart.
        EXPECT_LT(sum / (4 * options.width * options.height), lit ? 4e-4 : 5e-5) << name << " lit " << lit;
        EXPECT_LT(worst, lit ? 0.1 : 6e-3) << name << " lit " << lit;
      }
}

TEST(Dvr, IsTheSameFromEveryFormSkippedOrNotOnAnyMachine) {
  const VolumeInfo infos[] = {vq::test::integer_info({37, 22, 29}, 8),
                              vq::test::integer_info({18, 41, 13}, 12),
                              vq::test::integer_info({16, 16, 16}, 16)};
  uint32_t seed = 0;
  for (const VolumeInfo& info : infos)
    for (const auto content : {vq::test::Content::scan, vq::test::Content::noise, vq::test::Content::blobs}) {
      const int bits = info.format == VoxelFormat::density8 ? 8 : info.dims.x == 18 ? 12 : 16;
      const auto voxels = vq::test::make_voxels(info, content, bits, ++seed);
      voxkit::test::MemorySource source(info, voxels);
      const double top = (1 << bits) - 1;
      const TransferFunction transfer = ramp(0.4 * top, 0.9 * top);
      const DvrScene plain = scene_of(dense(source), transfer);
      vq::Options packed;
      packed.codebook = vq::Codebook::packed;
      svmm::Params params = svmm::test::make_params(info.format, 100, {}, 4);
      const DvrScene others[] = {
          scene_of(vq::test::encode_to_memory(source).open(), transfer),
          scene_of(vq::test::encode_to_memory(source, packed).open(), transfer),
          scene_of(svmm::test::encode_to_memory(source, params).open(), transfer),
          scene_of(svmm::test::open(svmm::test::encode(source, {}).bytes), transfer),
          scene_of(svmm::test::open(svmm::test::encode(source, {.levels = false, .page_side = 8}).bytes),
                   transfer),
      };
      const Camera camera = Camera::orbit(200 + 10 * seed, 15, 1.4, 45);
      for (const auto kind : {Gradient::analytic, Gradient::neighbour})
        for (const double modulate : {0.0, 5.0}) {
          DvrOptions options = small();
          options.gradient = kind;
          options.modulate = modulate;
          const Frame expected = draw(plain, camera, options);
          EXPECT_GT(expected.rays_hit, 100u);
          for (const DvrScene& scene : others) expect_same(draw(scene, camera, options, 3), expected);
          options.native = false;
          expect_same(draw(plain, camera, options, 1), expected);
          expect_same(draw(others[0], camera, options, 1), expected);
          options.skip = false;
          const Frame all = draw(plain, camera, options);
          expect_same(all, expected);
          EXPECT_GE(all.samples, expected.samples);
          expect_same(draw(others[0], camera, options), expected);
        }
    }
}

TEST(Dvr, FloatsAndThinVolumes) {
  for (const Index3 dims : {Index3(19, 8, 23), Index3(1, 30, 17), Index3(12, 1, 1), Index3(1, 1, 1)}) {
    VolumeInfo info = voxkit::test::scalar_info(dims, SampleType::f32);
    const auto voxels = vq::test::make_voxels(info, vq::test::Content::scan, 8, 4);
    voxkit::test::MemorySource source(info, voxels);
    const TransferFunction transfer = ramp(-3, 30);
    svmm::Params params = svmm::test::make_params(info.format, 100, {}, 4);
    params.full_scale = 60;
    const DvrScene plain = scene_of(dense(source), transfer),
                   compressed = scene_of(svmm::test::encode_to_memory(source, params).open(), transfer),
                   pages = scene_of(svmm::test::open(svmm::test::encode(source, {}).bytes), transfer);
    const Camera camera = Camera::orbit(20, 30, 1.5, 45);
    const Frame expected = draw(plain, camera, small());
    expect_same(draw(compressed, camera, small()), expected);
    expect_same(draw(pages, camera, small()), expected);
  }
}

TEST(Dvr, NoNumberAndInfinityShowNothingAndBreakNothing) {
  const Index3 dims(12, 12, 12);
  const VolumeInfo info = voxkit::test::scalar_info(dims, SampleType::f32);
  auto voxels = vq::test::make_voxels(info, vq::test::Content::noise, 8, 9);
  const float odd[] = {NAN, INFINITY, -INFINITY, 3e38f};
  for (size_t i = 0; i < 200; ++i) std::memcpy(&voxels[i * 28], &odd[i % 4], 4);
  voxkit::test::MemorySource source(info, voxels);
  const DvrScene scene = scene_of(dense(source), ramp(0, 60));
  for (const auto kind : {Gradient::analytic, Gradient::neighbour}) {
    DvrOptions options = small();
    options.gradient = kind;
    const Frame frame = draw(scene, Camera::orbit(20, 30, 1.5, 45), options);
    EXPECT_GT(frame.rays_hit, 100u);
    for (const Pixel& pixel : frame.pixels)
      for (const float c : pixel.color) ASSERT_TRUE(c >= 0 && c <= 1.5f) << c;
    options.skip = false;
    expect_same(draw(scene, Camera::orbit(20, 30, 1.5, 45), options), frame);
  }
}

TEST(Dvr, OpacityDoesNotDependOnTheStepOrTheAngle) {
  // Half of the light goes through an edge, wherever the ray runs: 1 - 2^-length.
  const VolumeInfo info = vq::test::integer_info({8, 8, 8}, 8);
  voxkit::test::MemorySource source(info, std::vector<std::byte>(512, std::byte{9}));
  const DvrScene scene =
      scene_of(dense(source), TransferFunction({{0, {1, 1, 1, 0.5}}, {9, {1, 1, 1, 0.5}}}));
  const Camera camera{{0, 0, 3}, {0, 0, 0}, 30};
  for (const double step : {0.05, 0.25}) {
    DvrOptions options = small(step);
    options.lit = false;
    const Frame frame = draw(scene, camera, options);
    const Pixel& middle = frame.pixels[static_cast<size_t>(26 * 75 + 37)];
    EXPECT_NEAR(middle.color[3], 1 - std::exp2(-8.0), 0.004);
    EXPECT_NEAR(middle.distance, 2.5, step / 8 + 1e-6);
  }
}

TEST(Dvr, SkippingLooksAtLittle) {
  auto source = open_builtin("sphere:96");
  const auto volume = vq::test::encode_to_memory(**source).open();
  const DvrScene scene = scene_of(volume, ramp(250, 255));
  DvrOptions options = small();
  const Frame skipped = draw(scene, Camera::orbit(20, 30, 1.5, 45), options);
  options.skip = false;
  const Frame all = draw(scene, Camera::orbit(20, 30, 1.5, 45), options);
  expect_same(skipped, all);
  EXPECT_LT(skipped.samples * 2, all.samples);
  EXPECT_LT(skipped.cells_visited * 2, all.cells_visited);
  EXPECT_LT(skipped.blocks_touched, all.blocks_touched);
  EXPECT_LT(skipped.bricks_decoded, all.bricks_decoded);
  EXPECT_LE(skipped.bricks_decoded, skipped.blocks_touched);
}

TEST(Dvr, BricksOfWhichNothingIsSeenAreNotDecoded) {
  // Rows of bricks along x: noise that is seen up to x = 5, noise that is not from there on.
  const VolumeInfo info = vq::test::integer_info({16, 4, 4}, 8);
  std::vector<std::byte> voxels(256);
  for (size_t i = 0; i < voxels.size(); ++i)
    voxels[i] = std::byte(i % 16 <= 5 ? 200 + i * 7 % 50 : 1 + i * 5 % 60);
  voxkit::test::MemorySource source(info, voxels);
  const DvrScene scene = scene_of(vq::test::encode_to_memory(source).open(), ramp(100, 250)),
                 plain = scene_of(dense(source), ramp(100, 250));
  for (const double azimuth : {30.0, 90.0, 200.0, 270.0}) {
    const Camera camera = Camera::orbit(azimuth, 20, 1.5, 45);
    const Frame frame = draw(scene, camera, small());
    expect_same(frame, draw(plain, camera, small()));
    EXPECT_EQ(frame.bricks_decoded, 2u) << azimuth;  // the second one has both kinds, and nothing at its end
    DvrOptions options = small();
    options.gradient = Gradient::neighbour;
    expect_same(draw(scene, camera, options), draw(plain, camera, options));
    options.skip = false;
    EXPECT_EQ(draw(scene, camera, options).bricks_decoded, 4u);
  }
}

TEST(Dvr, NarrowFieldsOfViewHaveTheGradientsOfCells) {
  // Rays a few millionths of a voxel apart: the rounding of their places would be all there is to see.
  auto source = open_builtin("sphere:64");
  const DvrScene scene = scene_of(dense(**source), ramp(20, 255));
  Camera camera = Camera::orbit(33, 21, 1.7, 1e-4);
  DvrOptions options = small();
  const Frame expected = draw(scene, camera, options);
  EXPECT_EQ(expected.rays_hit, 75u * 53);
  options.gradient = Gradient::neighbour;
  expect_same(draw(scene, camera, options), expected);
}

TEST(Dvr, ColorsAndTooManySamplesAreRefused) {
  Context ctx = context();
  auto source = open_builtin("menger:1");
  const auto refused = DvrVolume::open(dense(**source), ctx);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::input);
  auto needle = voxkit::test::scalar_info({2, 2, 65536}, SampleType::u8);
  needle.affine = Affine::plain({0.01, 1, 1}, needle.affine.origin);
  voxkit::test::MemorySource thin(needle, std::vector<std::byte>(4 * 65536));
  Frame frame;
  const Status status =
      scene_of(dense(thin), ramp(1, 2)).draw(Camera::orbit(0, 0, 2, 45), small(0.1), frame, ctx);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::usage);
}

std::vector<float> waves(Index3 dims) {
  std::vector<float> values;
  for (int64_t i = 0; i < dims.x * dims.y * dims.z; ++i)
    values.push_back(static_cast<float>(std::lround(500 * std::sin(0.9 * static_cast<double>(i % dims.x)) +
                                                    300 * std::cos(0.05 * static_cast<double>(i)))));
  return values;
}

TEST(Dvr, TheUnitOfValuesDoesNotMatter) {
  const Index3 dims(12, 11, 10);
  const VolumeInfo info = voxkit::test::scalar_info(dims, SampleType::f32);
  const std::vector<float> values = waves(dims);
  for (const Gradient gradient : {Gradient::analytic, Gradient::neighbour})
    for (const double modulate : {0.0, 3.0}) {
      DvrOptions options = small();
      options.gradient = gradient;
      options.modulate = modulate;
      std::optional<Frame> plain;
      for (const int power : {0, -110, -60, 60, 110}) {
        std::vector<float> scaled = values;
        for (float& v : scaled) v = std::ldexp(v, power);
        const auto source = voxkit::test::volume(info, scaled);
        const auto grid = dense(*source);
        Context ctx = context();
        const auto ranges = BrickRanges::of(*grid, ctx);
        ASSERT_TRUE(ranges);
        Frame frame = draw(scene_of(grid, *transfer_preset("gray", ranges->all())),
                           Camera::orbit(30, 20, 1.5, 40), options);
        EXPECT_GT(frame.rays_hit, 1000u) << power;
        if (plain)
          expect_same(frame, *plain);
        else
          plain = std::move(frame);
      }
    }
}

/// Noise that a transfer function does not show, around what it shows: pages of noise alone are not decoded.
TEST(Dvr, OfPackedVolumesOnlyPagesThatMayShowSomethingAreDecoded) {
  const VolumeInfo info = vq::test::integer_info({64, 64, 64}, 8);
  std::vector<std::byte> voxels(static_cast<size_t>(info.dims.x * info.dims.y * info.dims.z));
  std::mt19937 random(4);
  for (size_t i = 0; i < voxels.size(); ++i) {
    const size_t x = i % 64, y = i / 64 % 64, z = i / 4096;
    const bool shown = x > 18 && x < 30 && y > 18 && y < 30 && z > 18 && z < 30;
    voxels[i] = static_cast<std::byte>(shown ? 200 + random() % 20 : random() % 60);
  }
  voxkit::test::MemorySource source(info, voxels);
  const TransferFunction transfer = ramp(100, 180);
  const auto file = svmm::test::open(svmm::test::encode(source, {.levels = false}).bytes);
  const DvrScene packed = scene_of(file, transfer), plain = scene_of(dense(source), transfer);
  EXPECT_EQ(packed.visible_bricks(), plain.visible_bricks());
  EXPECT_EQ(packed.volume().ranges().all(), plain.volume().ranges().all());
  // One of 64, and those that samples between it and the next ones reach; two threads may decode one at once.
  EXPECT_GT(packed.pages_decoded(), 0u);
  EXPECT_LE(packed.pages_decoded(), 36u);
  EXPECT_EQ(file->pages_decoded(), packed.pages_decoded());
  const Camera camera = Camera::orbit(20, 15, 1.4, 45);
  expect_same(draw(packed, camera, small()), draw(plain, camera, small()));
  EXPECT_LE(file->pages_decoded(), 45u);
  DvrOptions all = small();
  all.skip = false;
  expect_same(draw(packed, camera, all), draw(plain, camera, small()));
  EXPECT_GE(file->pages_decoded(), 64u);
}

TEST(Dvr, WhatIsNoNumberIsVoidAndChangesNothingElse) {
  const Index3 dims(12, 11, 10);
  const VolumeInfo info = voxkit::test::scalar_info(dims, SampleType::f32);
  std::vector<float> values = waves(dims);
  constexpr float inf = std::numeric_limits<float>::infinity();
  const auto plain_source = voxkit::test::volume(info, values);
  Context ctx = context();
  const ValueRange range = BrickRanges::of(*dense(*plain_source), ctx)->all();
  std::vector<Frame> frames;
  for (const float odd : {inf, -inf, std::numeric_limits<float>::quiet_NaN()}) {
    for (size_t i = 7; i < values.size(); i += 150) values[i] = odd;
    const auto source = voxkit::test::volume(info, values);
    const auto grid = dense(*source);
    EXPECT_EQ(BrickRanges::of(*grid, ctx)->all(), range);
    for (const bool skip : {true, false}) {
      DvrOptions options = small();
      options.skip = skip;
      frames.push_back(
          draw(scene_of(grid, *transfer_preset("gray", range)), Camera::orbit(30, 20, 1.5, 40), options));
      expect_same(frames.back(), frames.front());
    }
  }
  for (const Pixel& pixel : frames.front().pixels)
    for (const float c : pixel.color) EXPECT_TRUE(c >= 0 && c <= 1);
}

}  // namespace
}  // namespace voxkit::render
