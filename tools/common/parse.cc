#include "tools/common/parse.h"

#include <fmt/core.h>

#include <charconv>
#include <cmath>
#include <limits>

namespace voxkit::cli {
namespace {

template <class T>
bool read_whole(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

std::vector<std::string_view> split(std::string_view text) {
  std::vector<std::string_view> parts;
  for (size_t at = 0;;) {
    const size_t comma = text.find(',', at);
    parts.push_back(text.substr(at, comma == text.npos ? text.npos : comma - at));
    if (comma == text.npos) return parts;
    at = comma + 1;
  }
}

}  // namespace

Result<int64_t> read_integer(std::string_view text, int64_t least, int64_t greatest) {
  int64_t value = 0;
  if (!read_whole(text, value) || value < least || value > greatest)
    return bad_usage(fmt::format("\"{}\": expected a whole number from {} to {}", text, least, greatest));
  return value;
}

Result<double> read_number(std::string_view text, double least, double greatest) {
  double value = 0;
  if (!read_whole(text, value) || !std::isfinite(value) || value < least || value > greatest) {
    if (greatest < std::numeric_limits<double>::max())
      return bad_usage(fmt::format("\"{}\": expected a number from {} to {}", text, least, greatest));
    if (least > std::numeric_limits<double>::lowest())
      return bad_usage(fmt::format("\"{}\": expected a number of at least {}", text, least));
    return bad_usage(fmt::format("\"{}\": expected a number", text));
  }
  return value;
}

Result<std::vector<double>> read_numbers(std::string_view text, size_t count) {
  std::vector<double> values;
  for (const std::string_view part : split(text)) {
    double value = 0;
    if (!read_whole(part, value) || !std::isfinite(value) || values.size() == count) {
      values.clear();
      break;
    }
    values.push_back(value);
  }
  if (values.size() != count)
    return bad_usage(fmt::format("\"{}\": expected {} numbers with commas between them", text, count));
  return values;
}

Result<std::vector<int64_t>> read_integers(std::string_view text, int64_t least, int64_t greatest) {
  std::vector<int64_t> values;
  for (const std::string_view part : split(text)) {
    const auto value = read_integer(part, least, greatest);
    if (!value)
      return bad_usage(fmt::format("\"{}\": expected whole numbers from {} to {} with commas between them",
                                   text, least, greatest));
    values.push_back(*value);
  }
  return values;
}

Result<Index3> read_dims(std::string_view text) {
  const auto sides = read_integers(text, 1, max_side);
  if (!sides || sides->size() != 3)
    return bad_usage(fmt::format("\"{}\": expected X,Y,Z, whole numbers from 1 to {}", text, max_side));
  const Index3 dims((*sides)[0], (*sides)[1], (*sides)[2]);
  if (!checked_voxels(dims)) return bad_usage(fmt::format("\"{}\": expected at most 2^62 voxels", text));
  return dims;
}

Result<Box> read_box(std::string_view text) {
  const auto corners = read_integers(text, 0, max_side);
  if (corners && corners->size() == 6) {
    const auto& c = *corners;
    const Box box{{c[0], c[1], c[2]}, {c[3], c[4], c[5]}};
    if (!box.empty()) return box;
  }
  return bad_usage(fmt::format(
      "\"{}\": expected X0,Y0,Z0,X1,Y1,Z1, whole numbers of voxels, each end greater than its start", text));
}

Result<uint64_t> read_size(std::string_view text) {
  std::string_view digits = text;
  int shift = 0;
  if (!digits.empty()) {
    const char unit = digits.back();
    shift = unit == 'K' || unit == 'k'   ? 10
            : unit == 'M' || unit == 'm' ? 20
            : unit == 'G' || unit == 'g' ? 30
                                         : 0;
    if (shift != 0) digits.remove_suffix(1);
  }
  uint64_t value = 0;
  if (!read_whole(digits, value) || value == 0 || value > std::numeric_limits<uint64_t>::max() >> shift)
    return bad_usage(fmt::format("\"{}\": expected a number of bytes such as 4096, 64K, 512M or 3G", text));
  return value << shift;
}

Parser one_of(std::string& value, std::vector<std::string> words) {
  return one_of(std::move(words), [&value](const std::string& word) { value = word; });
}

Parser one_of(std::vector<std::string> words, std::function<void(const std::string&)> store) {
  const auto read = [words, store = std::move(store)](const std::string& text) -> Status {
    std::string expected;
    for (const std::string& word : words) {
      if (word == text) {
        store(word);
        return {};
      }
      expected += (expected.empty() ? "" : &word == &words.back() ? " or " : ", ") + word;
    }
    return bad_usage(fmt::format("\"{}\": expected {}", text, expected));
  };
  return Parser(read, words);
}

}  // namespace voxkit::cli
