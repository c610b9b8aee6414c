#include "formats/names.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace voxkit {
namespace {

std::string_view last_part(std::string_view name) {
  return name.substr(name.rfind('/') + 1);  // npos + 1 is 0
}

/// Of the conversion that begins with the % at `from`: the place of its d; npos where it is none.
size_t conversion_end(std::string_view text, size_t from) {
  const size_t end = text.find_first_not_of("0123456789", from + 1);
  return end < text.size() && text[end] == 'd' ? end : std::string_view::npos;
}

}  // namespace

bool has_ending(std::string_view name, std::string_view ending) {
  const auto same = [](char e, char c) { return (c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c) == e; };
  return name.size() >= ending.size() &&
         std::equal(ending.begin(), ending.end(), name.end() - static_cast<ptrdiff_t>(ending.size()), same);
}

std::string NumberedName::name(uint64_t number) const {
  return fmt::format("{}{:0{}}{}", prefix, number, width, suffix);
}

std::optional<uint64_t> NumberedName::number(const std::string& file) const {
  if (file.size() <= prefix.size() + suffix.size() || !file.starts_with(prefix) || !file.ends_with(suffix))
    return std::nullopt;
  const std::string digits = file.substr(prefix.size(), file.size() - prefix.size() - suffix.size());
  if (digits.size() > 18 || digits.find_first_not_of("0123456789") != std::string::npos) return std::nullopt;
  const uint64_t value = std::stoull(digits);
  return name(value) == file ? std::optional(value) : std::nullopt;
}

bool is_numbered(std::string_view name) {
  const std::string_view file = last_part(name);
  for (size_t i = file.find('%'); i < file.size(); i = file.find('%', i)) {
    if (conversion_end(file, i) != std::string_view::npos) return true;
    i += file.substr(i, 2) == "%%" ? 2 : 1;
  }
  return false;
}

Result<NumberedName> numbered_name(const std::string& text) {
  const auto wrong = [&] {
    return fail(ErrorCode::usage, text,
                "not a pattern of files: expected one %d or %04d in the file name, and %% for %");
  };
  const std::string_view file = last_part(text);
  NumberedName pattern;
  pattern.folder = text.substr(0, text.size() - file.size());
  bool found = false;
  for (size_t i = 0; i < file.size(); ++i) {
    std::string& part = found ? pattern.suffix : pattern.prefix;
    if (file[i] != '%') {
      part += file[i];
    } else if (file.substr(i, 2) == "%%") {
      part += '%';
      ++i;
    } else {
      const size_t end = conversion_end(file, i);
      const size_t digits = end - i - 1;  // the first of them is 0
      if (found || end == std::string_view::npos || digits > 3 ||
          (digits > 0 && (digits == 1 || file[i + 1] != '0')))
        return wrong();
      found = true;
      for (size_t k = i + 1; k < end; ++k)
        pattern.width = (k == i + 1 ? 0 : pattern.width * 10) + (file[k] - '0');
      if (pattern.width < 1 || pattern.width > 18) return wrong();
      i = end;
    }
  }
  if (!found) return wrong();
  return pattern;
}

bool leaves_folder(const std::string& folder, const std::string& name) {
  namespace fs = std::filesystem;
  const fs::path path = fs::path(name).lexically_normal();
  const fs::path base = fs::absolute(folder.empty() ? "." : folder).lexically_normal();
  const fs::path inside = path.is_absolute() ? path.lexically_relative(base) : path;
  return inside.empty() || *inside.begin() == "..";
}

}  // namespace voxkit
