// The backend of GPUs, where nvcc was found.
#pragma once

#include "librender/device/backend.h"

namespace voxkit::render {

/// The first GPU. Errors: ErrorCode::device, before anything is uploaded.
Result<std::shared_ptr<const Backend>> open_cuda();

}  // namespace voxkit::render
