// Compresses a built-in volume with both volume codecs, decodes it again, and draws it from the compressed
// form.
#include <cstdio>
#include <vector>

#include "formats/container.h"
#include "formats/volume/builtin.h"
#include "libmetrics/volume_diff.h"
#include "librender/cast/ray_cast.h"
#include "libsvmm/svmm.h"
#include "libvq/vq.h"

namespace consumer {
voxkit::Result<unsigned long long> surface_voxels(voxkit::Context& ctx);
}

namespace {

using voxkit::Container;
using voxkit::Context;
using voxkit::Result;
using Bytes = std::vector<std::byte>;

voxkit::ByteSink append_to(Bytes& bytes) {
  return [&bytes](std::span<const std::byte> more) -> voxkit::Status {
    bytes.insert(bytes.end(), more.begin(), more.end());
    return {};
  };
}

voxkit::Status print_distance(const char* codec, voxkit::VolumeSource& original,
                              voxkit::VolumeSource& decoded, const Bytes& bytes, Context& ctx) {
  VOX_TRY(const auto diff, voxkit::diff_volumes(original, decoded, std::nullopt, nullptr, ctx));
  std::printf("%s: %zu bytes, %llu of %llu voxels differ, greatest error %g\n", codec, bytes.size(),
              static_cast<unsigned long long>(diff.differing_voxels),
              static_cast<unsigned long long>(diff.voxels), diff.max_abs_error);
  return {};
}

voxkit::Status with_svmm(Context& ctx) {
  using namespace voxkit::svmm;
  const auto original = voxkit::sphere_source(64);
  Params params;
  params.quality = 90;
  params.delta = delta_of_quality(params.quality, original->info().format, params.layout);
  VOX_CHECK(validate(params, original->info()));
  Bytes bytes;
  VOX_TRY(const auto levels, encode(*original, params, append_to(bytes), ctx));
  VOX_TRY(const auto container, Container::open(bytes, "sphere", nullptr));
  VOX_TRY(const auto volume, Volume::open(container));
  VOX_CHECK(volume->check(ctx));
  VOX_TRY(const auto decoded, open_source(volume, 0));
  VOX_CHECK(print_distance("svmm", *original, *decoded, bytes, ctx));

  voxkit::render::CastOptions options;
  options.width = options.height = 64;
  voxkit::render::Frame frame;
  VOX_CHECK(
      voxkit::render::cast(voxkit::render::SvmmGrid(volume), voxkit::render::Camera{}, options, frame, ctx));
  std::printf("render: %llu of %llu rays hit, %zu levels\n", static_cast<unsigned long long>(frame.rays_hit),
              static_cast<unsigned long long>(frame.rays), levels.size());
  return {};
}

voxkit::Status with_vq(Context& ctx) {
  const auto original = voxkit::sphere_source(64);
  Bytes bytes;
  VOX_TRY(const auto report, voxkit::vq::encode(*original, {}, append_to(bytes), ctx));
  VOX_TRY(const auto container, Container::open(bytes, "sphere", nullptr));
  VOX_TRY(const auto volume, voxkit::vq::Volume::open(container));
  VOX_CHECK(print_distance("vq", *original, *voxkit::vq::open_source(volume), bytes, ctx));
  std::printf("vq: %llu of %llu bricks are different\n",
              static_cast<unsigned long long>(report.params.unique_bricks),
              static_cast<unsigned long long>(report.bricks));
  return {};
}

Result<int> run() {
  voxkit::MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  VOX_CHECK(with_svmm(ctx));
  VOX_CHECK(with_vq(ctx));
  VOX_TRY(const auto voxels, consumer::surface_voxels(ctx));
  std::printf("color: %llu voxels\n", voxels);
  return 0;
}

}  // namespace

int main() {
  const auto result = run();
  if (!result) std::fprintf(stderr, "consumer: %s\n", result.error().what.c_str());
  return result.value_or(1);
}
