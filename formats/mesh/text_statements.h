// Lines of text with words and numbers, as .obj and .mtl files have them.
#pragma once

#include <charconv>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <string_view>

namespace voxkit {

/// A number in all of a word: .5, 1., +1e-3, nan, inf. What is too large is infinite, what is too small 0.
inline std::optional<double> number_of(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (end != word.data() + word.size() || word.empty()) return std::nullopt;
  if (error == std::errc()) return value;
  if (error != std::errc::result_out_of_range) return std::nullopt;
  const bool small = word.find("e-") != word.npos || word.find("E-") != word.npos;
  return small ? 0 : std::copysign(INFINITY, word.starts_with('-') ? -1.0 : 1.0);
}

/// Walks through statements: a line each, which goes on behind a backslash at its end. A # begins a comment.
class TextStatements {
 public:
  explicit TextStatements(std::span<const std::byte> bytes)
      : at_(reinterpret_cast<const char*>(bytes.data())), end_(at_ + bytes.size()) {}

  /// To the next line; false at the end.
  bool next() {
    if (started_) skip_line();
    started_ = true;
    return at_ < end_;
  }
  size_t line() const { return line_; }

  /// The next word of the statement; empty at its end.
  std::string_view word() {
    skip_space();
    const char* const begin = at_;
    if (at_ < end_ && *at_ == '#') return {};
    while (at_ < end_ && !is_space(*at_) && *at_ != '\n' && !goes_on()) ++at_;
    return {begin, static_cast<size_t>(at_ - begin)};
  }
  /// The rest of the line, without space around it.
  std::string_view rest() {
    skip_space();
    const char* const begin = at_;
    while (at_ < end_ && *at_ != '\n') ++at_;
    const char* last = at_;
    while (last > begin && is_space(last[-1])) --last;
    return {begin, static_cast<size_t>(last - begin)};
  }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }
  /// Whether a backslash is the last of its line.
  bool goes_on() const {
    return *at_ == '\\' &&
           (end_ - at_ < 2 || at_[1] == '\n' || (end_ - at_ > 2 && at_[1] == '\r' && at_[2] == '\n'));
  }
  void skip_space() {
    while (at_ < end_) {
      if (goes_on()) {
        while (at_ < end_ && *at_ != '\n') ++at_;
        if (at_ < end_) ++at_, ++line_;
      } else if (is_space(*at_)) {
        ++at_;
      } else {
        return;
      }
    }
  }
  void skip_line() {
    bool comment = false;  // ends with its line
    for (char before = ' '; at_ < end_ && *at_ != '\n';) {
      comment |= *at_ == '#' && is_space(before);
      if (!comment && goes_on()) {
        skip_space();
      } else {
        before = *at_++;
      }
    }
    if (at_ < end_) ++at_, ++line_;
  }

  const char *at_, *end_;
  size_t line_ = 1;
  bool started_ = false;
};

}  // namespace voxkit
