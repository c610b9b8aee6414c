// The chunks of a VQ file, each kind in one piece: how a device wants them.
#pragma once

#include <vector>

#include "librender/device/backend.h"
#include "librender/device/warp_bricks.h"
#include "libvq/store.h"

namespace voxkit::render {

/// The chunks of a VQ file in one piece of memory each kind, with vq::read_slack bytes behind each chunk.
struct FlatVqPools {
  struct Section {
    const std::byte* bytes;
    const uint64_t* starts;  ///< of the chunks, and the end
    uint64_t parts;
    VOX_HD_HOT vq::Bytes operator()(uint64_t part) const {
      if (part >= parts) return {};
      return {bytes + starts[part], starts[part + 1] - starts[part] - vq::read_slack};
    }
  };
  Section offset_chunks, address_chunks, codebook_chunks;
  VOX_HD_HOT vq::Bytes offsets(uint64_t part) const { return offset_chunks(part); }
  VOX_HD_HOT vq::Bytes addresses(uint64_t part) const { return address_chunks(part); }
  VOX_HD_HOT vq::Bytes codebook(uint64_t part) const { return codebook_chunks(part); }
};

/// The chunks of a volume where kernels reach them.
struct FlatChunks {
  std::vector<DeviceArray<std::byte>> chunks;  ///< by kind
  std::vector<DeviceArray<uint64_t>> starts;
  FlatVqPools pools{};
};
/// Copies every chunk, verified. Errors: those of the backend, and ErrorCode::input.
Result<FlatChunks> upload_chunks(const vq::Volume& volume, const Backend& backend, Context& ctx);
/// What the codes of a volume stand for, for a device.
CodeValues code_values(const vq::Volume& volume);

}  // namespace voxkit::render
