// What vox-info --stats says: lines, and JSON.
#pragma once

#include <string>

#include "libmetrics/volume_stats.h"
#include "tools/common/json.h"

namespace voxkit::cli {

/// Lines for people, a block for each channel.
std::string stats_text(const VolumeStats& stats);
Json stats_json(const VolumeStats& stats);

}  // namespace voxkit::cli
