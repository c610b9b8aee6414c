#include "formats/volume/dicom_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>

namespace voxkit {
namespace {

constexpr uint32_t tag(uint32_t group, uint32_t element) {
  return group << 16 | element;
}
constexpr uint32_t item_tag = tag(0xfffe, 0xe000), item_end = tag(0xfffe, 0xe00d),
                   sequence_end = tag(0xfffe, 0xe0dd);
constexpr uint32_t pixel_data = tag(0x7fe0, 0x0010);
constexpr uint32_t undefined_length = 0xffffffff;
constexpr int deepest = 32;  ///< sequences in sequences; real files have a handful

struct Damage {
  int64_t at;
  const char* rule;
};

/// Walks the elements of a file. Throws Damage, which read_dicom_header turns into an error.
class Walker {
 public:
  explicit Walker(const std::string& path) : file_(path, std::ios_base::binary) {
    file_.seekg(0, std::ios_base::end);
    size_ = file_ ? static_cast<int64_t>(file_.tellg()) : 0;
  }

  bool starts_as_dicom() {
    if (size_ < 132) return false;
    at_ = 128;
    return bytes(4) == "DICM";
  }

  /// The elements of group 2, which name the encoding of the others.
  void meta() {
    while (at_ < size_) {
      const uint32_t group = read_number(2);
      at_ -= 2;
      if (group != 2) break;
      const Element e = element();
      keep(e, size_);
    }
    const std::string syntax = text(0x0002, 0x0010);
    implicit_ = syntax == "1.2.840.10008.1.2";
    big_endian = syntax == "1.2.840.10008.1.2.2";
    encapsulated = !implicit_ && !big_endian && syntax != "1.2.840.10008.1.2.1";
  }

  /// The elements up to the pixels.
  void data_set() {
    while (at_ < size_ && pixels.empty()) {
      const Element e = element();
      if (e.tag == pixel_data) {
        words = e.type == "OW" || implicit_;
        if (e.length != undefined_length) {
          check(e.length <= size_ - at_, "pixels lead past the end of the file");
          pixels.push_back({at_, e.length});
        } else {
          fragments();
        }
      } else if (e.length == undefined_length) {
        sequence(e.type == "UN", 0);
      } else {
        keep(e, size_);
      }
    }
  }

  std::string text(uint32_t group, uint32_t number) const {
    const auto it = values_.find(tag(group, number));
    if (it == values_.end()) return {};
    const auto padding = [](char c) { return c == ' ' || c == '\0'; };
    const auto first = std::find_if_not(it->second.begin(), it->second.end(), padding);
    const auto last = std::find_if_not(it->second.rbegin(), it->second.rend(), padding).base();
    return first < last ? std::string(first, last) : std::string();
  }
  std::optional<int> number(uint32_t group, uint32_t number) const {
    const auto it = values_.find(tag(group, number));
    if (it == values_.end() || it->second.size() < 2) return std::nullopt;
    return static_cast<int>(unsigned_number(it->second.substr(0, 2), big_endian));
  }
  /// Decimal numbers separated by backslashes: exactly `count` finite ones, or none.
  std::vector<double> decimals(uint32_t group, uint32_t number, size_t count) const {
    const std::string all = text(group, number);
    std::vector<double> numbers;
    for (const char *p = all.data(), *end = p + all.size(); p < end;) {
      while (p < end && (*p == ' ' || *p == '+')) ++p;
      double value = 0;
      const auto [stop, error] = std::from_chars(p, end, value);
      if (error != std::errc() || !std::isfinite(value)) return {};
      numbers.push_back(value);
      p = stop;
      while (p < end && *p == ' ') ++p;
      if (p < end && *p++ != '\\') return {};
    }
    return numbers.size() == count ? numbers : std::vector<double>();
  }
  double decimal(uint32_t group, uint32_t number, double otherwise) const {
    const auto one = decimals(group, number, 1);
    return one.empty() ? otherwise : one[0];
  }

  bool big_endian = false, encapsulated = false;
  bool words = false;  ///< pixels are 16-bit words
  std::vector<FilePart> pixels;

 private:
  struct Element {
    uint32_t tag = 0;
    std::string type;
    uint32_t length = 0;
  };

  void check(bool holds, const char* rule) const {
    if (!holds) throw Damage{at_, rule};
  }
  std::string bytes(int64_t count) {
    check(count <= size_ - at_, "an element leads past the end of the file");
    std::string raw(static_cast<size_t>(count), '\0');
    file_.seekg(at_);
    check(static_cast<bool>(file_.read(raw.data(), count)), "cannot read");
    at_ += count;
    return raw;
  }
  static uint32_t unsigned_number(const std::string& raw, bool big) {
    uint32_t value = 0;
    for (size_t i = 0; i < raw.size(); ++i)
      value |= uint32_t{static_cast<unsigned char>(raw[big ? raw.size() - 1 - i : i])} << (8 * i);
    return value;
  }
  uint32_t read_number(int64_t count) { return unsigned_number(bytes(count), big_endian); }

  Element element() {
    Element e;
    const uint32_t group = read_number(2);
    e.tag = tag(group, read_number(2));
    if (implicit_ || group == 0xfffe) {
      e.length = read_number(4);
      return e;
    }
    e.type = bytes(2);
    static constexpr const char* long_types[] = {"OB", "OD", "OF", "OL", "OV", "OW", "SQ",
                                                 "SV", "UC", "UN", "UR", "UT", "UV"};
    if (std::find(std::begin(long_types), std::end(long_types), e.type) != std::end(long_types)) {
      bytes(2);
      e.length = read_number(4);
    } else {
      check(e.type[0] >= 'A' && e.type[0] <= 'Z' && e.type[1] >= 'A' && e.type[1] <= 'Z',
            "no type of a value");
      e.length = read_number(2);
    }
    return e;
  }

  /// Keeps a short value; passes over a long one.
  void keep(const Element& e, int64_t end) {
    check(e.length <= end - at_, "an element leads past the end of the file");
    constexpr uint32_t longest = 1024;
    if (e.length <= longest)
      values_[e.tag] = bytes(e.length);
    else
      at_ += e.length;
  }

  /// A sequence of undefined length, up to and with its end. Its values are of no use here.
  void sequence(bool of_implicit, int depth) {
    check(depth < deepest, "sequences are nested too deep");
    const bool outside = implicit_;
    implicit_ = implicit_ || of_implicit;
    for (;;) {
      const Element item = element();
      if (item.tag == sequence_end) break;
      check(item.tag == item_tag, "expected an item of a sequence");
      if (item.length != undefined_length) {
        check(item.length <= size_ - at_, "an item leads past the end of the file");
        at_ += item.length;
        continue;
      }
      for (;;) {
        const Element e = element();
        if (e.tag == item_end) break;
        if (e.length == undefined_length) {
          sequence(e.type == "UN", depth + 1);
        } else {
          check(e.length <= size_ - at_, "an element leads past the end of the file");
          at_ += e.length;
        }
      }
    }
    implicit_ = outside;
  }

  /// Compressed pixels: a table of offsets, which is passed over, then the fragments.
  void fragments() {
    check(encapsulated, "pixels of undefined length");
    for (bool table = true;; table = false) {
      const Element item = element();
      if (item.tag == sequence_end) break;
      check(item.tag == item_tag && item.length <= size_ - at_, "a fragment leads past the end of the file");
      if (!table) pixels.push_back({at_, item.length});
      at_ += item.length;
    }
    check(!pixels.empty(), "no fragments of pixels");
  }

  std::ifstream file_;
  int64_t size_ = 0, at_ = 0;
  bool implicit_ = false;
  std::map<uint32_t, std::string> values_;
};

}  // namespace

Result<std::optional<DicomHeader>> read_dicom_header(const std::string& path) {
  Walker file(path);
  try {
    if (!file.starts_as_dicom()) return std::nullopt;
    file.meta();
    const std::string syntax = file.text(0x0002, 0x0010);
    if (syntax.empty()) return bad_input(path, "DICOM file without a transfer syntax");
    if (syntax == "1.2.840.10008.1.2.1.99")
      return bad_input(path, "deflated DICOM file: expected another transfer syntax");
    file.data_set();
  } catch (const Damage& damage) {
    return bad_input(path, fmt::format("corrupt DICOM file: at byte {}: {}", damage.at, damage.rule));
  }
  if (!file.number(0x0028, 0x0010) || !file.number(0x0028, 0x0011)) return std::nullopt;
  DicomHeader h;
  h.path = path;
  h.transfer_syntax = file.text(0x0002, 0x0010);
  h.rows = *file.number(0x0028, 0x0010);
  h.columns = *file.number(0x0028, 0x0011);
  h.series = file.text(0x0020, 0x000e);
  h.photometric = file.text(0x0028, 0x0004);
  h.samples = file.number(0x0028, 0x0002).value_or(1);
  h.frames = file.decimal(0x0028, 0x0008, 1);
  h.bits_allocated = file.number(0x0028, 0x0100).value_or(0);
  h.bits_stored = file.number(0x0028, 0x0101).value_or(h.bits_allocated);
  h.high_bit = file.number(0x0028, 0x0102).value_or(h.bits_stored - 1);
  h.is_signed = file.number(0x0028, 0x0103).value_or(0) == 1;
  h.slope = file.decimal(0x0028, 0x1053, 1);
  h.intercept = file.decimal(0x0028, 0x1052, 0);
  if (const auto one = file.decimals(0x0020, 0x0013, 1); !one.empty() && std::abs(one[0]) < 1e15)
    h.instance = static_cast<int64_t>(one[0]);
  h.position = file.decimals(0x0020, 0x0032, 3);
  h.orientation = file.decimals(0x0020, 0x0037, 6);
  h.pixel_spacing = file.decimals(0x0028, 0x0030, 2);
  h.thickness = file.decimal(0x0018, 0x0088, file.decimal(0x0018, 0x0050, 1));
  h.big_endian = file.big_endian;
  h.encapsulated = file.encapsulated;
  h.pixels = std::move(file.pixels);
  if (h.pixels.empty()) return bad_input(path, "corrupt DICOM file: it ends before its pixels");
  if (h.big_endian && h.bits_allocated == 8 && file.words)
    return bad_input(path, "8-bit pixels in big-endian words: expected little endian");
  return h;
}

}  // namespace voxkit
