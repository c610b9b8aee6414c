#include "formats/mesh/las_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "formats/little_endian.h"
#include "formats/names.h"

namespace voxkit::las {
namespace {

/// Of a format of points: its bytes, and where its colours are; 0: it has none.
struct Layout {
  size_t bytes, color;
};
constexpr Layout layouts[] = {{20, 0}, {28, 0},  {26, 20}, {34, 28}, {57, 0}, {63, 28},
                              {30, 0}, {36, 30}, {38, 30}, {59, 0},  {67, 30}};

/// What a record of variable length begins with.
struct Record {
  std::string user;
  uint16_t id = 0;
  std::span<const std::byte> data;
};

std::string text_of(std::span<const std::byte> bytes) {
  const std::string_view all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return std::string(all.substr(0, all.find('\0')));
}

/// Coordinate reference systems, by their records.
class ReferenceSystem {
 public:
  void add(const Record& record) {
    if (record.user != "LASF_Projection") return;
    there_ = true;
    if (record.id == 2112) {  // well-known text: the first name in it
      const std::string text = text_of(record.data);
      const size_t begin = text.find('"'), end = text.find('"', begin + 1);
      if (begin != text.npos && end != text.npos)
        name_ = text.substr(begin + 1, std::min<size_t>(end - begin - 1, 100));
    } else if (record.id == 34735 &&
               name_.empty()) {  // GeoTIFF keys: a projected system, or a geographic one
      for (size_t at = 8; at + 8 <= record.data.size(); at += 8) {
        const auto key = load_le<uint16_t>(&record.data[at]), where = load_le<uint16_t>(&record.data[at + 2]),
                   code = load_le<uint16_t>(&record.data[at + 6]);
        if (where == 0 && code != 32767 && (key == 3072 || (key == 2048 && epsg_ == 0))) epsg_ = code;
      }
    }
  }
  bool is_there() const { return there_; }
  std::string note() const {
    const std::string name = !name_.empty() ? name_ : epsg_ ? fmt::format("EPSG:{}", epsg_) : "";
    return fmt::format("dropped: the coordinate reference system{}{}", name.empty() ? "" : ", ", name);
  }

 private:
  bool there_ = false;
  std::string name_;
  uint16_t epsg_ = 0;
};

class HeaderReader {
 public:
  HeaderReader(std::span<const std::byte> bytes, const std::string& path) : bytes_(bytes), path_(path) {}

  Result<Header> read() {
    constexpr size_t least_header = 227;
    if (bytes_.size() < 4 || text_of(bytes_.first(4)) != "LASF")
      return bad_input(path_, "not a LAS file: expected LASF at byte 0");
    if (bytes_.size() < least_header)
      return bad_input(path_, fmt::format("LAS file ends after {} bytes, within its header", bytes_.size()));
    const auto major = at<uint8_t>(24), minor = at<uint8_t>(25);
    if (major != 1 || minor > 4)
      return bad_input(path_, fmt::format("LAS version {}.{}: expected 1.0 to 1.4", major, minor));
    const size_t header_bytes = at<uint16_t>(94);
    const auto format = at<uint8_t>(104);
    const bool is_packed = (format & 0xc0) != 0;
    if (is_packed || has_ending(path_, ".laz"))
      return bad_input(path_,
                       "LAZ: expected LAS, not compressed: laszip -i IN.laz -o OUT.las, or pdal translate "
                       "IN.laz OUT.las, unpacks it");
    if (header_bytes < least_header || header_bytes > bytes_.size())
      return bad(94, fmt::format("a header of {} bytes: expected {} to {}", header_bytes, least_header,
                                 bytes_.size()));
    if (format >= std::size(layouts))
      return bad(104, fmt::format("points of format {}: expected 0 to 10", format));
    const Layout layout = layouts[format];
    header_.format = format;
    header_.stride = at<uint16_t>(105);
    if (header_.stride < layout.bytes)
      return bad(105, fmt::format("points of {} bytes: those of format {} have at least {}", header_.stride,
                                  format, layout.bytes));
    header_.color = layout.color;
    header_.flags = 15;
    header_.withheld = std::byte{static_cast<uint8_t>(format >= 6 ? 4 : minor >= 1 ? 0x80 : 0)};
    header_.label = format >= 6 ? 16 : 15;
    header_.label_mask = format < 6 && minor >= 1 ? 0x1f : 0xff;
    for (int a = 0; a < 3; ++a) {
      header_.scale[a] = at<double>(131 + 8 * static_cast<size_t>(a));
      header_.offset[a] = at<double>(155 + 8 * static_cast<size_t>(a));
      // What goes beyond floats is nowhere.
      if (!(std::abs(header_.scale[a]) < 1e28) || header_.scale[a] == 0 ||
          !(std::abs(header_.offset[a]) < 1e38))
        return bad(
            131 + 8 * static_cast<size_t>(a),
            fmt::format(
                "{}: scale {}, offset {}: expected magnitudes below 1e28 and 1e38, and a scale that is not 0",
                "xyz"[a], header_.scale[a], header_.offset[a]));
    }
    VOX_CHECK(read_points(header_bytes, minor));
    VOX_CHECK(read_records(header_bytes, minor));
    name_fields(layout);
    return std::move(header_);
  }

 private:
  template <class T>
  T at(size_t byte) const {
    return load_le<T>(&bytes_[byte]);
  }
  tl::unexpected<Error> bad(size_t byte, const std::string& why) const {
    return bad_input(path_, fmt::format("corrupt LAS file: byte {}: {}", byte, why));
  }
  bool has_long_header(size_t header_bytes, unsigned minor) const {
    return minor >= 4 && header_bytes >= 375;
  }

  Status read_points(size_t header_bytes, unsigned minor) {
    header_.points = has_long_header(header_bytes, minor) ? at<uint64_t>(247) : 0;
    if (header_.points == 0) header_.points = at<uint32_t>(107);
    header_.begin = at<uint32_t>(96);
    if (header_.begin < header_bytes || header_.begin > bytes_.size())
      return bad(96, fmt::format("points from byte {} on: expected {} to {}", header_.begin, header_bytes,
                                 bytes_.size()));
    if (header_.points == 0) return bad_input(path_, "no points");
    const uint64_t room = (bytes_.size() - header_.begin) / header_.stride;
    if (header_.points > room)
      return bad_input(path_, fmt::format("LAS file ends after {} bytes: it holds {} of {} points",
                                          bytes_.size(), room, header_.points));
    return {};
  }

  Status read_records(size_t header_bytes, unsigned minor) {
    ReferenceSystem system;
    std::vector<std::string> others;  // in the order of the file
    const auto read = [&](uint64_t first, uint64_t count, uint64_t end, bool is_long) -> Status {
      const size_t head = is_long ? 60 : 54;
      uint64_t byte = first;
      for (uint64_t i = 0; i < count; ++i) {
        const auto where = static_cast<size_t>(byte);
        if (end - byte < head)
          return bad(where, fmt::format("record {} of {}: expected {} bytes", i, count, head));
        const uint64_t length = is_long ? at<uint64_t>(where + 20) : at<uint16_t>(where + 20);
        if (length > end - byte - head)
          return bad(where,
                     fmt::format("record {} of {} bytes: expected at most {}", i, length, end - byte - head));
        const Record record{text_of(bytes_.subspan(where + 2, 16)), at<uint16_t>(where + 18),
                            bytes_.subspan(where + head, static_cast<size_t>(length))};
        system.add(record);
        constexpr size_t most = 5;
        // Those of LASF_Spec say what the fields of points are.
        if (record.user != "LASF_Projection" && record.user != "LASF_Spec" && others.size() <= most &&
            std::find(others.begin(), others.end(), record.user) == others.end())
          others.push_back(others.size() == most ? "others" : record.user);
        byte += head + length;
      }
      return {};
    };
    VOX_CHECK(read(header_bytes, at<uint32_t>(100), header_.begin, false));
    if (has_long_header(header_bytes, minor) && at<uint32_t>(243) > 0) {
      const auto first = at<uint64_t>(235);
      if (first < header_.begin || first > bytes_.size())
        return bad(235, fmt::format("records from byte {} on: expected {} to {}", first, header_.begin,
                                    bytes_.size()));
      VOX_CHECK(read(first, at<uint32_t>(243), bytes_.size(), true));
    }
    if (system.is_there()) header_.notes.push_back(system.note());
    if (!others.empty())
      header_.notes.push_back(fmt::format("dropped: records of {}", fmt::join(others, ", ")));
    return {};
  }

  void name_fields(const Layout& layout) {
    auto& names = header_.fields_dropped;
    names = {"return numbers", "classification", "scan angles", "user data", "point sources"};
    const unsigned format = header_.format;
    if (format != 0 && format != 2) names.emplace_back("GPS times");
    if (format == 8 || format == 10) names.emplace_back("near infrared");
    if (format == 4 || format == 5 || format == 9 || format == 10) names.emplace_back("waveforms");
    if (header_.stride > layout.bytes)
      names.push_back(fmt::format("{} extra bytes a point", header_.stride - layout.bytes));
  }

  std::span<const std::byte> bytes_;
  const std::string& path_;
  Header header_;
};

}  // namespace

Result<Header> read_header(std::span<const std::byte> bytes, const std::string& path) {
  return HeaderReader(bytes, path).read();
}

}  // namespace voxkit::las
