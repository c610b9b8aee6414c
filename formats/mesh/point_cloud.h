// Coloured points that are read front to back, any number of times, in bounded memory.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/result.h"

namespace voxkit {

/// A point in the unit of its file, and its colour as R, G, B in sRGB.
struct CloudPoint {
  glm::dvec3 at{0};
  std::array<uint8_t, 3> color{};
  uint8_t alpha = 255;
};

class PointCloud {
 public:
  virtual ~PointCloud() = default;
  /// As many as there are in the file.
  uint64_t size() const { return size_; }
  /// What of the file is left out, a sentence each.
  const std::vector<std::string>& notes() const { return notes_; }

  using Sink = std::function<Status(std::span<const CloudPoint>)>;
  /// Calls `sink` with the points, in runs, in their order: all but those with a coordinate that is not
  /// finite or an alpha below a half. ErrorCode::input where the file is damaged; `sink`'s errors.
  virtual Status read(const Sink& sink) const = 0;

 protected:
  uint64_t size_ = 0;
  std::vector<std::string> notes_;
};

/// The points of a .ply file: its vertices, which have x, y and z, and red, green and blue or no colours:
/// then they are white. Null of a file with faces, which is a mesh. ErrorCode::input: no such file, or it is
/// damaged as far as its header says.
Result<std::unique_ptr<const PointCloud>> open_ply_points(const std::string& path);

}  // namespace voxkit
