#include "librender/surface.h"

#include "formats/parallel.h"

namespace voxkit::render {

Result<Surface> Surface::create(const Frame& frame, const Camera& camera, double voxel, Context& ctx) {
  Surface surface(camera, frame.width, frame.height, voxel);
  VOX_TRY(surface.buffer_,
          Buffer::allocate(frame.pixels.size() * sizeof(Point), "the points that the rays hit", ctx));
  surface.points_ = reinterpret_cast<Point*>(surface.buffer_->data());
  VOX_CHECK(parallel_for(ctx, frame.height, [&](int64_t row) -> Status {
    const int y = static_cast<int>(row);
    for (int x = 0; x < frame.width; ++x) {
      const float distance = frame.pixels[surface.index(x, y)].distance;
      Point& point = surface.points_[surface.index(x, y)];
      point = {glm::vec3(0), distance};
      if (hit(point))
        point.at = glm::vec3(surface.rays_.direction(x + 0.5, y + 0.5) * static_cast<double>(distance));
    }
    return {};
  }));
  return surface;
}

}  // namespace voxkit::render
