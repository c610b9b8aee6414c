#include "formats/volume/stack_description.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "formats/volume/ome_description.h"

namespace voxkit {
namespace {

std::optional<double> real(std::string_view text) {
  double value = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || stop != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

/// Three numbers with blanks between them.
std::optional<std::array<double, 3>> reals(std::string_view text) {
  std::array<double, 3> values{};
  for (double& v : values) {
    const size_t end = std::min(text.find(' '), text.size());
    const auto one = real(text.substr(0, end));
    if (!one) return std::nullopt;
    v = *one;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return values;
}

std::optional<int64_t> count(std::string_view text) {
  int64_t value = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || stop != text.data() + text.size()) return std::nullopt;
  return value;
}

using Lines = std::map<std::string, std::string, std::less<>>;

/// Lines KEY=VALUE.
Lines lines_of(std::string_view text) {
  Lines lines;
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    if (line.ends_with('\r')) line.remove_suffix(1);
    const size_t equals = line.find('=');
    if (equals != line.npos) lines.emplace(line.substr(0, equals), line.substr(equals + 1));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

/// Pages run through `sizes`, those of z, c and t, the axis at place 0 of `order` the fastest.
void number_planes(StackDescription& said, const std::array<int, 3>& order,
                   std::span<const int64_t> directories) {
  const std::array<int64_t, 3> sizes{said.slices, said.channels, said.times};
  std::array<int64_t, 3> strides{};
  int64_t stride = 1;
  for (const int axis : order) {
    strides[static_cast<size_t>(axis)] = stride;
    stride *= sizes[static_cast<size_t>(axis)];
  }
  said.strides = strides;
  if (said.contiguous) return;
  for (int64_t t = 0; t < said.times; ++t)
    for (int64_t c = 0; c < said.channels; ++c)
      for (int64_t z = 0; z < said.slices; ++z) {
        const int64_t plane = z * strides[0] + c * strides[1] + t * strides[2];
        said.directory.push_back(directories[static_cast<size_t>(plane)]);
      }
}

/// The first line of a description, if it is text.
std::string text_line(std::string_view text) {
  std::string line;
  for (const char c : text.substr(0, 1000))
    line += static_cast<unsigned char>(c) < ' ' || c == '\x7f' ? ' ' : c;
  while (line.ends_with(' ')) line.pop_back();
  return line;
}

bool is_utf8(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto c = static_cast<unsigned char>(text[i]);
    const size_t more = c < 0x80 ? 0 : c >> 5 == 6 ? 1 : c >> 4 == 14 ? 2 : c >> 3 == 30 ? 3 : 9;
    if (more >= text.size() - i) return false;
    for (size_t k = 1; k <= more; ++k)
      if ((static_cast<unsigned char>(text[i + k]) & 0xc0) != 0x80) return false;
    i += more + 1;
  }
  return true;
}

Result<StackDescription> describe_imagej(const std::string& file, const Lines& lines,
                                         std::span<const int64_t> directories) {
  StackDescription said;
  const auto value = [&](std::string_view key) -> std::string_view {
    const auto it = lines.find(key);
    return it == lines.end() ? std::string_view() : std::string_view(it->second);
  };
  const auto wrong = [&](const std::string& why) { return bad_input(file, "ImageJ description: " + why); };
  const auto there = std::ssize(directories);
  const auto extent = [&](std::string_view key) { return count(value(key)).value_or(1); };
  constexpr int64_t most = int64_t{1} << 31;
  for (const char* key : {"images", "slices", "channels", "frames"})
    if (extent(key) < 1 || extent(key) > most)
      return wrong(fmt::format("{}={}: expected a number from 1 up", key, value(key)));
  int64_t images = count(value("images")).value_or(there);
  // A composite image of one directory that has several channels in each pixel says so, too.
  said.contiguous = there == 1 && images > 1;
  if (!said.contiguous && images != there) {
    if (!value("images").empty())
      return wrong(fmt::format("{} images: the file has {} pages", images, there));
    images = there;
  }
  said.channels = extent("channels");
  said.times = extent("frames");
  said.slices = count(value("slices")).value_or(0);
  if (said.slices == 0)
    said.slices = std::max<int64_t>(1, images / said.channels / said.times);  // both at most 2^31
  if (said.slices > images || said.channels > images / said.slices ||
      said.times != images / (said.slices * said.channels) ||
      said.slices * said.channels * said.times != images)
    return wrong(fmt::format("{} slices, {} channels and {} frames are not {} images", said.slices,
                             said.channels, said.times, images));
  number_planes(said, {1, 0, 2}, directories);

  if (const auto spacing = real(value("spacing")); spacing && *spacing != 0)
    said.spacing[2] = std::abs(*spacing);
  if (const auto unit = value("unit"); !unit.empty() && unit != "pixel" && unit != "pixels") {
    said.unit = parse_unit(unit);
    if (!said.unit) {
      said.unit = Unit::unknown;
      said.notes.push_back(fmt::format("its unit {} is none of those that are kept", unit));
    }
  } else if (!unit.empty()) {
    said.unit = Unit::unknown;
  }
  const char* origins[] = {"xorigin", "yorigin", "zorigin"};
  for (size_t a = 0; a < 3; ++a)
    if (const auto origin = real(value(origins[a]))) said.origin_index[a] = *origin;
  if (const auto function = value("cf"); !function.empty()) {
    const auto c0 = real(value("c0")), c1 = real(value("c1"));
    if (function == "0" && c0 && c1 && *c1 != 0)
      said.intercept = *c0, said.slope = *c1;
    else
      said.notes.emplace_back("its calibration of values is not a straight line: dropped");
  }
  if (!value("finterval").empty() || (!value("fps").empty() && said.times > 1))
    said.notes.emplace_back("the interval of its frames is dropped");
  // Lines of our own.
  if (const auto text = value("voxkit_description"); is_utf8(text)) said.text = text;
  said.is_labels = value("voxkit_labels") == "1";
  if (const auto exact = reals(value("voxkit_spacing")))
    for (size_t a = 0; a < 3; ++a)
      if ((*exact)[a] > 0) said.spacing[a] = (*exact)[a];
  said.origin = reals(value("voxkit_origin"));
  for (int w = 0; w <= static_cast<int>(World::left_handed); ++w)
    if (name(static_cast<World>(w)) == value("voxkit_world")) said.world = static_cast<World>(w);
  return said;
}

/// {"shape": [5, 20, 24], "axes": "ZYX"}: the pages of tifffile, with the numbers of a list.
Result<StackDescription> describe_shape(const std::string& file, std::string_view text,
                                        std::span<const int64_t> directories) {
  StackDescription said;
  const size_t open = text.find('['), close = text.find(']', open);
  if (open == text.npos || close == text.npos) return said;
  std::vector<int64_t> shape;
  for (std::string_view rest = text.substr(open + 1, close - open - 1); !rest.empty();) {
    const size_t comma = std::min(rest.find(','), rest.size());
    std::string_view word = rest.substr(0, comma);
    word.remove_prefix(std::min(word.find_first_not_of(' '), word.size()));
    shape.push_back(count(word.substr(0, word.find_last_not_of(' ') + 1)).value_or(0));
    rest.remove_prefix(std::min(comma + 1, rest.size()));
  }
  std::string axes;
  if (const size_t key = text.find("\"axes\""); key != text.npos) {
    const size_t quote = text.find('"', text.find(':', key)), end = text.find('"', quote + 1);
    if (quote != text.npos && end != text.npos) axes = text.substr(quote + 1, end - quote - 1);
  }
  const bool truncated = text.find("\"truncated\": true") != text.npos;  // all follows the first directory
  // Axes of whole pages come before those of a page.
  std::vector<std::pair<char, int64_t>> planes;
  const auto there = std::ssize(directories);
  if (axes.size() == shape.size()) {
    for (size_t i = 0; i < axes.size(); ++i)
      if (axes[i] != 'Y' && axes[i] != 'X' && axes[i] != 'S') planes.emplace_back(axes[i], shape[i]);
  } else if (truncated) {
    for (size_t i = 0; i + 2 < shape.size(); ++i) planes.emplace_back('?', shape[i]);
  } else {
    int64_t product = 1;
    for (size_t i = 0; i < shape.size() && product < there; ++i) {
      planes.emplace_back('?', shape[i]);
      if (shape[i] < 1 || __builtin_mul_overflow(product, shape[i], &product)) return said;
    }
  }
  std::erase_if(planes, [](const auto& plane) { return plane.second == 1; });
  int64_t images = 1;
  for (const auto& [letter, size] : planes)
    if (size < 1 || __builtin_mul_overflow(images, size, &images) || images > INT32_MAX) return said;
  said.contiguous = there == 1 && images > 1 && truncated;
  if (images != there && !said.contiguous) return said;  // of another series of the file
  if (planes.size() > 3)
    return bad_input(file, fmt::format("{} axes of pages: expected slices, channels and time steps at most",
                                       planes.size()));
  // Without letters the last axis is that of the slices, before it channels, then time.
  std::array<int, 3> order{};
  std::array<bool, 3> used{};
  said.slices = 1;
  size_t at = 0;
  for (size_t i = planes.size(); i-- > 0;) {
    const auto [letter, size] = planes[i];
    int axis = letter == 'Z' ? 0 : letter == 'C' ? 1 : letter == 'T' ? 2 : -1;
    for (int a = 0; axis < 0 && a < 3; ++a)
      if (!used[static_cast<size_t>(a)]) axis = a;
    if (used[static_cast<size_t>(axis)]) return bad_input(file, "axes \"" + axes + "\": one comes twice");
    used[static_cast<size_t>(axis)] = true;
    (axis == 0 ? said.slices : axis == 1 ? said.channels : said.times) = size;
    order[at++] = axis;
  }
  for (int a = 0; a < 3; ++a)
    if (!used[static_cast<size_t>(a)]) order[at++] = a;
  number_planes(said, order, directories);
  return said;
}

}  // namespace

Result<StackDescription> describe_stack(const std::string& file, const std::string& text,
                                        std::span<const int64_t> directories, int64_t samples,
                                        const OpenOptions& options) {
  if (text.starts_with("ImageJ=")) return describe_imagej(file, lines_of(text), directories);
  if (is_ome(text)) return describe_ome(file, text, directories, samples, options);
  if (text.starts_with("{\"shape\"")) return describe_shape(file, text, directories);
  StackDescription said;
  const std::string line = text_line(text);
  if (is_utf8(line))
    said.text = line;
  else
    said.notes.emplace_back("its description is not UTF-8: dropped");
  return said;
}

std::string stack_description(const VolumeInfo& info) {
  const bool scaled = info.slope != 1 || info.intercept != 0;
  if (info.affine == Affine{} && info.unit == Unit::unknown && info.world == World::unknown && !scaled &&
      !info.is_labels && info.description.empty())
    return {};
  const auto spacing = info.affine.spacing();
  std::string text = fmt::format("ImageJ=1.53t\nimages=1\nspacing={}\n", spacing[2]);
  if (info.unit != Unit::unknown) text += fmt::format("unit={}\n", name(info.unit));
  if (scaled && !is_color(info.format))
    text += fmt::format("cf=0\nc0={}\nc1={}\n", info.intercept, info.slope);
  text += fmt::format("voxkit_spacing={} {} {}\n", spacing[0], spacing[1], spacing[2]);
  if (info.affine.is_plain()) {
    const auto& o = info.affine.origin;
    if (o != Affine::Vector{})
      text += fmt::format("xorigin={}\nyorigin={}\nzorigin={}\nvoxkit_origin={} {} {}\n", -o[0] / spacing[0],
                          -o[1] / spacing[1], -o[2] / spacing[2], o[0], o[1], o[2]);
    if (info.world != World::unknown) text += fmt::format("voxkit_world={}\n", name(info.world));
  }
  if (info.is_labels) text += "voxkit_labels=1\n";
  if (!info.description.empty()) {
    std::string line = info.description;
    for (char& c : line)
      if (static_cast<unsigned char>(c) < ' ') c = ' ';
    text += fmt::format("voxkit_description={}\n", line);
  }
  return text;
}

}  // namespace voxkit
