// Camera paths from a file. tools/README.md describes the format.
#pragma once

#include <string>
#include <vector>

#include "librender/camera.h"

namespace voxkit::render {

/// The cameras of a JSON file, one a frame, 1 to 100000 of them; those between two key frames are
/// interpolated. `fov`: of the frames that state none. Errors: ErrorCode::input names the frame and what was
/// expected.
Result<std::vector<Camera>> read_camera_file(const std::string& path, double fov);

}  // namespace voxkit::render
