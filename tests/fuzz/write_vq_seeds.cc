// Writes the seeds of the fuzz targets of the VQ codec: FOLDER/TARGET/NUMBER.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "libvq/layout.h"
#include "libvq/rbuc.h"
#include "tests/memory_volume.h"

namespace {

using namespace voxkit;
using namespace voxkit::vq;

void put(const std::filesystem::path& folder, int number, std::span<const std::byte> bytes) {
  std::filesystem::create_directories(folder);
  std::ofstream(folder / std::to_string(number), std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

std::vector<std::byte> with_options(std::initializer_list<int> options, std::span<const std::byte> bytes) {
  std::vector<std::byte> out;
  for (const int o : options) out.push_back(static_cast<std::byte>(o));
  out.insert(out.end(), bytes.begin(), bytes.end());
  return out;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::fputs("usage: vq_seeds FOLDER\n", stderr);
    return 2;
  }
  const std::filesystem::path folder = arguments[1];
  std::vector<std::byte> pattern(4096);
  for (size_t i = 0; i < pattern.size(); ++i) pattern[i] = static_cast<std::byte>(i * i / 7 % 64 + i / 300);
  int number = 0;
  for (const SampleType type : {SampleType::u8, SampleType::i16, SampleType::f32, SampleType::bit})
    for (int layout = 0; layout < 4; ++layout) {
      VolumeInfo info = test::scalar_info({9 + number, 7, 6}, type);
      Options options;
      if (layout == 1) options.mapping = Mapping::direct;
      if (layout == 2) options.mapping = Mapping::indirect;
      if (layout == 3) options.codebook = Codebook::packed;
      options.range = {0, 16};
      std::vector<std::byte> voxels(pattern.begin(),
                                    pattern.begin() + info.box().voxels() * voxel_bytes(info.format));
      if (type == SampleType::bit)
        for (std::byte& b : voxels) b &= std::byte{1};
      if (type == SampleType::f32)
        for (size_t i = 0; i < voxels.size(); i += 4) {
          const auto value = static_cast<float>(i * i % 257) / 16;
          std::memcpy(&voxels[i], &value, sizeof value);
        }
      test::MemorySource source(info, voxels);
      MemoryBudget memory;
      Context ctx;
      ctx.memory = &memory;
      std::vector<std::byte> file;
      const auto report = encode(
          source, options,
          [&](std::span<const std::byte> bytes) {
            file.insert(file.end(), bytes.begin(), bytes.end());
            return Status{};
          },
          ctx);
      if (!report) return 1;
      put(folder / "vq", number, file);
      const auto container = Container::open(file, "seed", nullptr);
      std::vector<std::byte> tables, codebook;
      for (size_t i = 0; i < (*container)->table().size(); ++i) {
        const uint32_t kind = (*container)->table()[i].kind;
        const auto chunk = *(*container)->chunk(i);
        if (kind == offsets_kind)
          put(folder / "vq_offsets", number, with_options({8 + number, 6, 5, layout == 1 ? 1 : 0}, chunk));
        if (kind == addresses_kind) tables.assign(chunk.begin(), chunk.end());
        if (kind == codebook_kind) codebook.assign(chunk.begin(), chunk.end());
      }
      tables.insert(tables.end(), codebook.begin(), codebook.end());
      const bool wide = info.format != VoxelFormat::density8;
      put(folder / "vq_codebook", number,
          with_options(
              {(wide ? 1 : 0) + (layout == 3 ? 2 : 0) + (report->params.mapping == Mapping::direct ? 4 : 0),
               report->params.bits - 1, static_cast<int>(report->params.codewords) - 1, 0},
              tables));
      put(folder / "vq_encode", number,
          with_options({40, 9, 7, number % 7, number, 3, number % 24, number % 9, 1},
                       std::span(pattern).first(200)));
      ++number;
    }
  for (number = 0; number < 40; ++number) {
    Brick brick;
    for (size_t i = 0; i < brick.size(); ++i)
      brick[i] = static_cast<uint16_t>((i % 4 * static_cast<size_t>(number) + i / 4 % 4 * 3 + i / 16 * 5 +
                                        (number % 5 == 0 ? i * i * i % 101 : i % 3)) %
                                       200);
    const BrickRange range = range_of(brick);
    std::array<std::byte, longest_codeword + 8> code;
    const int length = encode_codeword(brick, range, code.data());
    put(folder / "vq_rbuc", number,
        with_options({7, range.min, 0, range.max - range.min - 1},
                     std::span(code).first(static_cast<size_t>(length))));
  }
}
