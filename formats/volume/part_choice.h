// Which one of several parts of a file is meant: a time step, a channel, a series.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/result.h"
#include "formats/volume/open_volume.h"

namespace voxkit {

/// What a file has several of.
struct Parts {
  std::string_view option;  ///< that chooses, as "time"
  std::string_view many;    ///< for people, as "time steps"
  int64_t count = 1;
};

/// The number that was asked for; 0 where there is one part, or `any_part` takes the first of several. What
/// there is several of goes into `said`, as "--time 0 of 0..9". Errors: ErrorCode::input, naming the option
/// and what there is, where nothing was chosen, or what is not there.
Result<int64_t> choose_part(const std::string& file, const Parts& parts, std::optional<int64_t> asked,
                            bool any_part, std::vector<std::string>& said);

}  // namespace voxkit
