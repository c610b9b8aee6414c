#include "formats/affine.h"

#include <algorithm>
#include <cmath>

namespace voxkit {
namespace {

struct UnitName {
  std::string_view text;
  Unit unit;
};
// The first of each unit is its name.
constexpr UnitName unit_names[] = {
    {"m", Unit::metre},
    {"cm", Unit::centimetre},
    {"mm", Unit::millimetre},
    {"um", Unit::micrometre},
    {"nm", Unit::nanometre},
    {"angstrom", Unit::angstrom},
    {"inch", Unit::inch},
    {"meter", Unit::metre},
    {"metre", Unit::metre},
    {"meters", Unit::metre},
    {"metres", Unit::metre},
    {"centimeter", Unit::centimetre},
    {"centimetre", Unit::centimetre},
    {"millimeter", Unit::millimetre},
    {"millimetre", Unit::millimetre},
    {"millimeters", Unit::millimetre},
    {"millimetres", Unit::millimetre},
    {"micrometer", Unit::micrometre},
    {"micrometre", Unit::micrometre},
    {"micron", Unit::micrometre},
    {"microns", Unit::micrometre},
    {"\xc2\xb5m", Unit::micrometre},
    {"\xce\xbcm", Unit::micrometre},
    {"\xb5m", Unit::micrometre},
    {"\\u00b5m", Unit::micrometre},
    {"nanometer", Unit::nanometre},
    {"nanometre", Unit::nanometre},
    {"a", Unit::angstrom},
    {"\xc3\x85", Unit::angstrom},
    {"\xe2\x84\xab", Unit::angstrom},
    {"angstroms", Unit::angstrom},
    {"in", Unit::inch},
    {"inches", Unit::inch},
};

/// Signs of the axes of an anatomical world, as seen from RAS.
std::array<double, 3> signs(World world) {
  if (world == World::lps) return {-1, -1, 1};
  if (world == World::las) return {-1, 1, 1};
  return {1, 1, 1};
}

}  // namespace

std::string_view name(World world) {
  constexpr std::string_view names[] = {"unknown", "RAS",          "LPS",        "LAS",
                                        "scanner", "right-handed", "left-handed"};
  return names[static_cast<size_t>(world)];
}

std::string_view name(Unit unit) {
  for (const UnitName& entry : unit_names)
    if (entry.unit == unit) return entry.text;
  return "unknown";
}

std::optional<Unit> parse_unit(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  for (const UnitName& entry : unit_names)
    if (entry.text == lower || entry.text == text) return entry.unit;
  return std::nullopt;
}

double metres(Unit unit) {
  constexpr double lengths[] = {0, 1, 1e-2, 1e-3, 1e-6, 1e-9, 1e-10, 0.0254};
  return lengths[static_cast<size_t>(unit)];
}

Affine Affine::plain(const Vector& spacing, const Vector& origin) {
  Affine affine;
  for (size_t a = 0; a < 3; ++a) affine.axes[a][a] = spacing[a];
  affine.origin = origin;
  return affine;
}

Affine::Vector Affine::spacing() const {
  Vector lengths;
  for (size_t a = 0; a < 3; ++a) {
    const auto& [x, y, z] = axes[a];
    const int zeros = (x == 0) + (y == 0) + (z == 0);
    lengths[a] = zeros >= 2 ? std::abs(x + y + z) : std::sqrt(x * x + y * y + z * z);
  }
  return lengths;
}

bool Affine::is_plain() const {
  for (size_t a = 0; a < 3; ++a)
    for (size_t b = 0; b < 3; ++b)
      if (a == b ? !(axes[a][b] > 0) : axes[a][b] != 0) return false;
  return true;
}

double Affine::determinant() const {
  const auto& [a, b, c] = axes;
  return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) +
         a[2] * (b[0] * c[1] - b[1] * c[0]);
}

bool Affine::is_valid() const {
  const auto finite = [](const Vector& v) {
    return std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); });
  };
  if (!std::all_of(axes.begin(), axes.end(), finite) || !finite(origin)) return false;
  // Of axes brought to length 1: products of short ones may be too small for a double.
  const Vector lengths = spacing();
  Affine unit = *this;
  for (size_t a = 0; a < 3; ++a) {
    if (!(lengths[a] > 0) || !std::isfinite(lengths[a])) return false;
    for (double& x : unit.axes[a]) x /= lengths[a];
  }
  return std::abs(unit.determinant()) > 1e-9;
}

Affine::Vector Affine::place(const Vector& index) const {
  Vector at = origin;
  for (size_t a = 0; a < 3; ++a)
    for (size_t b = 0; b < 3; ++b)
      if (axes[a][b] != 0) at[b] += index[a] * axes[a][b];
  return at;
}

Affine Affine::moved_to(const Vector& index) const {
  Affine moved = *this;
  moved.origin = place(index);
  return moved;
}

Affine Affine::coarser(const Vector& factors) const {
  Affine affine = *this;
  for (size_t a = 0; a < 3; ++a)
    for (size_t b = 0; b < 3; ++b) {
      const double step = axes[a][b] * factors[a];
      if (axes[a][b] != 0) affine.origin[b] += (step - axes[a][b]) / 2;
      affine.axes[a][b] = step;
    }
  return affine;
}

Affine Affine::times(double factor) const {
  Affine scaled = *this;
  for (Vector& axis : scaled.axes)
    for (double& x : axis) x *= factor;
  for (double& x : scaled.origin) x *= factor;
  return scaled;
}

Affine in_world(const Affine& affine, World from, World to) {
  const auto of = signs(from), wanted = signs(to);
  Affine moved = affine;
  for (size_t b = 0; b < 3; ++b) {
    if (of[b] == wanted[b]) continue;
    for (Affine::Vector& axis : moved.axes) axis[b] = 0 - axis[b];  // no negative zeros
    moved.origin[b] = 0 - moved.origin[b];
  }
  return moved;
}

std::array<int, 3> nearest_axes(const Affine& affine) {
  constexpr std::array<int, 3> orders[] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  const Affine::Vector lengths = affine.spacing();
  std::array<int, 3> best = orders[0];
  double most = -1;
  for (const auto& order : orders) {
    double sum = 0;
    for (size_t a = 0; a < 3; ++a)
      if (lengths[a] > 0) sum += std::abs(affine.axes[a][static_cast<size_t>(order[a])]) / lengths[a];
    if (sum > most + 1e-9) most = sum, best = order;
  }
  return best;
}

std::string orientation(const Affine& affine, World world) {
  const auto partners = nearest_axes(affine);
  std::string code;
  for (size_t a = 0; a < 3; ++a) {
    const auto b = static_cast<size_t>(partners[a]);
    const bool up = affine.axes[a][b] >= 0;
    if (is_anatomical(world)) {
      const bool ras = up == (signs(world)[b] > 0);
      code += ras ? "RAS"[b] : "LPI"[b];
    } else {
      code += up ? '+' : '-';
      code += "xyz"[b];
    }
  }
  return code;
}

}  // namespace voxkit
