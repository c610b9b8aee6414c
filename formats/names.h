// What names of files say: endings, and patterns that stand for one file a number.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "formats/result.h"

namespace voxkit {

/// Whether a name ends so, in letters of any case; `ending` is in lower case.
bool has_ending(std::string_view name, std::string_view ending);

/// A name such as slices/image-%04d.tif, taken apart: a user's text is never given to printf.
struct NumberedName {
  std::string folder;  ///< with the slash at its end, or empty
  std::string prefix, suffix;
  int width = 1;  ///< least number of digits

  /// The last part of the name of a file, and all of it.
  std::string name(uint64_t number) const;
  std::string path(uint64_t number) const { return folder + name(number); }
  /// The number in the last part of a name that this pattern makes; nothing in any other name.
  std::optional<uint64_t> number(const std::string& file) const;
};

/// Whether the last part of a name has a %d, or %04d with any number of digits. Names that have none are
/// names of one file, whatever other % is in them.
bool is_numbered(std::string_view name);

/// Takes a name that is_numbered apart; there %% stands for %. Errors: ErrorCode::usage where there is any
/// other %, a second %d, a width without its 0, or one above 18.
Result<NumberedName> numbered_name(const std::string& name);

/// Whether a name that a file in `folder` has for another file leads out of that folder: an absolute one to
/// elsewhere, or one with more ".." than folders before them. Names decide, and not where links lead.
bool leaves_folder(const std::string& folder, const std::string& name);

}  // namespace voxkit
