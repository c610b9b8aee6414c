// Transfer functions: what a value looks like.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "formats/result.h"
#include "formats/volume.h"

namespace voxkit::render {

/// Colour and opacity of a value, each 0..1. The opacity is that of a way of one smallest voxel edge.
struct TransferPoint {
  double value;
  std::array<double, 4> rgba;
};

/// Piecewise linear between points, constant outside them. Rays look values up in a table of equal steps
/// from the first to the last point, whatever the value's type.
class TransferFunction {
 public:
  static constexpr int entries = 4096;
  /// An entry of the table. `density` is -log2(1 - opacity), so that a way of n edges lets through
  /// 2^(-n density); 0 exactly where the opacity is.
  struct Entry {
    float rgb[3], density;
  };
  /// The density of what is opaque.
  static constexpr float opaque_density = 128;

  /// At least one point, values finite and in ascending order (two may be equal: a step), as stored: the
  /// volume's bias is part of them. What a reader of files checks.
  explicit TransferFunction(std::vector<TransferPoint> points);

  const std::vector<TransferPoint>& points() const { return points_; }
  /// The function itself, without the table.
  std::array<double, 4> operator()(double value) const;

  /// Of the table: entry min(max((value - first) * scale, 0), entries - 1), rounded down.
  float first() const { return first_; }
  float scale() const { return scale_; }
  const Entry* table() const { return table_.data(); }
  /// How far apart first and last point are; at least a millionth of the greater one, and 1e-34. Values that
  /// are further than the greatest float from the first one look like the last.
  float span() const { return span_; }
  /// Whether any value from lo to hi, rounding included, may have an opacity that is not 0. NaN: false.
  bool shows(float lo, float hi) const;

 private:
  int entry_of(float value) const;
  std::vector<TransferPoint> points_;
  std::vector<Entry> table_;
  std::vector<int> seen_;  ///< [i]: entries before i whose density is not 0
  float first_ = 0, scale_ = 0, span_ = 1;
};

/// The names of the presets, with commas between them.
std::string transfer_presets();
/// A preset over a range of stored values; nothing if there is none of that name.
std::optional<TransferFunction> transfer_preset(const std::string& name, const ValueRange& range);
/// Whether there is a preset of that name.
bool is_transfer_preset(const std::string& name);

/// Reads the points of a JSON file: {"points": [{"value": 1200, "rgba": [1, 0.9, 0.8, 0.5]}, ...]}, values
/// being those of the volume's file, in ascending order. Errors: ErrorCode::input.
Result<std::vector<TransferPoint>> read_transfer_file(const std::string& path);

}  // namespace voxkit::render
