// Names of several files, as a pattern.
#pragma once

#include <cstdint>
#include <string>

#include "formats/result.h"

namespace voxkit::cli {

/// A pattern such as frame-%04d.png with its number filled in. `option`: what the pattern was given with, for
/// the error (ErrorCode::usage) where it is none.
Result<std::string> numbered_name(const std::string& option, const std::string& pattern, uint64_t number);

}  // namespace voxkit::cli
