// Which files are the slices of a stack of images.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "formats/names.h"
#include "formats/result.h"

namespace voxkit {

/// Every number that the pattern makes from a file that is there.
Result<std::set<uint64_t>> numbers_of(const NumberedName& pattern);

/// Files of a printf pattern, in the order of their numbers. ErrorCode::input where one is missing.
Result<std::vector<std::string>> slices_of_pattern(const std::string& text);

/// The images in a folder, in natural order. ErrorCode::input where there are none, or several kinds.
Result<std::vector<std::string>> slices_of_folder(const std::string& folder);

}  // namespace voxkit
