// What the tools say about VQ files.
#pragma once

#include <string>
#include <string_view>

#include "libvq/vq.h"
#include "tools/common/json.h"

namespace voxkit::cli {

std::string_view name(vq::Codebook codebook);
std::string_view name(vq::Mapping mapping);

/// The JSON object `params`.
Json params_json(const vq::Params& params);
/// Adds what the file has how much of.
void add_sizes(const vq::Params& params, Json& json);
/// The same in lines.
std::string sizes_text(const vq::Volume& volume);

}  // namespace voxkit::cli
