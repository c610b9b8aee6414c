// Any bytes as options and voxels: what is encoded must be sound, decode to the same, or as near as promised.
#include <algorithm>
#include <cmath>

#include "formats/copy.h"
#include "formats/little_endian.h"
#include "tests/fuzz/vq_target.h"
#include "tests/memory_volume.h"

namespace {

using namespace voxkit;
using namespace voxkit::vq;

std::vector<std::byte> encoded(VolumeSource& source, const Options& options, int threads) {
  MemoryBudget memory(uint64_t{1} << 30);
  Context ctx;
  ctx.threads = threads;
  ctx.memory = &memory;
  std::vector<std::byte> file;
  const auto report = encode(source, options, fuzz::sink_to(file), ctx);
  if (!report) fuzz::stop("cannot be encoded: " + report.error().what);
  if (!memory.reserve(memory.limit(), "all of it")) fuzz::stop("reserved memory was not given back");
  return file;
}

double value_at(const std::byte* p, VoxelFormat format) {
  const Voxel voxel = voxkit::test::voxel_at(p, format);
  if (format == VoxelFormat::float32) return voxel.as<float>();
  return format == VoxelFormat::density16 ? voxel.as<uint16_t>() : voxel.as<uint8_t>();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr size_t header = 9;
  if (size <= header) return 0;
  VolumeInfo info;
  // Long along any axis, but of few voxels.
  info.dims.x = 1 + data[0] % 200;
  info.dims.y = 1 + data[1] % std::min<int64_t>(70, 4096 / info.dims.x);
  info.dims.z = 1 + data[2] % std::min<int64_t>(70, std::max<int64_t>(1, 8192 / (info.dims.x * info.dims.y)));
  constexpr SampleType types[] = {SampleType::u8,  SampleType::i8,  SampleType::u16, SampleType::i16,
                                  SampleType::i32, SampleType::f32, SampleType::bit};
  info.sample_type = types[data[3] % 7];
  info.format = scalar_format(info.sample_type);
  const VoxelFormat f = info.format;
  Options options;
  options.codebook = data[4] & 1 ? Codebook::packed : Codebook::rbuc;
  if (data[4] & 2)
    options.mapping = data[4] & 4 && options.codebook == Codebook::rbuc ? Mapping::direct : Mapping::indirect;
  if (data[4] & 16) {
    (data[4] & 32 ? options.codewords : options.reduce) = 1u + data[5];
    options.seeding = data[4] & 64 ? Seeding::d2 : Seeding::furthest;
  } else if (data[4] & 8)
    options.max_error = std::ldexp(data[5], data[6] % 24 - 12);

  // The input over and over, or stretched to runs, of which equal bricks are made.
  const int64_t count = info.box().voxels();
  const auto stride = static_cast<size_t>(voxel_bytes(f));
  const size_t runs = size_t{1} << data[7] % 10;
  std::vector<std::byte> voxels(static_cast<size_t>(count) * stride);
  for (size_t i = 0; i < static_cast<size_t>(count); ++i)
    for (size_t b = 0; b < stride; ++b) {
      const uint8_t byte = data[header + (i / runs * stride + b) % (size - header)];
      voxels[i * stride + b] = static_cast<std::byte>(f == VoxelFormat::bitmap ? byte & 1 : byte);
    }
  if (info.sample_type == SampleType::i32)  // floats that are whole numbers
    for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
      const auto value = static_cast<float>(load_le<int16_t>(&voxels[4 * i]));
      std::memcpy(&voxels[4 * i], &value, sizeof value);
    }
  voxkit::test::MemorySource source(info, voxels);
  if (f == VoxelFormat::float32) {
    MemoryBudget memory(uint64_t{1} << 30);
    Context ctx;
    ctx.memory = &memory;
    options.range = *measure_range(source, ctx);
  }
  const auto bound = error_bound(options, info);
  if (!bound) return 0;  // 16 bits do not suffice

  const auto file = encoded(source, options, 1);
  voxkit::test::ForwardSource forward(info, voxels);
  if (encoded(forward, options, 1 + data[8] % 3) != file)
    fuzz::stop("the bytes depend on the kind of source or the threads");
  const auto answer = fuzz::expect_sound(file);
  if (!answer.checked || !answer.voxels) fuzz::stop("what was encoded is not valid");
  const auto opened = Volume::open(*Container::open(file, "fuzz", nullptr));
  if ((*opened)->params().seeding) {  // k-means promises nothing of single voxels
    if (options.codewords && (*opened)->params().codewords > options.codewords) fuzz::stop("too many bricks");
    return 0;
  }
  if (*bound == 0 && f != VoxelFormat::float32 && *answer.voxels != voxels) fuzz::stop("not exact");
  for (size_t i = 0; i < voxels.size(); i += stride) {
    const double a = value_at(&voxels[i], f), b = value_at(&(*answer.voxels)[i], f);
    if (!std::isfinite(b)) fuzz::stop("a voxel that is not a number");
    if (std::isfinite(a) && !(std::abs(a - b) <= *bound))
      fuzz::stop(
          fmt::format("voxel {} is {} away: expected at most {}", i / stride, std::abs(a - b), *bound));
  }
  return 0;
}
