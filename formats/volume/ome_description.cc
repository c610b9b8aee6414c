#include "formats/volume/ome_description.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <set>

#include "formats/volume/parts.h"

namespace voxkit {
namespace {

constexpr std::string_view space = " \t\r\n";
constexpr int64_t most_planes = int64_t{1} << 31;

/// The character of a code point, as UTF-8.
std::string utf8(uint32_t code) {
  std::string text;
  const auto add = [&](uint32_t byte) { text += static_cast<char>(byte); };
  if (code < 0x80) {
    add(code);
  } else if (code < 0x800) {
    add(0xc0 | code >> 6), add(0x80 | (code & 0x3f));
  } else if (code < 0x10000) {
    add(0xe0 | code >> 12), add(0x80 | (code >> 6 & 0x3f)), add(0x80 | (code & 0x3f));
  }
  return text;
}

/// Replaces &amp; &#181; and the like.
std::string decoded(std::string_view raw) {
  std::string text;
  while (!raw.empty()) {
    const size_t end = raw.find(';');
    if (raw[0] != '&' || end == raw.npos || end > 10) {
      text += raw[0];
      raw.remove_prefix(1);
      continue;
    }
    const std::string_view name = raw.substr(1, end - 1);
    constexpr std::pair<std::string_view, char> known[] = {
        {"amp", '&'}, {"lt", '<'}, {"gt", '>'}, {"quot", '"'}, {"apos", '\''}};
    for (const auto& [word, character] : known)
      if (name == word) text += character;
    if (name.starts_with('#')) {
      const bool hex = name.size() > 1 && (name[1] == 'x' || name[1] == 'X');
      const std::string_view digits = name.substr(hex ? 2 : 1);
      uint32_t code = 0;
      const auto [stop, error] =
          std::from_chars(digits.data(), digits.data() + digits.size(), code, hex ? 16 : 10);
      if (error == std::errc() && stop == digits.data() + digits.size()) text += utf8(code);
    }
    raw.remove_prefix(end + 1);
  }
  return text;
}

using Attributes = std::map<std::string, std::string, std::less<>>;

/// One tag of XML: its name without a prefix, and what it says.
struct Element {
  std::string name;
  bool closing = false;
  Attributes attributes;

  std::string text(std::string_view key) const {
    const auto it = attributes.find(key);
    return it == attributes.end() ? std::string() : it->second;
  }
  std::optional<int64_t> integer(std::string_view key) const {
    const std::string raw = text(key);
    int64_t value = 0;
    const auto [stop, error] = std::from_chars(raw.data(), raw.data() + raw.size(), value);
    if (raw.empty() || error != std::errc() || stop != raw.data() + raw.size()) return std::nullopt;
    return value;
  }
};

/// The tags of a text, one after the other. What is no tag (text, comments, declarations) is passed over.
class Tags {
 public:
  explicit Tags(std::string_view text) : text_(text) {}

  std::optional<Element> next() {
    for (;;) {
      at_ = text_.find('<', at_);
      if (at_ == text_.npos || ++at_ == text_.size()) return std::nullopt;
      if (text_.substr(at_).starts_with("!--")) {
        at_ = std::min(text_.find("-->", at_), text_.size());
        continue;
      }
      if (text_[at_] != '?' && text_[at_] != '!') break;
    }
    Element element;
    if (text_[at_] == '/') element.closing = true, ++at_;
    const size_t name_end = std::min(text_.find_first_of(" \t\r\n/>", at_), text_.size());
    std::string_view name = text_.substr(at_, name_end - at_);
    if (const size_t colon = name.rfind(':'); colon != name.npos) name.remove_prefix(colon + 1);
    element.name = name;
    at_ = name_end;
    for (;;) {
      at_ = std::min(text_.find_first_not_of(" \t\r\n/", at_), text_.size());
      if (at_ == text_.size() || text_[at_] == '>') return element;
      const size_t equals = text_.find('=', at_);
      if (equals == text_.npos) return element;
      std::string_view key = text_.substr(at_, equals - at_);
      key = key.substr(0, key.find_last_not_of(space) + 1);
      const size_t quote = text_.find_first_not_of(space, equals + 1);
      if (quote == text_.npos || (text_[quote] != '"' && text_[quote] != '\'')) {
        at_ = equals + 1;
        return element;
      }
      const size_t end = text_.find(text_[quote], quote + 1);
      if (end == text_.npos) return element;
      element.attributes.emplace(key, decoded(text_.substr(quote + 1, end - quote - 1)));
      at_ = end + 1;
    }
  }
  /// The text up to the next tag.
  std::string content() const {
    if (at_ >= text_.size() || text_[at_] != '>') return {};
    const size_t end = std::min(text_.find('<', at_), text_.size());
    return decoded(text_.substr(at_ + 1, end - at_ - 1));
  }

 private:
  std::string_view text_;
  size_t at_ = 0;
};

struct TiffData {
  std::optional<int64_t> directory, count;
  int64_t first_z = 0, first_c = 0, first_t = 0;
  std::string file;  ///< its identifier, or its name
};

struct Image {
  Element pixels;
  std::vector<TiffData> data;
  int64_t samples = 0, channels = 0;  ///< samples of all channels, and channels, that are written down
};

struct Document {
  std::vector<Image> images;
  std::string metadata_file;
};

Document parse(std::string_view text) {
  Document document;
  Tags tags(text);
  while (const auto element = tags.next()) {
    if (element->name == "BinaryOnly") document.metadata_file = element->text("MetadataFile");
    if (element->closing) continue;
    if (element->name == "Pixels") {
      document.images.emplace_back().pixels = *element;
      continue;
    }
    if (document.images.empty()) continue;
    Image& image = document.images.back();
    if (element->name == "Channel") {
      ++image.channels;
      image.samples += std::clamp<int64_t>(element->integer("SamplesPerPixel").value_or(1), 1, 65535);
    } else if (element->name == "TiffData") {
      image.data.push_back({element->integer("IFD"),
                            element->integer("PlaneCount"),
                            element->integer("FirstZ").value_or(0),
                            element->integer("FirstC").value_or(0),
                            element->integer("FirstT").value_or(0),
                            {}});
    } else if (element->name == "UUID" && !image.data.empty()) {
      std::string name = element->text("FileName");
      image.data.back().file = name.empty() ? tags.content() : name;
    }
  }
  return document;
}

/// The lengths that an attribute and its unit say.
void take_spacing(const Image& image, StackDescription& said) {
  for (size_t a = 0; a < 3; ++a) {
    const std::string key = fmt::format("PhysicalSize{}", "XYZ"[a]);
    const std::string raw = image.pixels.text(key);
    double value = 0;
    const auto [stop, error] = std::from_chars(raw.data(), raw.data() + raw.size(), value);
    if (raw.empty() || error != std::errc() || stop != raw.data() + raw.size() || !(value > 0) ||
        !std::isfinite(value))
      continue;
    const std::string word = image.pixels.text(key + "Unit");
    const std::optional<Unit> unit = word.empty() ? Unit::micrometre : parse_unit(word);
    if (!unit) {
      if (word != "pixel" && word != "reference frame")
        said.notes.push_back(fmt::format("its unit {} is none of those that are kept", word));
      said.spacing[a] = value;
      continue;
    }
    if (!said.unit) said.unit = *unit;
    said.spacing[a] = *unit == *said.unit ? value : value * (metres(*unit) / metres(*said.unit));
  }
}

}  // namespace

bool is_ome(std::string_view text) {
  const size_t first = text.find_first_not_of(space);
  if (first == text.npos || text[first] != '<') return false;
  const std::string_view head = text.substr(first, 4096);
  return head.find("<OME") != head.npos || head.find(":OME") != head.npos;
}

Result<StackDescription> describe_ome(const std::string& file, std::string_view text,
                                      std::span<const int64_t> directories, int64_t samples,
                                      const OpenOptions& options) {
  const Document document = parse(text);
  const auto wrong = [&](const std::string& why) { return bad_input(file, "OME-XML: " + why); };
  if (!document.metadata_file.empty())
    return wrong(fmt::format("it is in another file, {}: expected it in this one", document.metadata_file));
  if (document.images.empty()) return wrong("no Pixels: expected one image at least");
  StackDescription said;
  std::optional<int64_t> asked;
  if (!options.series.empty()) {
    int64_t number = 0;
    const char* const end = options.series.data() + options.series.size();
    const auto [stop, error] = std::from_chars(options.series.data(), end, number);
    if (error != std::errc() || stop != end) return wrong("--series: expected the number of an image");
    asked = number;
  }
  VolumeInfo info;
  VOX_TRY(
      const auto chosen,
      choose_parts(file, {{"--series", "images of OME", std::ssize(document.images), asked}}, options, info));
  said.parts = info.parts;
  const Image& image = document.images[static_cast<size_t>(chosen[0])];

  std::set<std::string> files;
  for (const TiffData& data : image.data)
    if (!data.file.empty()) files.insert(data.file);
  if (files.size() > 1)
    return wrong(fmt::format("the volume is spread over {} files, as {}: expected one file", files.size(),
                             *files.begin()));
  const auto size = [&](std::string_view key) { return image.pixels.integer(key).value_or(1); };
  said.slices = size("SizeZ");
  said.times = size("SizeT");
  const int64_t all_samples = size("SizeC");
  // Samples of a pixel are channels of OME, too: those of one directory.
  const bool interleaved =
      samples > 1 && all_samples % samples == 0 &&
      (image.channels == 0 || image.samples > image.channels || image.samples == image.channels);
  said.channels = interleaved ? all_samples / samples : all_samples;
  const int64_t planes_there = std::ssize(directories);
  for (const int64_t side : {said.slices, said.channels, said.times})
    if (side < 1 || side > most_planes)
      return wrong(fmt::format("{} x {} x {} planes: expected extents from 1 up", said.slices, said.channels,
                               said.times));
  if (said.slices > planes_there || said.channels > planes_there / said.slices ||
      said.times > planes_there / (said.slices * said.channels))
    return wrong(fmt::format("{} slices, {} channels and {} time steps: the file has {} pages for them",
                             said.slices, said.channels, said.times, planes_there));

  const std::string order = image.pixels.text("DimensionOrder");
  std::array<size_t, 3> axes{0, 1, 2};  // of z, c, t: the place of each in the order, fastest first
  if (!order.empty()) {
    const std::string_view letters = std::string_view(order).substr(std::min<size_t>(order.size(), 2));
    const std::array<size_t, 3> at{letters.find('Z'), letters.find('C'), letters.find('T')};
    if (order.size() != 5 || !order.starts_with("XY") || at[0] > 2 || at[1] > 2 || at[2] > 2)
      return wrong(fmt::format("DimensionOrder {}: expected XY and an order of Z, C and T", order));
    axes = at;
  } else {
    axes = {1, 0, 2};
  }
  const std::array<int64_t, 3> sizes{said.slices, said.channels, said.times};
  const int64_t planes = said.slices * said.channels * said.times;
  std::array<int64_t, 3> strides{};  // of z, c, t in the order of planes
  for (size_t a = 0; a < 3; ++a) {
    strides[a] = 1;
    for (size_t b = 0; b < 3; ++b)
      if (axes[b] < axes[a]) strides[a] *= sizes[b];
  }
  said.directory.assign(static_cast<size_t>(planes), -1);
  const auto place = [&](int64_t plane, int64_t directory) {
    const int64_t z = plane / strides[0] % sizes[0], c = plane / strides[1] % sizes[1],
                  t = plane / strides[2] % sizes[2];
    said.directory[static_cast<size_t>((t * said.channels + c) * said.slices + z)] = directory;
  };
  std::vector<TiffData> data = image.data;
  if (data.empty()) data.emplace_back();
  for (const TiffData& d : data) {
    if (d.first_z < 0 || d.first_z >= sizes[0] || d.first_c < 0 || d.first_c >= all_samples ||
        d.first_t < 0 || d.first_t >= sizes[2])
      return wrong("TiffData of a plane outside of the image");
    const int64_t channel = interleaved ? d.first_c / samples : d.first_c;
    const int64_t first = d.first_z * strides[0] + channel * strides[1] + d.first_t * strides[2];
    int64_t count = d.count.value_or(d.directory ? 1 : planes - first);
    count = std::clamp<int64_t>(count, 0, planes - first);
    for (int64_t i = 0; i < count; ++i) {
      // Without a number the pages count, with one the directories.
      const bool numbered = d.directory && *d.directory >= 0 && *d.directory < INT32_MAX;
      const int64_t wanted = i + (numbered ? *d.directory : 0);
      if (numbered) {
        if (!std::binary_search(directories.begin(), directories.end(), wanted))
          return wrong(fmt::format("TiffData of directory {}: the file has no such page", wanted));
        place(first + i, wanted);
      } else if (wanted < planes_there) {
        place(first + i, directories[static_cast<size_t>(wanted)]);
      }
    }
  }
  const auto missing = std::find(said.directory.begin(), said.directory.end(), -1);
  if (missing != said.directory.end()) {
    const int64_t at = missing - said.directory.begin();
    return wrong(fmt::format("no page for slice {} of channel {} at time {}", at % said.slices,
                             at / said.slices % said.channels, at / (said.slices * said.channels)));
  }
  take_spacing(image, said);
  said.notes.emplace_back("of its OME-XML the order of planes and the physical size are kept, no more");
  return said;
}

}  // namespace voxkit
