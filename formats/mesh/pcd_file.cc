#include "formats/mesh/pcd_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <optional>

#include "formats/little_endian.h"
#include "formats/mesh/text_statements.h"

namespace voxkit::pcd {
namespace {

constexpr size_t most_fields = 1024;
constexpr uint64_t most_count = 1 << 20;

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (size_t at = 0; (at = line.find_first_not_of(" \t\r", at)) != line.npos;) {
    const size_t end = std::min(line.find_first_of(" \t\r", at), line.size());
    words.push_back(line.substr(at, end - at));
    if (words.size() > most_fields + 1) break;
    at = end;
  }
  return words;
}

std::optional<uint64_t> whole(std::string_view word) {
  uint64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size() || word.empty()) return std::nullopt;
  return value;
}

bool is_type(char type, uint32_t size) {
  if (type == 'F') return size == 4 || size == 8;
  return (type == 'I' || type == 'U') && (size == 1 || size == 2 || size == 4 || size == 8);
}

/// Reads lines up to that of DATA.
class HeaderReader {
 public:
  HeaderReader(std::span<const std::byte> bytes, const std::string& path)
      : text_(reinterpret_cast<const char*>(bytes.data()), bytes.size()), path_(path) {}

  Result<Header> read() {
    for (bool more = true; more;) {
      const size_t end = text_.find('\n', at_);
      if (end == text_.npos)
        return bad_input(path_, began_ ? "PCD file ends within its header: expected DATA"
                                       : "not a PCD file: expected VERSION or FIELDS at its beginning");
      const std::string_view line = text_.substr(at_, end - at_);
      if (!line.starts_with('#')) {
        const auto words = words_of(line);
        if (!words.empty()) {
          if (words.size() > most_fields + 1)
            return bad(fmt::format("expected at most {} fields", most_fields));
          VOX_CHECK(read_line(words));
          more = words[0] != "DATA";
        }
      }
      at_ = end + 1;
    }
    header_.end = at_;
    VOX_CHECK(join());
    VOX_CHECK(assign());
    return std::move(header_);
  }

 private:
  tl::unexpected<Error> bad(const std::string& why) const {
    return bad_input(path_, fmt::format("corrupt PCD file: header at byte {}: {}", at_, why));
  }

  Status read_line(const std::vector<std::string_view>& words) {
    const std::string_view key = words[0];
    if (key == "VERSION" || key == "FIELDS" || key == "COLUMNS") {
      began_ = true;
    } else if (!began_) {
      return bad_input(path_, "not a PCD file: expected VERSION or FIELDS at its beginning");
    }
    if (key == "VERSION") {
      const auto version = number_of(words.back());
      if (words.size() != 2 || !version || !(*version <= 0.7))
        return bad(fmt::format("version {}: expected 0.7", words.back()));
    } else if (key == "FIELDS" || key == "COLUMNS") {
      names_.assign(words.begin() + 1, words.end());
    } else if (key == "SIZE" || key == "COUNT") {
      auto& to = key == "SIZE" ? sizes_ : counts_;
      to.clear();
      for (size_t i = 1; i < words.size(); ++i) {
        const auto value = whole(words[i]);
        if (!value || *value < 1 || *value > most_count)
          return bad(fmt::format("{} {}: expected 1 to {}", key, words[i], most_count));
        to.push_back(*value);
      }
    } else if (key == "TYPE") {
      types_.assign(words.begin() + 1, words.end());
    } else if (key == "WIDTH" || key == "HEIGHT" || key == "POINTS") {
      const auto value = words.size() == 2 ? whole(words[1]) : std::nullopt;
      if (!value) return bad(fmt::format("{}: expected a number of points", key));
      (key == "WIDTH" ? width_ : key == "HEIGHT" ? height_ : points_) = value;
    } else if (key == "VIEWPOINT") {
      constexpr double identity[] = {0, 0, 0, 1, 0, 0, 0};
      if (words.size() != 8) return bad("VIEWPOINT: expected 7 numbers");
      for (size_t i = 0; i < 7; ++i) {
        const auto value = number_of(words[i + 1]);
        if (!value) return bad("VIEWPOINT: expected 7 numbers");
        moved_ |= *value != identity[i];
      }
    } else if (key == "DATA") {
      if (words.size() == 2 && words[1] == "ascii")
        header_.data = Data::ascii;
      else if (words.size() == 2 && words[1] == "binary")
        header_.data = Data::binary;
      else if (words.size() == 2 && words[1] == "binary_compressed")
        header_.data = Data::compressed;
      else
        return bad("DATA: expected ascii, binary or binary_compressed");
    } else {
      return bad("expected VERSION, FIELDS, SIZE, TYPE, COUNT, WIDTH, HEIGHT, VIEWPOINT, POINTS or DATA");
    }
    return {};
  }

  Status join() {
    if (names_.empty()) return bad("no FIELDS are named");
    const size_t count = names_.size();
    if (sizes_.size() != count || types_.size() != count || (!counts_.empty() && counts_.size() != count))
      return bad(fmt::format("expected SIZE, TYPE and COUNT of {} fields", count));
    for (size_t i = 0; i < count; ++i) {
      Field field{
          names_[i],     types_[i][0], static_cast<uint32_t>(sizes_[i]), counts_.empty() ? 1 : counts_[i],
          header_.words, header_.bytes};
      if (types_[i].size() != 1 || !is_type(field.type, field.size))
        return bad(fmt::format("field {} of type {}, {} bytes: expected F of 4 or 8, I or U of 1, 2, 4 or 8",
                               names_[i], types_[i], sizes_[i]));
      header_.words += field.count;
      header_.bytes += field.count * field.size;
      header_.fields.push_back(std::move(field));
    }
    if (!width_ && !points_) return bad("expected WIDTH, or POINTS");
    uint64_t points = 0;
    if (__builtin_mul_overflow(width_.value_or(points_.value_or(0)), height_.value_or(1), &points) ||
        (points_ && *points_ != points))
      return bad("expected as many POINTS as WIDTH times HEIGHT");
    // So that no size of it is above 2^63.
    if (points > uint64_t{1} << 63 >> std::bit_width(header_.bytes + 2 * header_.words))
      return bad(fmt::format("{} points: expected fewer", points));
    header_.points = points;
    return {};
  }

  Status assign() {
    const auto find = [&](std::string_view name) -> int {
      for (size_t i = 0; i < header_.fields.size(); ++i)
        if (header_.fields[i].name == name && header_.fields[i].count == 1) return static_cast<int>(i);
      return -1;
    };
    Roles& roles = header_.roles;
    for (int a = 0; a < 3; ++a) {
      roles.at[a] = find(std::string_view("xyz").substr(static_cast<size_t>(a), 1));
      if (roles.at[a] < 0) return bad("expected the fields x, y and z");
    }
    for (const char* name : {"rgb", "rgba"}) {
      const int found = find(name);
      if (roles.color >= 0 || found < 0 || header_.fields[static_cast<size_t>(found)].size != 4) continue;
      roles.color = found;
      roles.has_alpha = std::string_view(name) == "rgba";
    }
    if (roles.color < 0) roles.intensity = find("intensity");

    std::vector<std::string> dropped;
    for (size_t i = 0; i < header_.fields.size(); ++i) {
      const int index = static_cast<int>(i);
      const bool used = std::find(roles.at, roles.at + 3, index) != roles.at + 3 || index == roles.color ||
                        index == roles.intensity;
      if (!used && header_.fields[i].name != "_") dropped.push_back(header_.fields[i].name);
    }
    constexpr size_t most = 16;
    if (const size_t all = dropped.size(); all > 0) {
      dropped.resize(std::min(all, most));
      header_.notes.push_back(fmt::format("dropped: {}{}", fmt::join(dropped, ", "),
                                          all > most ? fmt::format(" and {} others", all - most) : ""));
    }
    if (moved_) header_.notes.emplace_back("the viewpoint is not applied: places are as they are stored");
    return {};
  }

  std::string_view text_;
  const std::string& path_;
  size_t at_ = 0;
  bool began_ = false, moved_ = false;
  std::vector<std::string> names_, types_;
  std::vector<uint64_t> sizes_, counts_;
  std::optional<uint64_t> width_, height_, points_;
  Header header_;
};

}  // namespace

Result<Header> read_header(std::span<const std::byte> bytes, const std::string& path) {
  return HeaderReader(bytes, path).read();
}

double load(const std::byte* bytes, const Field& field) {
  const auto as = [&]<class T>(T) { return static_cast<double>(load_le<T>(bytes)); };
  if (field.type == 'F') return field.size == 4 ? as(float{}) : as(double{});
  const bool is_signed = field.type == 'I';
  switch (field.size) {
    case 1:
      return is_signed ? as(int8_t{}) : as(uint8_t{});
    case 2:
      return is_signed ? as(int16_t{}) : as(uint16_t{});
    case 4:
      return is_signed ? as(int32_t{}) : as(uint32_t{});
    default:
      return is_signed ? as(int64_t{}) : as(uint64_t{});
  }
}

bool parse(std::string_view word, double& value) {
  const auto number = number_of(word);
  if (number) value = *number;
  return number.has_value();
}

bool parse_color(std::string_view word, const Field& field, std::optional<uint32_t>& color) {
  if (field.type != 'F') {
    const auto number = number_of(word);
    if (!number || !(*number >= INT32_MIN && *number <= UINT32_MAX)) return false;
    color = static_cast<uint32_t>(static_cast<int64_t>(*number));
    return true;
  }
  // Its own digits: through a double it would be rounded twice.
  float value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (end != word.data() + word.size() || word.empty()) return false;
  if (error != std::errc{}) value = 0;
  color = std::isnan(value) ? std::nullopt : std::optional(std::bit_cast<uint32_t>(value));
  return true;
}

}  // namespace voxkit::pcd
