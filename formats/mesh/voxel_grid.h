// The grid of voxels that a mesh was made of, as a text in its file.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "formats/volume.h"

namespace voxkit {

/// What the text is called: a comment of .obj files begins so, and it is a member of a node's extras in glTF.
inline constexpr std::string_view voxel_grid_name = "voxel_grid";

/// Extents and place of a grid, its world, unit and description, as a JSON object in one line of ASCII.
std::string voxel_grid_text(const VolumeInfo& info);
/// The inverse; nothing where the text is none, or says what no grid can have: sides beyond 2^21, 2^62
/// voxels, or axes in one plane. Safe on any bytes.
std::optional<VolumeInfo> parse_voxel_grid(std::string_view text);

}  // namespace voxkit
