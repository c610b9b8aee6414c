// What the tools say about compressed surfaces.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "libcolor/color.h"
#include "tools/common/json.h"

namespace voxkit::cli {

std::string_view name(color::ImageCurve curve);
Json params_json(const color::Params& params);
/// Sizes: leaf_voxels, dag_nodes, dag_bytes, color_count, color_bytes, macro_blocks, blocks.
void add_sizes(const color::Params& params, Json& json);
/// The same as lines of vox-info.
std::string sizes_text(const color::Params& params);
/// Percent of 24 bits a colour.
double color_percent(const color::Params& params);

}  // namespace voxkit::cli
