// Text of headers: words and numbers.
#pragma once

#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace voxkit {

/// Without blanks and tabs at its ends.
std::string_view trim(std::string_view s);
/// ASCII letters in lower case.
std::string lower(std::string_view s);
/// What stands between blanks and tabs.
std::vector<std::string_view> words(std::string_view s);
/// A number that takes up all of `s`; nothing where there is none, or where T does not hold it.
template <class T>
std::optional<T> number(std::string_view s) {
  T value{};
  const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), value);
  if (error != std::errc{} || end != s.data() + s.size()) return std::nullopt;
  return value;
}

}  // namespace voxkit
