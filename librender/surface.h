// What the rays found as points in space: where the screen-space steps of shading start from.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "formats/copy.h"
#include "librender/camera.h"
#include "librender/frame.h"

namespace voxkit::render {

/// Rounds to a whole number of pixels; |x| < 4096.
inline int whole_pixels(float x) {
  return static_cast<int>(x + 4096.5f) - 4096;
}

/// A point for every pixel of a frame, relative to the eye, in world units.
class Surface {
 public:
  struct Point {
    glm::vec3 at;
    float distance;  ///< from the eye; infinite where nothing was hit
  };

  /// `voxel`: edge of a voxel in world units. The memory counts against ctx.memory.
  static Result<Surface> create(const Frame& frame, const Camera& camera, double voxel, Context& ctx);

  int width() const { return width_; }
  int height() const { return height_; }
  float voxel() const { return voxel_; }
  const RayGenerator& rays() const { return rays_; }
  /// The index of a pixel, in arrays of one value a pixel.
  size_t index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }
  bool inside(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }
  const Point& operator()(int x, int y) const { return points_[index(x, y)]; }
  static bool hit(const Point& point) { return point.distance < std::numeric_limits<float>::infinity(); }
  /// Edge of a pixel at a point, in world units.
  float pixel(const Point& point) const { return pixel_ * point.distance; }

 private:
  Surface(const Camera& camera, int width, int height, double voxel)
      : rays_(camera, width, height),
        width_(width),
        height_(height),
        pixel_(static_cast<float>(rays_.pixel_width())),
        voxel_(static_cast<float>(voxel)) {}

  RayGenerator rays_;
  int width_, height_;
  float pixel_, voxel_;
  std::unique_ptr<Buffer> buffer_;
  Point* points_ = nullptr;
};

}  // namespace voxkit::render
