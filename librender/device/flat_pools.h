// The blocks of an SVMM volume, each level in one piece: how a device wants them.
#pragma once

#include <vector>

#include "librender/device/backend.h"
#include "libsvmm/walk.h"

namespace voxkit::render {

/// The blocks of a volume where kernels reach them.
struct FlatBlocks {
  std::vector<DeviceArray<std::byte>> levels;
  svmm::FlatPools pools{};
};
/// Copies every level's blocks, chunk by chunk, each verified. Errors: those of the backend, and
/// ErrorCode::input.
Result<FlatBlocks> upload_blocks(const svmm::Volume& volume, const Backend& backend, Context& ctx);

}  // namespace voxkit::render
