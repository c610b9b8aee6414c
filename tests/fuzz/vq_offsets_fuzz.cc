// Any bytes as the offset volume of a file that is otherwise right: 16 bricks of 9 x 10 x 40 places or so,
// both mappings.
#include "formats/volume_chunks.h"
#include "libvq/layout.h"
#include "tests/fuzz/vq_target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxkit;
  using namespace voxkit::vq;
  constexpr size_t options = 4;
  if (size <= options) return 0;
  VolumeInfo info;
  info.dims = {1 + data[0] % 40, 1 + data[1] % 40, 1 + data[2] % 160};
  Params params;
  params.bits = 4;
  params.mapping = data[3] & 1 ? Mapping::direct : Mapping::indirect;
  params.codewords = std::min<uint64_t>(16, product(bricks_of(info.dims)));
  std::vector<std::byte> file, addresses(group_bytes), codebook;
  for (uint64_t i = 0; i < params.codewords; ++i) {
    codebook.push_back(static_cast<std::byte>(i | i << 4));  // constant
    if (i < group_bricks) addresses[8 + i] = std::byte{1};
  }
  ContainerWriter writer(fuzz::sink_to(file), Codec::vq);
  const auto offsets = std::as_bytes(std::span(data + options, size - options));
  Status written = writer.add(volume_info_kind, 0, 0, pack_volume_info(info));
  if (written) written = writer.add(params_kind, 0, 0, pack_params(params, data[3] >> 1));
  if (written) written = writer.add(offsets_kind, 0, 0, offsets);
  if (written && params.mapping == Mapping::indirect) written = writer.add(addresses_kind, 0, 0, addresses);
  if (written) written = writer.add(codebook_kind, 0, 0, codebook);
  if (written) written = writer.finish();
  if (!written) fuzz::stop(written.error().what);
  const auto answer = fuzz::expect_sound(file);
  if (answer.checked && answer.voxels)
    for (const std::byte voxel : *answer.voxels)
      if (std::to_integer<uint64_t>(voxel) >= params.codewords) fuzz::stop("a voxel of no brick");
  return 0;
}
