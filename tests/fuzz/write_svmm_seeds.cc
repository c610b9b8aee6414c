// Writes the seeds of container_fuzz, svmm_fuzz, svmm_encode_fuzz and svmm_packed_fuzz: FOLDER/TARGET/NUMBER.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "libsvmm/packed/packed.h"
#include "libsvmm/svmm.h"
#include "tests/memory_volume.h"

namespace {

using namespace voxkit;
using namespace voxkit::svmm;

void put(const std::filesystem::path& folder, int number, const std::string& bytes) {
  std::filesystem::create_directories(folder);
  std::ofstream(folder / std::to_string(number), std::ios::binary) << bytes;
}

VolumeInfo info_of(Index3 dims, VoxelFormat format) {
  VolumeInfo info;
  info.dims = dims;
  info.format = format;
  info.sample_type = format == VoxelFormat::density16 ? SampleType::u16
                     : format == VoxelFormat::float32 ? SampleType::f32
                     : format == VoxelFormat::bitmap  ? SampleType::bit
                                                      : SampleType::u8;
  return info;
}

/// Layout packed; `number` says what is in it, and how it is cut.
std::string packed_file(VoxelFormat format, double max_error, int number) {
  VolumeInfo info = info_of(number % 2 == 0 ? Index3(19, 9, 17) : Index3(7, 20, 1), format);
  info.is_labels = max_error == 0 && number % 3 == 0 && !is_color(format) && format != VoxelFormat::float32;
  std::vector<std::byte> voxels;
  for (int64_t i = 0; i < info.box().voxels(); ++i) {
    const auto value = static_cast<uint16_t>(number % 3 == 0 ? i / 7 % 5 * 11 : i * i / 31 % 200 + i % 3);
    const Voxel voxel =
        format == VoxelFormat::float32     ? Voxel::of(static_cast<float>(value) / 8 - 3)
        : format == VoxelFormat::density16 ? Voxel::of(static_cast<uint16_t>(value * 9))
        : format == VoxelFormat::bitmap    ? Voxel::of(static_cast<uint8_t>(value & 1))
        : is_color(format)
            ? Voxel::of(i % 3 == 0 ? 0u : static_cast<uint32_t>(i * 0x010203 % 0xffffff) | 0xff000000u)
            : Voxel::of(static_cast<uint8_t>(value));
    voxels.insert(voxels.end(), voxel.bytes.begin(), voxel.bytes.begin() + voxel_bytes(format));
  }
  test::MemorySource source(info, voxels);
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  std::string file;
  const auto written = encode_packed(
      source, {.max_error = max_error, .levels = number % 5 != 0, .page_side = number % 4 < 2 ? 8 : 16},
      [&](std::span<const std::byte> bytes) {
        file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        return Status{};
      },
      ctx);
  return written ? file : std::string();
}

std::string small_file(VoxelFormat format, Layout layout, Base base, int number) {
  const VolumeInfo info = info_of({7 + number % 5, 5, 6}, format);
  Params params;
  params.layout = layout;
  params.base = base;
  params.blockwidths = {base == Base::bc1 || number % 2 ? 4 : 2};
  params.rootwidth = number % 7 == 0 && base == Base::raw ? 16 : 2;
  if (!validate(params, info)) return {};
  std::vector<std::byte> voxels(static_cast<size_t>(info.box().voxels() * voxel_bytes(format)));
  for (size_t i = 0; i < voxels.size(); ++i)
    voxels[i] = static_cast<std::byte>(format == VoxelFormat::bitmap ? i * i / 7 % 2 : i * i / 7 % 64);
  test::MemorySource source(info, voxels);
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  std::string file;
  const auto levels = encode(
      source, params,
      [&](std::span<const std::byte> bytes) {
        file.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
        return Status{};
      },
      ctx);
  return levels ? file : std::string();
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::fputs("usage: svmm_seeds FOLDER\n", stderr);
    return 2;
  }
  const std::filesystem::path folder = arguments[1];
  int number = 0;
  for (int format = 1; format <= 6; ++format)
    for (int layout = 1; layout <= 2; ++layout)
      for (int base = 1; base <= 5; ++base) {
        const std::string file = small_file(static_cast<VoxelFormat>(format), static_cast<Layout>(layout),
                                            static_cast<Base>(base), number);
        // 15 bytes of options, then voxels.
        std::string options{31,
                            17,
                            12,
                            static_cast<char>(format - 1),
                            static_cast<char>(layout - 1 + 2 * (number % 4)),
                            static_cast<char>(base - 1),
                            static_cast<char>(number % 4),
                            1,
                            0,
                            2,
                            static_cast<char>(number % 9),
                            static_cast<char>(number * 37),
                            30,
                            static_cast<char>(number % 7),
                            1};
        for (int i = 0; i < 200; ++i) options += static_cast<char>(i * i / 7);
        put(folder / "svmm_encode", number, options);
        if (!file.empty()) put(folder / "svmm", number, file);
        if (!file.empty() && number % 8 == 0) put(folder / "container", number, file);
        ++number;
      }
  number = 0;
  for (const VoxelFormat format : {VoxelFormat::density8, VoxelFormat::density16, VoxelFormat::float32,
                                   VoxelFormat::bitmap, VoxelFormat::rgba32, VoxelFormat::rgb24})
    for (int i = 0; i < 6; ++i) {
      const double max_error = format == VoxelFormat::bitmap || i < 3 ? 0 : i;
      const std::string file = packed_file(format, max_error, number);
      if (file.empty()) return 1;
      put(folder / "svmm_packed", number++, file);
    }
}
