// Cameras and camera paths (thesis sections 3.2.1 and 4.2). The volume is centred at the origin, its longest
// side is 1, and its axes point where its affine says: a mirrored volume is seen mirrored, a sheared one
// sheared.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "formats/result.h"
#include "formats/volume.h"

namespace voxkit::render {

/// A pinhole camera. x points right in the picture, y up, z to the viewer; the world's up is +y.
struct Camera {
  glm::dvec3 eye{0, 0, 2};
  glm::dvec3 target{0, 0, 0};
  double fov = 45;  ///< full vertical angle in degrees

  /// Looks at the centre from azimuth `az` (degrees, 0 = from +z, 90 = from +x) and elevation `el` (-90..90,
  /// from above positive).
  static Camera orbit(double az, double el, double distance, double fov);
};

inline constexpr double least_fov = 0.01, greatest_fov = 179;

/// What a camera should be and is not, such as "an eye that is not the target"; null where all is well.
const char* expected_of(const Camera& camera);

/// "orbit:AZ,EL,DIST" or "lookat:EX,EY,EZ,TX,TY,TZ"; ErrorCode::usage says what was expected.
Result<Camera> parse_camera(const std::string& text, double fov);

/// "thesis94": 94 frames, one full turn at distance 1.8 (64 frames), then in to 0.9 and out again (15 each),
/// as in section 4.2; "orbit:N": N frames of one full turn. The camera gives elevation and field of view.
Result<std::vector<Camera>> camera_path(const std::string& name, const Camera& camera);

/// From world to grid coordinates of a volume: grid = (along * world + half) / voxel, half the volume's half
/// size and voxel the edges of a voxel, both along its axes. Volumes of patients are drawn in RAS.
struct GridTransform {
  explicit GridTransform(const VolumeInfo& info);
  glm::dvec3 half, voxel;
  glm::dmat3 axes;   ///< columns: unit vectors of the volume's axes, world
  glm::dmat3 along;  ///< their inverse: exactly the identity where axes are those of the world
  glm::dvec3 point(const glm::dvec3& world) const { return (along * world + half) / voxel; }
  glm::dvec3 direction(const glm::dvec3& world) const { return along * world / voxel; }
  /// Corner 0..7; bits x, y and z say on which side of the middle.
  glm::dvec3 corner(int i) const {
    return axes * glm::dvec3((i & 1 ? 1 : -1) * half.x, (i & 2 ? 1 : -1) * half.y, (i & 4 ? 1 : -1) * half.z);
  }
  /// From the middle to the farthest corner, world.
  double radius() const;
  double smallest_edge() const { return std::min({voxel.x, voxel.y, voxel.z}); }
  double largest_edge() const { return std::max({voxel.x, voxel.y, voxel.z}); }
};

/// The rays of a picture: through pixel (x, y), counted from the upper left, at offset (0.5, 0.5) = its
/// centre.
class RayGenerator {
 public:
  RayGenerator(const Camera& camera, int width, int height);
  /// Unit direction in the world.
  glm::dvec3 direction(double x, double y) const;
  const glm::dvec3& eye() const { return eye_; }
  const glm::dvec3& forward() const { return forward_; }
  const glm::dvec3& right() const { return right_; }
  const glm::dvec3& up() const { return up_; }
  /// Width of a pixel at distance 1 along the axis: the cone of a ray is this wide at distance t times t.
  double pixel_width() const { return pixel_; }

 private:
  glm::dvec3 eye_, forward_, right_, up_;
  int width_, height_;
  double pixel_;
};

}  // namespace voxkit::render
