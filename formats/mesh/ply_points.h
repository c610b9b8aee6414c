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
  std::array<float, 3> at;
  std::array<uint8_t, 3> color;
};

/// Writes a binary little-endian PLY file of points: x, y, z as floats, red, green and blue as bytes.
class PlyPointWriter {
 public:
  /// `count` points will come. Errors: those of OutputFile.
  static Result<PlyPointWriter> create(const std::string& path, uint64_t count, bool force);
  Status add(std::span<const ColoredPoint> points);
  /// Completes the file; without it, it never appears.
  Status finish();

 private:
  explicit PlyPointWriter(std::unique_ptr<OutputFile> out) : out_(std::move(out)) {}
  std::unique_ptr<OutputFile> out_;
};

}  // namespace voxkit
