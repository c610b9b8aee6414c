#include "formats/volume/dicom_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace voxkit {
namespace {

constexpr uint32_t item_tag = dicom_tag(0xfffe, 0xe000), item_end = dicom_tag(0xfffe, 0xe00d),
                   sequence_end = dicom_tag(0xfffe, 0xe0dd);
constexpr uint32_t undefined_length = 0xffffffff;
constexpr int deepest = 32;  ///< sequences in sequences; real files have a handful

/// Attributes that are read. Names of people are not among them.
constexpr uint32_t wanted[] = {
    dicom_tag(0x0002, 0x0002), dicom_tag(0x0002, 0x0010),  // kind, encoding
    dicom_tag(0x0008, 0x0005), dicom_tag(0x0008, 0x0018),
    dicom_tag(0x0008, 0x103e),  // characters, description
    dicom_tag(0x0018, 0x0050), dicom_tag(0x0018, 0x0088),
    dicom_tag(0x0018, 0x1164),  // thickness, distance
    dicom_tag(0x0020, 0x000e), dicom_tag(0x0020, 0x0011),
    dicom_tag(0x0020, 0x0013),  // series, instance
    dicom_tag(0x0020, 0x0032), dicom_tag(0x0020, 0x0037),
    dicom_tag(0x0020, 0x0100),                             // place, time
    dicom_tag(0x0020, 0x9128), dicom_tag(0x0020, 0x9056),  // time and stack of a frame
    dicom_tag(0x0028, 0x0002), dicom_tag(0x0028, 0x0004),
    dicom_tag(0x0028, 0x0006),  // pixels
    dicom_tag(0x0028, 0x0008), dicom_tag(0x0028, 0x0009),
    dicom_tag(0x0028, 0x0010), dicom_tag(0x0028, 0x0011),
    dicom_tag(0x0028, 0x0030), dicom_tag(0x0028, 0x0100),
    dicom_tag(0x0028, 0x0101), dicom_tag(0x0028, 0x0102),
    dicom_tag(0x0028, 0x0103), dicom_tag(0x0028, 0x0120),
    dicom_tag(0x0028, 0x0121), dicom_tag(0x0028, 0x1052),
    dicom_tag(0x0028, 0x1053), dicom_tag(0x0028, 0x1101),
    dicom_tag(0x0028, 0x1102),  // scale, palettes
    dicom_tag(0x0028, 0x1103), dicom_tag(0x0028, 0x1201),
    dicom_tag(0x0028, 0x1202), dicom_tag(0x0028, 0x1203),
    dicom_tag(0x0028, 0x1221), dicom_tag(0x3004, 0x000c),
    dicom_tag(0x3004, 0x000e),
};
/// Sequences whose items are read: what frames share, what each has, and in these place, orientation,
/// distances, scale and time; modality table (that there is one); detectors.
constexpr uint32_t wanted_sequences[] = {
    dicom_tag(0x5200, 0x9229), dicom_tag(0x5200, 0x9230), dicom_tag(0x0020, 0x9111),
    dicom_tag(0x0020, 0x9113), dicom_tag(0x0020, 0x9116), dicom_tag(0x0028, 0x9110),
    dicom_tag(0x0028, 0x9145), dicom_tag(0x0028, 0x3000), dicom_tag(0x0054, 0x0022),
};
constexpr uint32_t longest_value = 1 << 18;  // palettes have 128 KiB

bool is_pixels(uint32_t tag) {
  return tag == dicom_tag(0x7fe0, 0x0010) || tag == dicom_tag(0x7fe0, 0x0008) ||
         tag == dicom_tag(0x7fe0, 0x0009);
}

struct Damage {
  int64_t at;
  const char* rule;
};

uint32_t unsigned_number(std::string_view raw, bool big) {
  uint32_t value = 0;
  for (size_t i = 0; i < raw.size(); ++i)
    value |= uint32_t{static_cast<unsigned char>(raw[big ? raw.size() - 1 - i : i])} << (8 * i);
  return value;
}

/// Walks the elements of a file. Throws Damage, which parse_dicom turns into an error.
class Walker {
 public:
  explicit Walker(std::span<const std::byte> file)
      : file_(reinterpret_cast<const char*>(file.data()), file.size()),
        size_(static_cast<int64_t>(file.size())) {
    at_ = 132;
  }

  /// The elements of group 2, which name the encoding of the others.
  void meta(DicomContents& out) {
    while (at_ < size_) {
      const uint32_t group = read_number(2);
      at_ -= 2;
      if (group != 2) break;
      keep(element(), size_, out.data);
    }
    out.transfer_syntax = out.data.text(dicom_tag(0x0002, 0x0010));
    const std::string& syntax = out.transfer_syntax;
    implicit_ = syntax == "1.2.840.10008.1.2";
    big_endian_ = syntax == "1.2.840.10008.1.2.2";
    out.data.big_endian = big_endian_;
    out.encapsulated = !implicit_ && !big_endian_ && syntax != "1.2.840.10008.1.2.1";
  }

  /// The elements up to the pixels.
  void data_set(DicomContents& out) {
    while (at_ < size_ && out.pixels.empty()) {
      const Element e = element();
      if (is_pixels(e.tag)) {
        out.pixel_tag = e.tag;
        out.words = e.type == "OW" || implicit_;
        if (e.length != undefined_length) {
          check(e.length <= size_ - at_, "pixels lead past the end of the file");
          out.pixels.push_back({at_, e.length});
        } else {
          fragments(out);
        }
      } else {
        value(e, size_, 0, out.data);
      }
    }
  }

 private:
  struct Element {
    uint32_t tag = 0;
    std::string_view type;
    uint32_t length = 0;
  };

  void check(bool holds, const char* rule) const {
    if (!holds) throw Damage{at_, rule};
  }
  std::string_view bytes(int64_t count) {
    check(count <= size_ - at_, "an element leads past the end of the file");
    const std::string_view raw = file_.substr(static_cast<size_t>(at_), static_cast<size_t>(count));
    at_ += count;
    return raw;
  }
  uint32_t read_number(int64_t count) { return unsigned_number(bytes(count), big_endian_); }

  Element element() {
    Element e;
    const uint32_t group = read_number(2);
    e.tag = dicom_tag(group, read_number(2));
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

  /// Keeps a value that is wanted; passes over others.
  void keep(const Element& e, int64_t end, DicomData& out) {
    check(e.length <= end - at_, "an element leads past the end of the file");
    const std::string_view raw = bytes(e.length);
    if (e.length <= longest_value &&
        std::find(std::begin(wanted), std::end(wanted), e.tag) != std::end(wanted))
      out.values[e.tag] = raw;
  }

  /// The value of an element, be it a sequence.
  void value(const Element& e, int64_t end, int depth, DicomData& out) {
    const bool is_wanted = std::find(std::begin(wanted_sequences), std::end(wanted_sequences), e.tag) !=
                           std::end(wanted_sequences);
    if (e.length == undefined_length) {
      sequence(e.type == "UN", size_, depth, is_wanted ? &out.sequences[e.tag] : nullptr);
    } else if (is_wanted && (e.type == "SQ" || implicit_)) {
      check(e.length <= end - at_, "a sequence leads past the end of the file");
      sequence(false, at_ + e.length, depth, &out.sequences[e.tag]);
    } else {
      keep(e, end, out);
    }
  }

  /// The items of a sequence, up to `end` or its end mark.
  void sequence(bool of_implicit, int64_t end, int depth, std::vector<DicomData>* out) {
    check(depth < deepest, "sequences are nested too deep");
    const bool outside = implicit_;
    implicit_ = implicit_ || of_implicit;
    DicomData unwanted;
    while (at_ < end) {
      const Element item = element();
      if (item.tag == sequence_end) break;
      check(item.tag == item_tag, "expected an item of a sequence");
      const bool open = item.length == undefined_length;
      check(open || item.length <= size_ - at_, "an item leads past the end of the file");
      if (!open && !out) {
        at_ += item.length;
        continue;
      }
      const int64_t item_stop = open ? size_ : at_ + item.length;
      DicomData* const data = out ? &out->emplace_back() : &unwanted;
      data->big_endian = big_endian_;
      for (bool ended = false; !ended && (open || at_ < item_stop);) {
        const Element e = element();
        ended = open && e.tag == item_end;
        if (!ended) value(e, item_stop, depth + 1, *data);
      }
      unwanted = {};
    }
    implicit_ = outside;
  }

  /// Compressed pixels: a table of offsets, then the fragments.
  void fragments(DicomContents& out) {
    check(out.encapsulated, "pixels of undefined length");
    for (bool table = true;; table = false) {
      const Element item = element();
      if (item.tag == sequence_end) break;
      check(item.tag == item_tag && item.length <= size_ - at_, "a fragment leads past the end of the file");
      if (!table) {
        out.pixels.push_back({at_, item.length});
        at_ += item.length;
        continue;
      }
      for (const int64_t end = at_ + item.length; at_ < end && end - at_ >= 4;)
        out.frame_offsets.push_back(read_number(4));
    }
    check(!out.pixels.empty(), "no fragments of pixels");
  }

  std::string_view file_;
  int64_t size_ = 0, at_ = 0;
  bool implicit_ = false, big_endian_ = false;
};

}  // namespace

std::string DicomData::text(uint32_t tag) const {
  const auto it = values.find(tag);
  if (it == values.end()) return {};
  const auto padding = [](char c) { return c == ' ' || c == '\0'; };
  const auto first = std::find_if_not(it->second.begin(), it->second.end(), padding);
  const auto last = std::find_if_not(it->second.rbegin(), it->second.rend(), padding).base();
  return first < last ? std::string(first, last) : std::string();
}

std::optional<int> DicomData::number(uint32_t tag) const {
  const auto it = values.find(tag);
  if (it == values.end() || it->second.size() < 2) return std::nullopt;
  const size_t bytes = it->second.size() == 4 ? 4 : 2;
  const uint32_t value = unsigned_number(std::string_view(it->second).substr(0, bytes), big_endian);
  return value > INT32_MAX ? INT32_MAX : static_cast<int>(value);
}

std::optional<int> DicomData::signed_number(uint32_t tag) const {
  const auto value = number(tag);
  return value ? std::optional<int>(static_cast<int16_t>(*value)) : std::nullopt;
}

std::vector<double> DicomData::decimals(uint32_t tag, size_t count) const {
  const std::string all = text(tag);
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
  return count == 0 || numbers.size() == count ? numbers : std::vector<double>();
}

double DicomData::decimal(uint32_t tag, double otherwise) const {
  const auto one = decimals(tag, 1);
  return one.empty() ? otherwise : one[0];
}

std::vector<uint16_t> DicomData::words(uint32_t tag) const {
  const auto it = values.find(tag);
  std::vector<uint16_t> all;
  if (it == values.end()) return all;
  for (size_t i = 0; i + 2 <= it->second.size(); i += 2)
    all.push_back(
        static_cast<uint16_t>(unsigned_number(std::string_view(it->second).substr(i, 2), big_endian)));
  return all;
}

const std::vector<DicomData>& DicomData::items(uint32_t tag) const {
  static const std::vector<DicomData> none;
  const auto it = sequences.find(tag);
  return it == sequences.end() ? none : it->second;
}

const DicomData& DicomData::item(uint32_t tag) const {
  static const DicomData none;
  const auto& all = items(tag);
  return all.empty() ? none : all.front();
}

bool starts_as_dicom(std::span<const std::byte> file) {
  return file.size() >= 132 &&
         std::string_view(reinterpret_cast<const char*>(file.data()) + 128, 4) == "DICM";
}

Result<DicomContents> parse_dicom(std::span<const std::byte> file, const std::string& name) {
  DicomContents contents;
  try {
    Walker walker(file);
    walker.meta(contents);
    if (contents.transfer_syntax.empty()) return bad_input(name, "DICOM file without a transfer syntax");
    if (contents.transfer_syntax == "1.2.840.10008.1.2.1.99")
      return bad_input(name, "deflated DICOM file: expected another transfer syntax");
    walker.data_set(contents);
  } catch (const Damage& damage) {
    return bad_input(name, fmt::format("corrupt DICOM file: at byte {}: {}", damage.at, damage.rule));
  }
  return contents;
}

}  // namespace voxkit
