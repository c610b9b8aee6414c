#include "formats/volume/dicom_header.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>

#include "formats/mapped_file.h"

namespace voxkit {
namespace {

constexpr uint32_t tag(uint32_t group, uint32_t element) {
  return dicom_tag(group, element);
}
constexpr uint32_t position_tag = tag(0x0020, 0x0032), orientation_tag = tag(0x0020, 0x0037),
                   spacing_tag = tag(0x0028, 0x0030), thickness_tag = tag(0x0018, 0x0050),
                   distance_tag = tag(0x0018, 0x0088), slope_tag = tag(0x0028, 0x1053),
                   intercept_tag = tag(0x0028, 0x1052), temporal_tag = tag(0x0020, 0x0100),
                   temporal_index_tag = tag(0x0020, 0x9128);
constexpr double most_frames = 1 << 24;

/// Takes the distances of pixels where they are some: two numbers above 0.
void take_spacing(const DicomData& data, uint32_t what, DicomFrame& frame) {
  if (data.text(what).empty()) return;
  auto found = data.decimals(what, 2);
  frame.odd_spacing = found.empty() || !(found[0] > 0 && found[1] > 0);
  if (!frame.odd_spacing) frame.pixel_spacing = std::move(found);
}

/// Takes the distance of slices, whose sign says a direction, before their thickness.
void take_thickness(const DicomData& data, DicomFrame& frame) {
  if (!data.text(thickness_tag).empty()) {
    const double thickness = data.decimal(thickness_tag, 0);
    frame.odd_thickness = !(thickness > 0);
    if (thickness > 0) frame.thickness = thickness;
  }
  if (!data.text(distance_tag).empty()) {
    const double distance = std::abs(data.decimal(distance_tag, 0));
    frame.odd_thickness = distance == 0;
    if (distance > 0) frame.thickness = distance;
  }
}

/// Takes what attributes, or items of sequences in them, say of a frame, in place of what was said before.
void take(const DicomData& data, DicomFrame& frame) {
  const auto numbers = [](const DicomData& from, uint32_t what, size_t count, std::vector<double>& to) {
    if (auto found = from.decimals(what, count); !found.empty()) to = std::move(found);
  };
  const auto& place = data.item(tag(0x0020, 0x9113));
  const auto& plane = data.item(tag(0x0020, 0x9116));
  const auto& measures = data.item(tag(0x0028, 0x9110));
  const auto& scale = data.item(tag(0x0028, 0x9145));
  const auto& content = data.item(tag(0x0020, 0x9111));
  for (const DicomData* from : {&data, &data.item(tag(0x0054, 0x0022)), &place, &plane, &measures}) {
    numbers(*from, position_tag, 3, frame.position);
    numbers(*from, orientation_tag, 6, frame.orientation);
    take_spacing(*from, spacing_tag, frame);
    take_thickness(*from, frame);
  }
  for (const DicomData* from : {&data, &scale}) {
    frame.slope = from->decimal(slope_tag, frame.slope);
    frame.intercept = from->decimal(intercept_tag, frame.intercept);
  }
  frame.time = data.decimal(temporal_tag, frame.time);
  if (const auto index = content.number(temporal_index_tag)) frame.time = *index;
}

/// UTF-8 of a text in the characters that a file says it uses; empty where they are none that we know.
std::string readable(const std::string& text, const std::string& characters) {
  const bool ascii = std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c < '\x7f'; });
  if (ascii || characters.find("192") != std::string::npos) return text;
  if (characters != "ISO_IR 100") return {};
  std::string out;
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 0x80) {
      out += c;
    } else {
      out += static_cast<char>(0xc0 | code >> 6);
      out += static_cast<char>(0x80 | (code & 0x3f));
    }
  }
  return out;
}

Result<std::shared_ptr<const DicomPalette>> palette_of(const DicomData& data, const std::string& path,
                                                       bool is_signed) {
  auto palette = std::make_shared<DicomPalette>();
  for (uint32_t c = 0; c < 3; ++c) {
    const auto table = data.words(tag(0x0028, 0x1101 + c));
    const auto entries = data.words(tag(0x0028, 0x1201 + c));
    if (data.has(tag(0x0028, 0x1221 + c)))
      return bad_input(path, "palette in segments: expected tables of all entries");
    if (table.size() != 3) return bad_input(path, "colours without a palette");
    const size_t count = table[0] == 0 ? 65536 : table[0];
    const bool bytes = table[2] == 8;  // packed two a word, or one
    const bool packed = bytes && entries.size() < count;
    if (entries.size() < (packed ? (count + 1) / 2 : count) || (table[2] != 8 && table[2] != 16))
      return bad_input(path, fmt::format("palette of {} entries of {} bits: its data are {} words", count,
                                         table[2], entries.size()));
    palette->colors.resize(count);
    palette->first = is_signed ? static_cast<int16_t>(table[1]) : table[1];
    for (size_t i = 0; i < count; ++i) {
      const unsigned word = packed ? entries[i / 2] >> (i % 2 * 8) & 0xff : entries[i];
      palette->colors[i][c] = static_cast<uint16_t>(bytes ? (word & 0xff) * 257 : word);
    }
  }
  return palette;
}

/// Where each frame lies.
Status place_frames(DicomHeader& h, const DicomContents& file) {
  const auto count = std::ssize(h.frames);
  if (!h.encapsulated) {
    const int64_t unit = h.bits_allocated == 1 ? h.columns * h.rows * h.samples : h.slice_bytes();
    for (int64_t i = 0; i < count; ++i) h.frames[static_cast<size_t>(i)].first = i * unit;
    return {};
  }
  const auto fragments = std::ssize(h.pixels);
  if (count == 1) {
    h.frames[0].fragments = fragments;
    return {};
  }
  if (fragments == count) {
    for (int64_t i = 0; i < count; ++i) h.frames[static_cast<size_t>(i)].first = i;
    return {};
  }
  if (std::ssize(file.frame_offsets) != count)
    return bad_input(h.path,
                     fmt::format("{} frames in {} fragments: expected a table of offsets, or a fragment "
                                 "for each",
                                 count, fragments));
  const int64_t base = h.pixels.front().offset;
  int64_t at = 0;
  for (int64_t i = 0; i < count; ++i) {
    const int64_t start = base + file.frame_offsets[static_cast<size_t>(i)];
    while (at < fragments && h.pixels[static_cast<size_t>(at)].offset < start) ++at;
    if (at == fragments || h.pixels[static_cast<size_t>(at)].offset != start || (i == 0 && at != 0) ||
        (i > 0 && at == h.frames[static_cast<size_t>(i - 1)].first))
      return bad_input(h.path, fmt::format("corrupt DICOM file: frame {} begins at no fragment", i));
    h.frames[static_cast<size_t>(i)].first = at;
  }
  for (int64_t i = 0; i < count; ++i) {
    DicomFrame& frame = h.frames[static_cast<size_t>(i)];
    frame.fragments = (i + 1 < count ? h.frames[static_cast<size_t>(i + 1)].first : fragments) - frame.first;
  }
  return {};
}

/// The places of frames that have none of their own: at offsets, or at one distance, along their normal.
void spread(const DicomData& data, std::vector<DicomFrame>& frames) {
  const std::vector<double> o = frames.front().orientation, start = frames.front().position;
  const bool own = std::any_of(frames.begin(), frames.end(), [&](auto& f) { return f.position != start; });
  if (frames.size() < 2 || own || start.empty() || o.empty()) return;
  std::vector<double> offsets = data.decimals(tag(0x3004, 0x000c), frames.size());
  const double distance = data.decimal(distance_tag, 0);
  if (offsets.empty() && distance != 0)
    for (size_t i = 0; i < frames.size(); ++i) offsets.push_back(static_cast<double>(i) * distance);
  if (offsets.empty()) {
    for (DicomFrame& frame : frames) frame.position.clear();
    return;
  }
  const double normal[3] = {o[1] * o[5] - o[2] * o[4], o[2] * o[3] - o[0] * o[5], o[0] * o[4] - o[1] * o[3]};
  for (size_t i = 0; i < frames.size(); ++i)
    for (size_t a = 0; a < 3; ++a)
      frames[i].position[a] = start[a] + (normal[a] == 0 ? 0 : normal[a] * (offsets[i] - offsets[0]));
}

}  // namespace

Result<std::optional<DicomHeader>> read_dicom_header(const std::string& path) {
  struct stat state {};
  if (stat(path.c_str(), &state) != 0 || !S_ISREG(state.st_mode) || state.st_size < 132) return std::nullopt;
  VOX_TRY(const auto mapped, MappedFile::open(path));
  if (!starts_as_dicom(mapped->bytes())) return std::nullopt;
  VOX_TRY(DicomContents file, parse_dicom(mapped->bytes(), path));
  const DicomData& data = file.data;
  const auto rows = data.number(tag(0x0028, 0x0010)), columns = data.number(tag(0x0028, 0x0011));
  if (!rows || !columns) return std::nullopt;
  DicomHeader h;
  h.path = path;
  h.transfer_syntax = file.transfer_syntax;
  h.rows = *rows;
  h.columns = *columns;
  h.series = data.text(tag(0x0020, 0x000e));
  h.instance_id = data.text(tag(0x0008, 0x0018));
  h.description = readable(data.text(tag(0x0008, 0x103e)), data.text(tag(0x0008, 0x0005)));
  h.photometric = data.text(tag(0x0028, 0x0004));
  h.samples = data.number(tag(0x0028, 0x0002)).value_or(1);
  h.planar = data.number(tag(0x0028, 0x0006)).value_or(0) == 1;
  h.bits_allocated = data.number(tag(0x0028, 0x0100)).value_or(0);
  h.bits_stored = data.number(tag(0x0028, 0x0101)).value_or(h.bits_allocated);
  h.high_bit = data.number(tag(0x0028, 0x0102)).value_or(h.bits_stored - 1);
  h.is_signed = data.number(tag(0x0028, 0x0103)).value_or(0) == 1;
  h.is_float = file.pixel_tag != 0 && file.pixel_tag != tag(0x7fe0, 0x0010);
  if (h.is_float) h.bits_stored = h.bits_allocated, h.high_bit = h.bits_allocated - 1;
  if (const auto padding =
          h.is_signed ? data.signed_number(tag(0x0028, 0x0120)) : data.number(tag(0x0028, 0x0120)))
    h.padding = *padding;
  h.padding_range = data.has(tag(0x0028, 0x0121));
  if (const auto one = data.decimals(tag(0x0020, 0x0013), 1); !one.empty() && std::abs(one[0]) < 1e15)
    h.instance = static_cast<int64_t>(one[0]);
  h.has_table = !data.items(tag(0x0028, 0x3000)).empty();
  h.big_endian = data.big_endian;
  h.encapsulated = file.encapsulated;
  h.pixels = std::move(file.pixels);
  if (h.pixels.empty()) return bad_input(path, "corrupt DICOM file: it ends before its pixels");
  if (h.big_endian && h.bits_allocated == 8 && file.words)
    return bad_input(path, "8-bit pixels in big-endian words: expected little endian");
  if (h.photometric == "PALETTE COLOR") {
    VOX_TRY(h.palette, palette_of(data, path, h.is_signed));
  }
  // A frame takes a bit for each pixel at least, or a fragment.
  const double frames = data.decimal(tag(0x0028, 0x0008), 1);
  int64_t held = 0;
  for (const FilePart& part : h.pixels) held += part.bytes;
  if (frames < 1 || frames > most_frames || frames != std::floor(frames) ||
      frames > static_cast<double>(h.encapsulated ? std::ssize(h.pixels) : 8 * held + 1))
    return bad_input(path,
                     fmt::format("file of {} frames: its {} bytes of pixels cannot hold them", frames, held));

  DicomFrame shared;
  const double scaling = data.decimal(tag(0x3004, 0x000e), 0);  // of doses
  take(data, shared);
  if (scaling != 0) shared.slope = scaling;
  if (shared.pixel_spacing.empty() && !shared.odd_spacing) take_spacing(data, tag(0x0018, 0x1164), shared);
  take(data.item(tag(0x5200, 0x9229)), shared);
  h.frames.assign(static_cast<size_t>(frames), shared);
  const auto& each = data.items(tag(0x5200, 0x9230));
  for (size_t i = 0; i < std::min(each.size(), h.frames.size()); ++i) take(each[i], h.frames[i]);
  h.has_time = data.has(temporal_tag) || std::any_of(each.begin(), each.end(), [](const DicomData& frame) {
                 return frame.item(tag(0x0020, 0x9111)).has(temporal_index_tag);
               });
  const auto pointer = data.words(tag(0x0028, 0x0009));
  h.frames_are_times = h.frames.size() > 1 && pointer.size() >= 2 && pointer[0] == 0x0018 &&
                       (pointer[1] == 0x1063 || pointer[1] == 0x1065);
  if (!h.frames_are_times) spread(data, h.frames);
  VOX_CHECK(place_frames(h, file));
  return h;
}

}  // namespace voxkit
