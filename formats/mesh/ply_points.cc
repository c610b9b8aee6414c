#include "formats/mesh/ply_points.h"

#include <fmt/format.h>

#include <cstring>
#include <vector>

namespace voxkit {

Result<PlyPointWriter> PlyPointWriter::create(const std::string& path, uint64_t count, bool force) {
  VOX_TRY(auto out, OutputFile::create(path, force));
  const std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty "
      "float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
      count);
  VOX_CHECK(out->write(std::as_bytes(std::span(header))));
  return PlyPointWriter(std::move(out));
}

Status PlyPointWriter::add(std::span<const ColoredPoint> points) {
  constexpr size_t point_bytes = 15;
  std::vector<std::byte> bytes(points.size() * point_bytes);
  std::byte* to = bytes.data();
  for (const ColoredPoint& point : points) {
    std::memcpy(to, point.at.data(), 12);
    std::memcpy(to + 12, point.color.data(), 3);
    to += point_bytes;
  }
  return out_->write(bytes);
}

Status PlyPointWriter::finish() {
  return out_->commit();
}

}  // namespace voxkit
