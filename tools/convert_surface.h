// vox-convert from coloured surfaces to a coloured surface: cropped, moved, merged.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/volume.h"
#include "tools/common/main.h"

namespace voxkit::cli {

/// What is done to surfaces, in this order.
struct SurfaceEdit {
  std::vector<std::string> inputs;  ///< more than one with `merge` only
  std::string output;
  bool merge = false;               ///< inputs become one, where their worlds say
  std::optional<Index3> translate;  ///< of voxels in the grid
  std::optional<Box> crop;          ///< the grid becomes this part of it
  int zstd = 0;                     ///< of the output, as color::Options has it
};

/// Makes the output, a .dagc file; returns the exit code.
Result<int> convert_surfaces(const SurfaceEdit& edit, Run& run);

}  // namespace voxkit::cli
