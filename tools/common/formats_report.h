// The formats of volumes, and what files of each hold: for people and programs.
#pragma once

#include <string>

#include "tools/common/json.h"
#include "tools/common/main.h"

namespace voxkit::cli {

/// A line for each format.
std::string formats_text();
/// `formats[]`: name, reads, writes, types, levels, random_access.
Json formats_json(const Run& run);

}  // namespace voxkit::cli
