#include "librender/camera.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>

namespace voxkit::render {
namespace {

constexpr double degrees = std::numbers::pi / 180;

/// Numbers separated by commas, exactly `count`.
Result<std::vector<double>> numbers(const std::string& text, size_t count, const char* form) {
  std::vector<double> values;
  const char* p = text.c_str();
  while (true) {
    char* end = nullptr;
    const double value = std::strtod(p, &end);
    if (end == p || !std::isfinite(value)) break;
    values.push_back(value);
    p = end;
    if (*p != ',') break;
    ++p;
  }
  if (*p != '\0' || values.size() != count) return bad_usage(fmt::format("\"{}\": expected {}", text, form));
  return values;
}

}  // namespace

Camera Camera::orbit(double az, double el, double distance, double fov) {
  const double a = az * degrees, e = el * degrees;
  Camera camera;
  camera.eye = glm::dvec3(std::sin(a) * std::cos(e), std::sin(e), std::cos(a) * std::cos(e)) * distance;
  camera.fov = fov;
  return camera;
}

const char* expected_of(const Camera& camera) {
  constexpr double farthest = 1e9;  // squares of what is larger might be infinite
  for (const glm::dvec3& p : {camera.eye, camera.target})
    if (!(std::abs(p.x) <= farthest && std::abs(p.y) <= farthest && std::abs(p.z) <= farthest))
      return "coordinates from -1e9 to 1e9";
  return camera.eye == camera.target ? "an eye that is not the target" : nullptr;
}

Result<Camera> parse_camera(const std::string& text, double fov) {
  Camera camera;
  if (text.starts_with("orbit:")) {
    VOX_TRY(const auto v,
            numbers(text.substr(6), 3, "orbit:AZ,EL,DIST in degrees and units of the longest side"));
    if (v[1] < -90 || v[1] > 90 || v[2] <= 0)
      return bad_usage(
          fmt::format("\"{}\": expected an elevation from -90 to 90 and a distance above 0", text));
    camera = Camera::orbit(v[0], v[1], v[2], fov);
  } else if (text.starts_with("lookat:")) {
    VOX_TRY(const auto v, numbers(text.substr(7), 6, "lookat:EX,EY,EZ,TX,TY,TZ"));
    camera = {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}, fov};
  } else {
    return bad_usage(fmt::format("\"{}\": expected orbit:AZ,EL,DIST or lookat:EX,EY,EZ,TX,TY,TZ", text));
  }
  if (const char* expected = expected_of(camera))
    return bad_usage(fmt::format("\"{}\": expected {}", text, expected));
  return camera;
}

Result<std::vector<Camera>> camera_path(const std::string& name, const Camera& camera) {
  const glm::dvec3 offset = camera.eye - camera.target;
  const double distance = glm::length(offset);
  const double elevation = std::asin(std::clamp(offset.y / distance, -1.0, 1.0)) / degrees;
  std::vector<Camera> path;
  const auto turn = [&](int frames, double at) {
    for (int i = 0; i < frames; ++i)
      path.push_back(Camera::orbit(360.0 * i / frames, elevation, at, camera.fov));
  };
  if (name == "thesis94") {
    turn(64, 1.8);
    for (int i = 1; i <= 15; ++i) path.push_back(Camera::orbit(0, elevation, 1.8 - 0.06 * i, camera.fov));
    for (int i = 1; i <= 15; ++i) path.push_back(Camera::orbit(0, elevation, 0.9 + 0.06 * i, camera.fov));
    return path;
  }
  if (name.starts_with("orbit:")) {
    VOX_TRY(const auto v, numbers(name.substr(6), 1, "orbit:N"));
    if (v[0] < 1 || v[0] > 100000 || v[0] != std::floor(v[0]))
      return bad_usage(fmt::format("\"{}\": expected 1 to 100000 frames", name));
    turn(static_cast<int>(v[0]), distance);
    return path;
  }
  return bad_usage(fmt::format("--path \"{}\": expected thesis94, orbit:N or FILE.json", name));
}

GridTransform::GridTransform(const VolumeInfo& info) : axes(1.0), along(1.0) {
  glm::dvec3 size;
  const Affine affine =
      is_anatomical(info.world) ? in_world(info.affine, info.world, World::ras) : info.affine;
  const Affine::Vector spacing = affine.spacing();
  const bool turned = affine.is_valid() && !affine.is_plain();
  for (int a = 0; a < 3; ++a) {
    const auto i = static_cast<size_t>(a);
    const double edge = spacing[i];
    voxel[a] = edge > 0 ? edge : 1;
    size[a] = voxel[a] * static_cast<double>(info.dims[a]);
    if (turned) axes[a] = glm::dvec3(affine.axes[i][0], affine.axes[i][1], affine.axes[i][2]) / voxel[a];
  }
  if (turned) along = glm::inverse(axes);
  const double longest = std::max({size.x, size.y, size.z});
  half = size / longest * 0.5;
  voxel /= longest;
}

double GridTransform::radius() const {
  double radius = 0;
  for (int i = 0; i < 8; ++i) radius = std::max(radius, glm::length(corner(i)));
  return radius;
}

RayGenerator::RayGenerator(const Camera& camera, int width, int height)
    : eye_(camera.eye), forward_(glm::normalize(camera.target - camera.eye)), width_(width), height_(height) {
  // Looking straight up or down, the top of the picture is towards -z or +z.
  const glm::dvec3 world_up =
      std::abs(forward_.y) > 1 - 1e-12 ? glm::dvec3(0, 0, forward_.y > 0 ? 1 : -1) : glm::dvec3(0, 1, 0);
  right_ = glm::normalize(glm::cross(forward_, world_up));
  up_ = glm::cross(right_, forward_);
  pixel_ = 2 * std::tan(camera.fov * degrees / 2) / height;
}

glm::dvec3 RayGenerator::direction(double x, double y) const {
  return glm::normalize(forward_ + right_ * ((x - width_ * 0.5) * pixel_) +
                        up_ * ((height_ * 0.5 - y) * pixel_));
}

}  // namespace voxkit::render
