// The surface inputs of the tools: meshes, models and everything that has coloured voxels.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "libcolor/surface.h"
#include "tools/common/input.h"

namespace voxkit::cli {

struct SurfaceOptions {
  OpenOptions open;
};

/// Opens a surface; it can be read once.
Result<std::unique_ptr<color::SurfaceSource>> open_surface(const std::string& name,
                                                           const SurfaceOptions& options, Context& ctx);

}  // namespace voxkit::cli
