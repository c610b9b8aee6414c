// Names of the built-in volumes: "menger:5" to the source that computes it.
#include "formats/volume/builtin.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>
#include <vector>

#include "formats/volume/readers.h"

namespace voxkit {
namespace {

/// The decimal numbers in `text` between the separators of `pattern`: ("5:7", ":") gives 5, 7. Nothing where
/// `text` has another form or a number exceeds 64 bits.
std::optional<std::vector<uint64_t>> numbers(std::string_view text, std::string_view separators) {
  std::vector<uint64_t> values;
  const char* at = text.data();
  const char* const end = at + text.size();
  for (size_t i = 0; i <= separators.size(); ++i) {
    uint64_t value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc{}) return std::nullopt;
    values.push_back(value);
    at = next;
    if (i < separators.size() && (at == end || *at++ != separators[i])) return std::nullopt;
  }
  if (at != end) return std::nullopt;
  return values;
}

struct Builtin {
  std::string_view name;
  std::string_view form;        ///< for messages
  std::string_view separators;  ///< between the numbers after the name
  /// Null where the numbers are out of range.
  std::unique_ptr<VolumeSource> (*open)(const std::vector<uint64_t>& numbers);
};

/// Extents as given, or nothing where a volume cannot have them.
std::optional<Index3> extents(uint64_t x, uint64_t y, uint64_t z) {
  if (std::max({x, y, z}) > static_cast<uint64_t>(max_side)) return std::nullopt;
  const Index3 dims(static_cast<int64_t>(x), static_cast<int64_t>(y), static_cast<int64_t>(z));
  return checked_voxels(dims) ? std::optional(dims) : std::nullopt;
}
bool is_side(uint64_t n) {
  return extents(n, n, n).has_value();
}

using Numbers = std::vector<uint64_t>;
constexpr std::array builtins{
    Builtin{"menger", "menger:LEVEL with LEVEL 0 to 13", "",
            [](const Numbers& n) {
              return n[0] <= max_menger_level ? menger_source(static_cast<int>(n[0])) : nullptr;
            }},
    Builtin{"marschner-lobb", "marschner-lobb:N with N 2 to 1664510", "",
            [](const Numbers& n) {
              return n[0] >= 2 && is_side(n[0]) ? marschner_lobb_source(static_cast<int64_t>(n[0])) : nullptr;
            }},
    Builtin{
        "sphere", "sphere:N with N 1 to 1664510", "",
        [](const Numbers& n) { return is_side(n[0]) ? sphere_source(static_cast<int64_t>(n[0])) : nullptr; }},
    Builtin{"noise", "noise:N:SEED with N 1 to 1664510 and SEED a whole number", ":",
            [](const Numbers& n) {
              return is_side(n[0]) ? noise_source(static_cast<int64_t>(n[0]), n[1]) : nullptr;
            }},
    Builtin{"membrane",
            "membrane:X,Y,Z:SEED with X, Y, Z 1 to 2^31, 2^62 voxels at most, and SEED a whole number", ",,:",
            [](const Numbers& n) {
              const auto dims = extents(n[0], n[1], n[2]);
              return dims ? membrane_source(*dims, n[3]) : nullptr;
            }},
    Builtin{"cells", "cells:N:COUNT with N 1 to 1664510 and COUNT 1 to 65536", ":",
            [](const Numbers& n) {
              return is_side(n[0]) && n[1] >= 1 && n[1] <= most_cells
                         ? cells_source(static_cast<int64_t>(n[0]), static_cast<int64_t>(n[1]))
                         : nullptr;
            }},
};

const Builtin* find(std::string_view name) {
  const size_t colon = name.find(':');
  if (colon == std::string_view::npos) return nullptr;
  for (const Builtin& b : builtins) {
    if (b.name == name.substr(0, colon)) return &b;
  }
  return nullptr;
}

}  // namespace

bool is_builtin(const std::string& name) {
  return find(name) != nullptr;
}

SourceResult open_builtin(const std::string& name) {
  const Builtin* builtin = find(name);
  if (builtin == nullptr) return bad_usage(fmt::format("{}: no built-in volume has this name", name));
  std::unique_ptr<VolumeSource> source;
  if (const auto n = numbers(std::string_view(name).substr(builtin->name.size() + 1), builtin->separators)) {
    source = builtin->open(*n);
  }
  if (!source) return bad_usage(fmt::format("{}: not a built-in volume: expected {}", name, builtin->form));
  return source;
}

}  // namespace voxkit
