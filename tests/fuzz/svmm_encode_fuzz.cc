// Any bytes as parameters and voxels: what is encoded must be sound, decode to the same where nothing may be
// lost, and keep the global bound.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "tests/libsvmm/attack.h"
#include "tests/libsvmm/reference.h"
#include "tests/memory_volume.h"

namespace {

using namespace voxkit;
using namespace voxkit::svmm;

[[noreturn]] void stop(const std::string& fault) {
  std::fprintf(stderr, "%s\n", fault.c_str());
  std::abort();
}

std::vector<std::byte> encoded(VolumeSource& source, const Params& params, int threads) {
  MemoryBudget memory(uint64_t{1} << 30);
  Context ctx;
  ctx.threads = threads;
  ctx.memory = &memory;
  std::vector<std::byte> file;
  const auto levels = encode(
      source, params,
      [&](std::span<const std::byte> bytes) {
        file.insert(file.end(), bytes.begin(), bytes.end());
        return Status{};
      },
      ctx);
  if (!levels) stop("cannot be encoded: " + levels.error().what);
  if (!memory.reserve(memory.limit(), "all of it")) stop("reserved memory was not given back");
  return file;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr size_t options = 15;
  if (size <= options) return 0;
  VolumeInfo info;
  // Long along any axis, to be cut into several tiles, but of few voxels.
  info.dims.x = 1 + data[0] % 70;
  info.dims.y = 1 + data[1] % std::min<int64_t>(70, 4096 / info.dims.x);
  info.dims.z = 1 + data[2] % std::min<int64_t>(70, std::max<int64_t>(1, 8192 / (info.dims.x * info.dims.y)));
  constexpr SampleType types[] = {SampleType::u8,  SampleType::u8,  SampleType::u8,
                                  SampleType::u16, SampleType::f32, SampleType::bit};
  info.format = static_cast<VoxelFormat>(1 + data[3] % 6);
  info.sample_type = types[data[3] % 6];
  const VoxelFormat f = info.format;
  Params params;
  params.layout = static_cast<Layout>(1 + data[4] % 2);
  params.bound = static_cast<Bound>(1 + data[4] / 2 % 2);
  params.alpha_weight = data[4] & 4;
  params.base = static_cast<Base>(1 + data[5] % 5);
  for (size_t i = 0; i < data[6] % 4u; ++i) params.blockwidths.push_back(2 << data[7 + i] % 6);
  params.rootwidth = 1 + data[10] % 40;
  params.quality = data[11] > 200 ? 100 : data[11] / 2.0;
  params.delta = delta_of_quality(params.quality, f, params.layout);
  params.full_scale = f == VoxelFormat::density16 ? 65535 : f == VoxelFormat::bitmap ? 1 : 255;
  if (f == VoxelFormat::float32) params.full_scale = std::ldexp(1, data[12] % 60 - 30);
  if (!validate(params, info)) return 0;

  // The input over and over, or stretched to runs, of which uniform blocks are made.
  const int64_t count = info.box().voxels();
  const auto stride = static_cast<size_t>(voxel_bytes(f));
  const size_t runs = size_t{1} << data[13] % 10;
  std::vector<std::byte> voxels(static_cast<size_t>(count) * stride);
  for (size_t i = 0; i < static_cast<size_t>(count); ++i)
    for (size_t b = 0; b < stride; ++b) {
      const uint8_t byte = data[options + (i / runs * stride + b) % (size - options)];
      voxels[i * stride + b] = static_cast<std::byte>(f == VoxelFormat::bitmap ? byte & 1 : byte);
    }

  voxkit::test::MemorySource source(info, voxels);
  const auto file = encoded(source, params, 1);
  voxkit::test::ForwardSource forward(info, voxels);
  if (encoded(forward, params, 1 + data[14] % 3) != file)
    stop("the bytes depend on the kind of source or the threads");

  const auto answer = svmm::test::attack(file);
  if (!answer.fault.empty()) stop(answer.fault);
  if (!answer.checked || answer.levels.empty()) stop("what was encoded is not valid");
  const auto opened = Volume::open(*Container::open(file, "fuzz", nullptr));
  const bool promised =
      (*opened)->params().base == Base::raw && (params.layout == Layout::plain || f != VoxelFormat::rgba32);
  if (!promised) return 0;
  if (params.quality == 100 && answer.levels[0] != voxels) stop("quality 100 is not exact");
  if (params.bound == Bound::local) return 0;
  for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
    const Voxel a = voxkit::test::voxel_at(&voxels[i * stride], f),
                b = voxkit::test::voxel_at(&answer.levels[0][i * stride], f);
    const double distance = reference::distance_between(a, b, f, params);
    if (!(distance <= params.delta * params.full_scale))
      stop(fmt::format("voxel {} is {} away: expected at most {}", i, distance,
                       params.delta * params.full_scale));
  }
  return 0;
}
