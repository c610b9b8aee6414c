// Writes the seeds of container_fuzz, svmm_fuzz and svmm_encode_fuzz: FOLDER/TARGET/NUMBER.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "libsvmm/svmm.h"
#include "tests/memory_volume.h"

namespace {

using namespace voxkit;
using namespace voxkit::svmm;

void put(const std::filesystem::path& folder, int number, const std::string& bytes) {
  std::filesystem::create_directories(folder);
  std::ofstream(folder / std::to_string(number), std::ios::binary) << bytes;
}

std::string small_file(VoxelFormat format, Layout layout, Base base, int number) {
  VolumeInfo info;
  info.dims = {7 + number % 5, 5, 6};
  info.format = format;
  info.sample_type = format == VoxelFormat::density16 ? SampleType::u16
                     : format == VoxelFormat::float32 ? SampleType::f32
                     : format == VoxelFormat::bitmap  ? SampleType::bit
                                                      : SampleType::u8;
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
}
