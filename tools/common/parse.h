// The values of options, from text. Every function returns a parser for `CommandLine::option` that stores
// what it read.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "formats/convert.h"
#include "formats/result.h"
#include "formats/volume.h"

namespace voxkit::cli {

/// Reads and stores the value of an option; an error says what was expected.
struct Parser {
  template <class Read>
  requires std::is_invocable_r_v<Status, Read&, const std::string&> Parser(
      Read reader, std::vector<std::string> known = {})  // NOLINT: lambdas are parsers
      : read(std::move(reader)), words(std::move(known)) {}

  std::function<Status(const std::string&)> read;
  std::vector<std::string> words;  ///< all values that there are, where these are words; else none
};

/// The readers themselves; errors are ErrorCode::usage and say what was expected.
Result<int64_t> read_integer(std::string_view text, int64_t least, int64_t greatest);
Result<double> read_number(std::string_view text, double least, double greatest);
Result<std::vector<double>> read_numbers(std::string_view text, size_t count);
Result<std::vector<int64_t>> read_integers(std::string_view text, int64_t least, int64_t greatest);
Result<Index3> read_dims(std::string_view text);
/// X0,Y0,Z0,X1,Y1,Z1, half open, not empty.
Result<Box> read_box(std::string_view text);
/// Bytes: 4096, 64K, 512M, 3G; powers of 1024.
Result<uint64_t> read_size(std::string_view text);

/// `value` may be of the type read, or an optional of it; it must outlive the parsing.
template <class T>
Parser integer(T& value, int64_t least, int64_t greatest) {
  return [&value, least, greatest](const std::string& text) -> Status {
    VOX_TRY(const int64_t read, read_integer(text, least, greatest));
    if constexpr (std::is_integral_v<T>)
      value = static_cast<T>(read);
    else
      value = static_cast<typename T::value_type>(read);
    return {};
  };
}
template <class T>
Parser number(T& value, double least, double greatest) {
  return [&value, least, greatest](const std::string& text) -> Status {
    VOX_TRY(value, read_number(text, least, greatest));
    return {};
  };
}
template <class T>
Parser dims(T& value) {
  return [&value](const std::string& text) -> Status {
    VOX_TRY(value, read_dims(text));
    return {};
  };
}
template <class T>
Parser box(T& value) {
  return [&value](const std::string& text) -> Status {
    VOX_TRY(value, read_box(text));
    return {};
  };
}
template <class T>
Parser target_type(T& value) {
  const auto read = [&value](const std::string& text) -> Status {
    VOX_TRY(value, parse_target_type(text));
    return {};
  };
  return Parser(read, target_type_names());
}
/// One of a few words.
Parser one_of(std::string& value, std::vector<std::string> words);
/// The same; `store` is called with it.
Parser one_of(std::vector<std::string> words, std::function<void(const std::string&)> store);

}  // namespace voxkit::cli
