#include "tools/common/numbered_name.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

namespace voxkit::cli {

Result<std::string> numbered_name(const std::string& option, const std::string& pattern, uint64_t number) {
  const size_t percent = pattern.find('%');
  const size_t d =
      percent == std::string::npos ? percent : pattern.find_first_not_of("0123456789", percent + 1);
  if (d == std::string::npos || pattern[d] != 'd' || d - percent > 4)
    return bad_usage(option + " " + pattern + ": expected one %d or %04d in the name");
  const int width = std::atoi(pattern.c_str() + percent + 1);
  return pattern.substr(0, percent) + fmt::format("{:0{}}", number, std::max(width, 1)) +
         pattern.substr(d + 1);
}

}  // namespace voxkit::cli
