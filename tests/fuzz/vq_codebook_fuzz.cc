// Any bytes as the codebook, and the table of addresses, of a file that is otherwise right.
#include "formats/volume_chunks.h"
#include "libvq/layout.h"
#include "libvq/offsets.h"
#include "tests/fuzz/vq_target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxkit;
  using namespace voxkit::vq;
  constexpr size_t options = 4;
  if (size <= options) return 0;
  VolumeInfo info;
  info.dims = {16, 16, 16};
  info.format = data[0] & 1 ? VoxelFormat::density16 : VoxelFormat::density8;
  info.sample_type = data[0] & 1 ? SampleType::u16 : SampleType::u8;
  Params params;
  params.bits = 1 + data[1] % 16;
  params.codebook = data[0] & 2 ? Codebook::packed : Codebook::rbuc;
  params.mapping = (data[0] & 4) && params.codebook == Codebook::rbuc ? Mapping::direct : Mapping::indirect;
  params.codewords = 1 + data[2] % 64;
  params.step = 1 + data[3] % 8;
  auto rest = std::as_bytes(std::span(data + options, size - options));
  std::vector<std::byte> file, addresses;
  if (params.codebook == Codebook::rbuc && params.mapping == Mapping::indirect) {
    addresses.resize(divide_up(params.codewords, group_bricks) * group_bytes);
    const size_t take = std::min(addresses.size(), rest.size());
    std::memcpy(addresses.data(), rest.data(), take);
    rest = rest.subspan(take);
  }
  // Places go through the numbers, or through the addresses of a codebook of this length.
  const uint64_t ids =
      params.mapping == Mapping::direct ? std::max<size_t>(1, rest.size()) : params.codewords;
  BrickNumbers numbers(block_bricks);
  for (uint32_t i = 0; i < block_bricks; ++i) numbers[i] = i;
  const auto offsets = pack_offsets(numbers, 0, 0, [&](uint32_t n) { return n * ids / block_bricks; });
  ContainerWriter writer(fuzz::sink_to(file), Codec::vq);
  Status written = writer.add(volume_info_kind, 0, 0, pack_volume_info(info));
  if (written) written = writer.add(params_kind, 0, 0, pack_params(params, 0));
  if (written) written = writer.add(offsets_kind, 0, 0, offsets);
  if (written && !addresses.empty()) written = writer.add(addresses_kind, 0, 0, addresses);
  if (written) written = writer.add(codebook_kind, 0, 0, rest);
  if (written) written = writer.finish();
  if (!written) fuzz::stop(written.error().what);
  fuzz::expect_sound(file);
  return 0;
}
