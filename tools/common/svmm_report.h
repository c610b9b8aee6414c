// What the tools say about SVMM files.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "libsvmm/packed/packed.h"
#include "libsvmm/svmm.h"
#include "tools/common/json.h"

namespace voxkit::cli {

std::string_view name(svmm::Layout layout);
std::string_view name(svmm::Base base);
std::string_view name(svmm::Bound bound);

/// The JSON object `params`.
Json params_json(const svmm::Params& params);
/// The JSON array `levels`.
Json levels_json(std::span<const svmm::Level> levels);

// The same of layout packed; levels as lines of vox-info.
Json params_json(const svmm::PackedParams& params);
Json levels_json(const svmm::PackedVolume& volume);
std::string levels_text(const svmm::PackedVolume& volume);

}  // namespace voxkit::cli
