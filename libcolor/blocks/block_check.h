// Verifying a part of blocks of variable bitrate.
#pragma once

#include <span>
#include <string>

#include "libcolor/params.h"

namespace voxkit::color {

/// What in a part of so many colours is not as FORMAT.md says, in words; empty if nothing is.
std::string check_block_part(std::span<const std::byte> part, const Params& params, uint32_t colors);

}  // namespace voxkit::color
