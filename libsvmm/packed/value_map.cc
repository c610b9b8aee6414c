#include "libsvmm/packed/value_map.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace voxkit::svmm {
namespace {

constexpr uint32_t sign = 0x80000000, first_step = 3;
constexpr double most_steps = 0x1p31;

/// Half a unit in the last place of the largest values is lost when a step becomes a float, at least half of
/// the least float, and a little in the arithmetic of doubles.
double rounding_of(ValueRange range) {
  const double largest = std::max(std::abs(range.lo), std::abs(range.hi));
  return std::max(std::ldexp(largest, -24), 0x1p-150) + std::ldexp(largest, -48);
}

}  // namespace

uint32_t ValueMap::ordered(float value) {
  const auto bits = std::bit_cast<uint32_t>(value);
  return bits & sign ? ~bits : bits | sign;
}

float ValueMap::from_ordered(uint32_t code) {
  return std::bit_cast<float>(code & sign ? code ^ sign : ~code);
}

uint32_t ValueMap::code(float value) const {
  if (kind == CodeKind::ordered) return ordered(value);
  if (std::isnan(value)) return 0;
  if (std::isinf(value)) return value < 0 ? 1 : 2;
  const double steps = std::round((static_cast<double>(value) - lo) / step);
  return first_step + static_cast<uint32_t>(std::clamp(steps, 0.0, most_steps));
}

float ValueMap::value(uint32_t code) const {
  if (kind == CodeKind::ordered) return from_ordered(code);
  constexpr float infinity = std::numeric_limits<float>::infinity();
  if (code < first_step)
    return code == 0 ? std::numeric_limits<float>::quiet_NaN() : code == 1 ? -infinity : infinity;
  constexpr double most = std::numeric_limits<float>::max();
  return static_cast<float>(std::clamp(lo + (code - first_step) * step, -most, most));
}

ValueMap ValueMap::for_floats(ValueRange range, double max_error) {
  ValueMap map;
  map.kind = CodeKind::ordered;
  const double step = 2 * (max_error - rounding_of(range)) * (1 - 0x1p-40);
  if (!(step > max_error) || (range.hi - range.lo) / step > most_steps) return map;
  return {CodeKind::steps, range.lo, step, {}};
}

ValueMap ValueMap::through_zero() const {
  return lo < 0 ? ValueMap{kind, -std::ceil(-lo / step) * step, step, {}} : *this;
}

double ValueMap::least_error(ValueRange range) {
  const double rounding = rounding_of(range);
  return std::max(2.01 * rounding, rounding + std::ldexp(range.hi - range.lo, -31));
}

int code_bytes(VoxelFormat format) {
  return format == VoxelFormat::float32 ? 4 : format == VoxelFormat::density16 ? 2 : 1;
}

}  // namespace voxkit::svmm
