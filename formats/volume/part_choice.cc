#include "formats/volume/part_choice.h"

#include <fmt/format.h>

namespace voxkit {

Result<int64_t> choose_part(const std::string& file, const Parts& parts, std::optional<int64_t> asked,
                            bool any_part, std::vector<std::string>& said) {
  if (asked && (*asked < 0 || *asked >= parts.count))
    return bad_input(file, fmt::format("--{} {}: expected a number from 0 to {}: it has {} {}", parts.option,
                                       *asked, parts.count - 1, parts.count, parts.many));
  if (parts.count == 1) return 0;
  if (!asked && !any_part)
    return bad_input(file, fmt::format("{} {}: expected --{} N with a number from 0 to {}", parts.count,
                                       parts.many, parts.option, parts.count - 1));
  const int64_t number = asked.value_or(0);
  said.push_back(fmt::format("--{} {} of 0..{}", parts.option, number, parts.count - 1));
  return number;
}

}  // namespace voxkit
