#include "formats/mesh/ply_points.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "formats/mesh/voxel_grid.h"

namespace voxkit {

bool needs_doubles(double from, double to, double step) {
  const double furthest = std::max(std::abs(from), std::abs(to));
  if (!(furthest <= std::numeric_limits<float>::max())) return true;
  // Floats have 24 bits; rounding moves a number by half of the last one at most.
  return std::ldexp(1, std::ilogb(std::max(furthest, 1e-300)) - 24) > std::abs(step) / 256;
}

Result<PlyPointWriter> PlyPointWriter::create(const std::string& path, const VolumeInfo& grid, uint64_t count,
                                              bool doubles, bool force, std::span<const PlyProperty> more) {
  VOX_TRY(auto out, OutputFile::create(path, force));
  std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment {2} {3}\nelement vertex {0}\nproperty {1} x\n"
      "property {1} y\nproperty {1} z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n",
      count, doubles ? "double" : "float", voxel_grid_name, voxel_grid_text(grid));
  size_t more_bytes = 0;
  for (const PlyProperty& property : more) {
    header += fmt::format("property {} {}\n", property.type, property.name);
    more_bytes += property.bytes;
  }
  header += "end_header\n";
  VOX_CHECK(out->write(std::as_bytes(std::span(header))));
  return PlyPointWriter(std::move(out), doubles, more_bytes);
}

Status PlyPointWriter::add(std::span<const ColoredPoint> points, std::span<const std::byte> more) {
  const size_t place_bytes = doubles_ ? 24 : 12;
  std::vector<std::byte> bytes(points.size() * (place_bytes + 3 + more_bytes_));
  std::byte* to = bytes.data();
  const std::byte* from = more.data();
  for (const ColoredPoint& point : points) {
    if (doubles_) {
      std::memcpy(to, point.at.data(), place_bytes);
    } else {
      const float at[3] = {static_cast<float>(point.at[0]), static_cast<float>(point.at[1]),
                           static_cast<float>(point.at[2])};
      std::memcpy(to, at, place_bytes);
    }
    std::memcpy(to + place_bytes, point.color.data(), 3);
    to += place_bytes + 3;
    if (more_bytes_ == 0) continue;
    std::memcpy(to, from, more_bytes_);
    to += more_bytes_;
    from += more_bytes_;
  }
  return out_->write(bytes);
}

Status PlyPointWriter::finish() {
  return out_->commit();
}

}  // namespace voxkit
