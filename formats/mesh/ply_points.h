// Points with colours in PLY files.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "formats/output_file.h"
#include "formats/volume.h"

namespace voxkit {

/// A point, and its colour as R, G, B in sRGB.
struct ColoredPoint {
  std::array<double, 3> at;
  std::array<uint8_t, 3> color;
};

/// Whether places on a line between `from` and `to`, `step` apart, need to be doubles: where rounding to
/// floats would move one by more than 1/256 of a step.
bool needs_doubles(double from, double to, double step);

/// What points have beside places and colours: a property's name, its type (uchar, float …) and how many
/// bytes that has.
struct PlyProperty {
  std::string name, type;
  size_t bytes = 1;
};

/// Writes a binary little-endian PLY file of points: x, y, z as floats or doubles, red, green and blue as
/// bytes, and then whatever else they have.
class PlyPointWriter {
 public:
  /// `count` points will come, centres of voxels of `grid`, which a comment says (voxel_grid.h). Errors:
  /// those of OutputFile.
  static Result<PlyPointWriter> create(const std::string& path, const VolumeInfo& grid, uint64_t count,
                                       bool doubles, bool force, std::span<const PlyProperty> more = {});
  /// `more`: the bytes of what each point has beside, one point after the other, as files have them.
  Status add(std::span<const ColoredPoint> points, std::span<const std::byte> more = {});
  /// Completes the file; without it, it never appears.
  Status finish();

 private:
  PlyPointWriter(std::unique_ptr<OutputFile> out, bool doubles, size_t more_bytes)
      : out_(std::move(out)), doubles_(doubles), more_bytes_(more_bytes) {}
  std::unique_ptr<OutputFile> out_;
  bool doubles_;
  size_t more_bytes_;  ///< of a point
};

}  // namespace voxkit
