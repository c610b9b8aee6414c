#include "formats/image/jp2_codestream.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace voxkit {
namespace {

using Bytes = std::span<const std::byte>;

enum Marker : uint32_t {
  start_of_codestream = 0xff4f,
  image_size = 0xff51,
  coding_style = 0xff52,
  tile_lengths = 0xff55,
  main_packet_lengths = 0xff57,
  packet_lengths = 0xff58,
  quantisation = 0xff5c,
  component_quantisation = 0xff5d,
  registration = 0xff63,
  comment = 0xff64,
  start_of_tile_part = 0xff90,
  start_of_data = 0xff93,
  end_of_codestream = 0xffd9,
};

tl::unexpected<Error> bad(const std::string& what) {
  return bad_input({}, what);
}

/// The big-endian number of so many bytes at `at`, which are there.
uint64_t number(Bytes bytes, size_t at, size_t size) {
  uint64_t value = 0;
  for (size_t i = 0; i < size; ++i) value = value << 8 | std::to_integer<uint64_t>(bytes[at + i]);
  return value;
}

constexpr uint32_t box_type(const char (&text)[5]) {
  uint32_t type = 0;
  for (int i = 0; i < 4; ++i) type = type << 8 | static_cast<uint8_t>(text[i]);
  return type;
}

/// Boxes, one after the other.
class Boxes {
 public:
  explicit Boxes(Bytes bytes) : left_(bytes) {}
  bool done() const { return left_.empty(); }
  uint32_t type = 0;
  Bytes contents;
  Status next() {
    if (left_.size() < 8) return bad("a box ends behind the file");
    uint64_t length = number(left_, 0, 4);
    size_t head = 8;
    type = static_cast<uint32_t>(number(left_, 4, 4));
    if (length == 1) {
      if (left_.size() < 16) return bad("a box ends behind the file");
      length = number(left_, 8, 8);
      head = 16;
    } else if (length == 0) {
      length = left_.size();
    }
    if (length < head || length > left_.size()) return bad("a box ends behind the file");
    contents = left_.subspan(head, length - head);
    left_ = left_.subspan(length);
    return {};
  }

 private:
  Bytes left_;
};

Status check_colors(Bytes header) {
  for (Boxes boxes(header); !boxes.done();) {
    VOX_CHECK(boxes.next());
    if (boxes.type == box_type("pclr") || boxes.type == box_type("cdef"))
      return bad("a palette or channels of another meaning: expected R, G and B");
    const bool enumerated =
        boxes.type == box_type("colr") && boxes.contents.size() >= 7 && boxes.contents[0] == std::byte{1};
    if (enumerated && number(boxes.contents, 3, 4) != 16) return bad("a color space other than sRGB");
  }
  return {};
}

Status check_size(Bytes segment, ImageSize size) {
  constexpr size_t fixed = 36;
  if (segment.size() < fixed || segment.size() != fixed + 3 * number(segment, 34, 2))
    return bad("marker SIZ: not its length");
  const auto field = [&](size_t at) { return static_cast<uint32_t>(number(segment, at, 4)); };
  if (field(2) != size.width || field(6) != size.height)
    return bad(fmt::format("{} x {} pixels: expected {} x {}", field(2), field(6), size.width, size.height));
  if (field(10) != 0 || field(14) != 0 || field(26) != 0 || field(30) != 0)
    return bad("marker SIZ: does not begin at 0, 0");
  if (field(18) < size.width || field(22) < size.height) return bad("more than one tile");
  if (number(segment, 34, 2) != 3)
    return bad(fmt::format("{} components: expected 3", number(segment, 34, 2)));
  for (size_t at = fixed; at < segment.size(); at += 3)
    if (number(segment, at, 3) != 0x070101) return bad("a component that is subsampled, or not of 8 bits");
  return {};
}

Status check_style(Bytes segment) {
  if (segment.size() < 10) return bad("marker COD: not its length");
  const auto field = [&](size_t at) { return std::to_integer<uint32_t>(segment[at]); };
  const uint32_t levels = field(5);
  const bool precincts = (field(0) & 1) != 0;
  if (segment.size() != 10 + (precincts ? levels + 1 : 0)) return bad("marker COD: not its length");
  const uint64_t layers = number(segment, 2, 2);
  if (layers < 1 || layers > 64) return bad(fmt::format("{} layers: expected 1 to 64", layers));
  if (levels > 10) return bad(fmt::format("{} levels: expected up to 10", levels));
  if (field(6) < 2 || field(7) < 2 || field(6) + field(7) > 8)
    return bad("code-blocks of a size that is not expected");
  if ((field(8) & 0xc0) != 0) return bad("code-blocks of another part of the standard");
  for (size_t at = 10; at < segment.size(); ++at)
    if ((field(at) & 15) < 5 || field(at) >> 4 < 5) return bad("precincts below 32 x 32");
  return {};
}

/// The markers of a codestream.
class Markers {
 public:
  explicit Markers(Bytes stream) : stream_(stream) {}

  Status check(ImageSize size) {
    VOX_TRY(uint32_t marker, next());
    if (marker != start_of_codestream) return bad("the codestream has no marker SOC");
    VOX_TRY(marker, next());
    if (marker != image_size) return bad("the codestream has no marker SIZ");
    VOX_TRY(Bytes body, segment());
    VOX_CHECK(check_size(body, size));
    bool styled = false;
    for (;;) {
      VOX_TRY(marker, next());
      if (marker == start_of_tile_part) break;
      VOX_TRY(body, segment());
      if (marker == coding_style) {
        VOX_CHECK(check_style(body));
        styled = true;
      } else if (marker != tile_lengths && marker != main_packet_lengths && marker != registration &&
                 !of_any_header(marker)) {
        return bad(fmt::format("marker {:04x} in the main header: not expected", marker));
      }
    }
    if (!styled) return bad("the codestream has no marker COD");
    while (marker == start_of_tile_part) {
      VOX_CHECK(tile_part());
      VOX_TRY(marker, next());
    }
    if (marker != end_of_codestream) return bad("the codestream has no marker EOC");
    return {};
  }

 private:
  static bool of_any_header(uint32_t marker) {
    return marker == quantisation || marker == component_quantisation || marker == comment;
  }

  Result<uint32_t> next() {
    if (stream_.size() - at_ < 2) return bad("the codestream is cut short");
    at_ += 2;
    return static_cast<uint32_t>(number(stream_, at_ - 2, 2));
  }
  /// The bytes of a marker's segment, without those of its length.
  Result<Bytes> segment() {
    if (stream_.size() - at_ < 2) return bad("the codestream is cut short");
    const size_t length = number(stream_, at_, 2);
    if (length < 2 || length > stream_.size() - at_) return bad("a marker's segment is cut short");
    const Bytes body = stream_.subspan(at_ + 2, length - 2);
    at_ += length;
    return body;
  }
  Status tile_part() {
    const size_t begin = at_ - 2;
    VOX_TRY(const Bytes head, segment());
    if (head.size() != 8 || number(head, 0, 2) != 0) return bad("marker SOT: not of the one tile");
    const uint64_t length = number(head, 2, 4);
    for (;;) {
      VOX_TRY(const uint32_t marker, next());
      if (marker == start_of_data) break;
      VOX_CHECK(segment());
      if (marker != packet_lengths && !of_any_header(marker))
        return bad(fmt::format("marker {:04x} in a tile-part: not expected", marker));
    }
    // Without a length it goes to the end, but for the marker EOC.
    const uint64_t end = length == 0 ? stream_.size() - 2 : begin + length;
    if (end < at_ || end > stream_.size()) return bad("marker SOT: a tile-part behind the end");
    at_ = end;
    return {};
  }

  Bytes stream_;
  size_t at_ = 0;
};

}  // namespace

Result<Bytes> jp2_codestream(Bytes file, ImageSize size) {
  constexpr std::array<uint8_t, 12> signature = {0, 0, 0, 12, 'j', 'P', ' ', ' ', 0x0d, 0x0a, 0x87, 0x0a};
  if (file.size() < signature.size() || !std::equal(signature.begin(), signature.end(), file.begin(),
                                                    [](uint8_t a, std::byte b) { return std::byte{a} == b; }))
    return bad("not a .jp2 file");
  for (Boxes boxes(file); !boxes.done();) {
    VOX_CHECK(boxes.next());
    if (boxes.type == box_type("jp2h")) VOX_CHECK(check_colors(boxes.contents));
    if (boxes.type != box_type("jp2c")) continue;
    VOX_CHECK(Markers(boxes.contents).check(size));
    return boxes.contents;
  }
  return bad("no codestream");
}

}  // namespace voxkit
