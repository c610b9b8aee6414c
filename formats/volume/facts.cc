#include "formats/volume/facts.h"

#include <fmt/format.h>

#include <cmath>

namespace voxkit {
namespace {

/// A unit as factor * 10^power metres.
struct Length {
  int factor, power;
};
Length length_of(Unit unit) {
  switch (unit) {
    case Unit::centimetre:
      return {1, -2};
    case Unit::millimetre:
      return {1, -3};
    case Unit::micrometre:
      return {1, -6};
    case Unit::nanometre:
      return {1, -9};
    case Unit::angstrom:
      return {1, -10};
    case Unit::inch:
      return {254, -4};
    default:
      return {1, 0};
  }
}

Affine::Vector cross(const Affine::Vector& a, const Affine::Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double length(const Affine::Vector& v) {
  return std::hypot(v[0], v[1], v[2]);
}
bool is_zero(const Affine::Vector& v) {
  return v == Affine::Vector{};
}

/// Whether bytes are well-formed UTF-8.
bool is_utf8(std::string_view bytes) {
  for (size_t i = 0; i < bytes.size();) {
    const auto c = static_cast<unsigned char>(bytes[i]);
    const size_t more = c < 0x80                ? 0
                        : c >= 0xc2 && c < 0xe0 ? 1
                        : c >= 0xe0 && c < 0xf0 ? 2
                        : c >= 0xf0 && c < 0xf5 ? 3
                                                : 4;
    if (more == 4 || i + more >= bytes.size()) return false;
    for (size_t k = 1; k <= more; ++k)
      if ((static_cast<unsigned char>(bytes[i + k]) & 0xc0) != 0x80) return false;
    i += more + 1;
  }
  return true;
}

}  // namespace

std::string listed(const std::vector<std::string>& words) {
  std::string text;
  for (size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 == words.size() ? " and " : ", ") + words[i];
  return text;
}

std::vector<std::string> not_held(const VolumeInfo& info, const Holds& holds) {
  std::vector<std::string> what;
  const bool placed = info.affine != Affine{};
  if (placed && !holds.place) what.push_back("where the volume is");
  if (!info.affine.is_plain() && holds.place && !holds.directions) what.push_back("the directions of axes");
  if (info.world != World::unknown && !holds.world)
    what.push_back(fmt::format("the world {}", name(info.world)));
  if (info.unit != Unit::unknown && !holds.unit) what.push_back(fmt::format("the unit {}", name(info.unit)));
  if ((info.slope != 1 || info.intercept != 0) && !holds.scale && !is_color(info.format))
    what.push_back(fmt::format("the slope {} and the intercept {}", info.slope, info.intercept));
  if (info.is_labels && !holds.labels) what.push_back("that values are labels");
  if (info.fill && !holds.fill)
    what.push_back(fmt::format("that {} is the fill value",
                               info.format == VoxelFormat::float32 ? *info.fill : info.sample(*info.fill)));
  if (!info.description.empty() && !holds.description) what.push_back("the description");
  return what;
}

void note_dropped(const std::string& file, std::string_view format, const std::vector<std::string>& what,
                  Context& ctx) {
  if (!what.empty()) ctx.note(fmt::format("{}: {} cannot hold {}: dropped", file, format, listed(what)));
}

std::string text_field(std::string_view bytes) {
  bytes = bytes.substr(0, bytes.find('\0'));
  const bool utf8 = is_utf8(bytes);
  std::string text;
  for (const char c : bytes) {
    const auto code = static_cast<unsigned char>(c);
    if (code < ' ' || code == 0x7f) {
      text += ' ';
    } else if (code < 0x80 || utf8) {
      text += c;
    } else {
      text += static_cast<char>(0xc0 | code >> 6);
      text += static_cast<char>(0x80 | (code & 0x3f));
    }
  }
  const size_t first = text.find_first_not_of(' ');
  return first == text.npos ? "" : text.substr(first, text.find_last_not_of(' ') - first + 1);
}

std::string cut_text(const std::string& text, size_t most) {
  if (text.size() <= most) return text;
  while (most > 0 && (static_cast<unsigned char>(text[most]) & 0xc0) == 0x80) --most;
  return text.substr(0, most);
}

Affine in_unit(const Affine& affine, Unit from, Unit to) {
  const Length a = length_of(from), b = length_of(to);
  const int power = a.power - b.power;
  const double ten = std::pow(10.0, std::abs(power));
  const auto scaled = [&](double x) {
    x *= a.factor;
    x = power >= 0 ? x * ten : x / ten;
    return x / b.factor;
  };
  Affine moved = affine;
  for (Affine::Vector& axis : moved.axes)
    for (double& x : axis) x = scaled(x);
  for (double& x : moved.origin) x = scaled(x);
  return moved;
}

void complete_axes(Affine& affine, const Affine::Vector& steps) {
  auto& axes = affine.axes;
  for (size_t a = 0; a < 3; ++a) {
    if (!is_zero(axes[a])) continue;
    const Affine::Vector &next = axes[(a + 1) % 3], &last = axes[(a + 2) % 3];
    Affine::Vector normal{};
    if (!is_zero(next) && !is_zero(last)) {
      normal = cross(next, last);
    } else if (is_zero(next) && is_zero(last)) {
      normal[a] = 1;
    } else {
      // The axis of the world that is the least along the only one there is; of equals that of its number.
      const Affine::Vector& only = is_zero(next) ? last : next;
      size_t least = a;
      for (size_t b = 0; b < 3; ++b)
        if (std::abs(only[b]) < std::abs(only[least])) least = b;
      Affine::Vector side{};
      side[least] = 1;
      normal = cross(cross(only, side), only);
    }
    const double size = length(normal), step = steps[a] > 0 && std::isfinite(steps[a]) ? steps[a] : 1;
    for (size_t b = 0; b < 3; ++b) axes[a][b] = normal[b] / size * step + 0.0;
  }
}

}  // namespace voxkit
