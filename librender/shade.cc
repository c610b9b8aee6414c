#include "librender/shade.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <numbers>

#include "formats/parallel.h"

namespace voxkit::render {
namespace {

using Vec = glm::dvec3;

/// The frame as a field of positions.
class Surface {
 public:
  Surface(const Frame& frame, const Camera& camera)
      : frame_(frame), rays_(camera, frame.width, frame.height) {}

  int width() const { return frame_.width; }
  int height() const { return frame_.height; }
  const RayGenerator& rays() const { return rays_; }
  const Pixel& pixel(int x, int y) const {
    return frame_.pixels[static_cast<size_t>(y) * static_cast<size_t>(frame_.width) + static_cast<size_t>(x)];
  }
  bool hit(int x, int y) const {
    return x >= 0 && y >= 0 && x < frame_.width && y < frame_.height && std::isfinite(pixel(x, y).distance);
  }
  Vec position(int x, int y) const {
    return rays_.eye() + rays_.direction(x + 0.5, y + 0.5) * static_cast<double>(pixel(x, y).distance);
  }
  /// Pixels that an object of that size, seen at that distance, covers.
  double pixels(double size, double distance) const { return size / (rays_.pixel_width() * distance); }

 private:
  const Frame& frame_;
  RayGenerator rays_;
};

/// Directions on a circle, eight a turn.
const std::array<std::array<double, 2>, 8> circle = [] {
  std::array<std::array<double, 2>, 8> points{};
  for (size_t i = 0; i < 8; ++i) {
    const double angle = static_cast<double>(i) * std::numbers::pi / 4;
    points[i] = {std::cos(angle), std::sin(angle)};
  }
  return points;
}();

/// Section 3.4.1: triangles between a pixel and samples on circles of growing radius, until about the size of
/// a voxel is covered; samples whose distance differs by more than `reject` belong to something else.
Vec normal_at(const Surface& surface, int x, int y, double voxel) {
  const Vec centre = surface.position(x, y);
  const double distance = surface.pixel(x, y).distance;
  const double radius = std::clamp(1.5 * surface.pixels(voxel, distance), 1.0, 16.0), reject = 4 * voxel;
  Vec sum(0);
  for (double r = std::max(1.0, radius / 3); r <= radius + 1e-9; r += std::max(1.0, radius / 3)) {
    std::array<Vec, 8> around;
    std::array<bool, 8> valid{};
    for (size_t i = 0; i < 8; ++i) {
      const int sx = x + static_cast<int>(std::lround(r * circle[i][0])),
                sy = y + static_cast<int>(std::lround(r * circle[i][1]));
      valid[i] = surface.hit(sx, sy) &&
                 std::abs(static_cast<double>(surface.pixel(sx, sy).distance) - distance) < reject;
      if (valid[i]) around[i] = surface.position(sx, sy) - centre;
    }
    // Opposite pairs span the tangent plane without the centre's own stair step.
    for (size_t i = 0; i < 8; ++i) {
      const size_t j = (i + 2) % 8;
      if (valid[i] && valid[j]) sum += glm::cross(around[j], around[i]);
    }
  }
  const Vec to_eye = glm::normalize(surface.rays().eye() - centre);
  if (glm::dot(sum, sum) == 0) return to_eye;
  const Vec normal = glm::normalize(sum);
  return glm::dot(normal, to_eye) < 0 ? -normal : normal;
}

/// How much of the half space over a pixel is open, 0..1.
double openness(const Surface& surface, int x, int y, const Vec& normal, double voxel) {
  const Vec centre = surface.position(x, y);
  const double distance = surface.pixel(x, y).distance, reach = std::max(24 * voxel, 0.04);
  const double radius = std::clamp(surface.pixels(reach, distance), 4.0, 96.0);
  double blocked = 0;
  for (size_t i = 0; i < 8; ++i)
    for (int ring = 1; ring <= 4; ++ring) {
      // A turn of the pattern from pixel to pixel, the same for every picture.
      const double turn = ((x & 3) * 4 + (y & 3)) * (std::numbers::pi / 64), c = std::cos(turn),
                   s = std::sin(turn);
      const double r = radius * ring / 4;
      const int sx = x + static_cast<int>(std::lround(r * (circle[i][0] * c - circle[i][1] * s)));
      const int sy = y + static_cast<int>(std::lround(r * (circle[i][0] * s + circle[i][1] * c)));
      if (!surface.hit(sx, sy)) continue;
      const Vec to = surface.position(sx, sy) - centre;
      const double length = glm::length(to);
      if (length < voxel || length > reach) continue;
      const double above = glm::dot(to, normal) / length - 0.1;
      if (above > 0) blocked += above * (1 - length / reach);
    }
  return std::clamp(1 - blocked / 8, 0.0, 1.0);
}

}  // namespace

Result<Picture> shade(const Frame& frame, const Camera& camera, double voxel, const ShadeOptions& options,
                      Context& ctx) {
  const Surface surface(frame, camera);
  Picture picture;
  picture.width = frame.width;
  picture.height = frame.height;
  const size_t count = frame.pixels.size();
  picture.rgba.resize(4 * count);
  picture.normals.resize(3 * count);
  // Over the viewer's left shoulder.
  const Vec forward = surface.rays().forward();
  const Vec side =
      std::abs(forward.y) < 0.999 ? glm::normalize(glm::cross(forward, Vec(0, 1, 0))) : Vec(1, 0, 0);
  const Vec light = glm::normalize(-forward - 0.5 * side + 0.6 * glm::cross(side, forward));

  VOX_CHECK(parallel_for(ctx, frame.height, [&](int64_t row) -> Status {
    const int y = static_cast<int>(row);
    for (int x = 0; x < frame.width; ++x) {
      const Pixel& pixel = surface.pixel(x, y);
      const size_t i = static_cast<size_t>(y) * static_cast<size_t>(frame.width) + static_cast<size_t>(x);
      double diffuse = 1, specular = 0;
      if (surface.hit(x, y) && (options.phong || options.ssao)) {
        const Vec normal = normal_at(surface, x, y, voxel);
        for (int k = 0; k < 3; ++k)
          picture.normals[3 * i + static_cast<size_t>(k)] = static_cast<float>(normal[k]);
        if (options.phong) {
          const Vec half = glm::normalize(light - surface.rays().direction(x + 0.5, y + 0.5));
          diffuse = 0.35 + 0.65 * std::max(0.0, glm::dot(normal, light));
          specular = 0.15 * std::pow(std::max(0.0, glm::dot(normal, half)), 32);
        }
        if (options.ssao) diffuse *= openness(surface, x, y, normal, voxel);
      }
      for (size_t k = 0; k < 3; ++k) {
        const double lit =
            static_cast<double>(pixel.colour[k]) * diffuse + specular * static_cast<double>(pixel.colour[3]);
        picture.rgba[4 * i + k] = static_cast<float>(std::clamp(
            lit + (1 - static_cast<double>(pixel.colour[3])) * static_cast<double>(options.background[k]),
            0.0, 1.0));
      }
      picture.rgba[4 * i + 3] = 1;
    }
    return {};
  }));
  if (!options.depth_antialias) return picture;

  // Section 3.4: where distance jumps to a neighbour, the pixel becomes the mean of both sides.
  const std::vector<float> sharp = picture.rgba;
  VOX_CHECK(parallel_for(ctx, frame.height, [&](int64_t row) -> Status {
    const int y = static_cast<int>(row);
    for (int x = 0; x < frame.width; ++x) {
      const float here = surface.pixel(x, y).distance;
      float sum[3] = {}, weight = 0;
      bool step = false;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          const int sx = std::clamp(x + dx, 0, frame.width - 1), sy = std::clamp(y + dy, 0, frame.height - 1);
          const float there = surface.pixel(sx, sy).distance;
          step |= std::isfinite(here) != std::isfinite(there) ||
                  (std::isfinite(here) && std::abs(there - here) > static_cast<float>(3 * voxel));
          const float w = dx == 0 && dy == 0 ? 4.0f : dx == 0 || dy == 0 ? 2.0f : 1.0f;
          const size_t i =
              static_cast<size_t>(sy) * static_cast<size_t>(frame.width) + static_cast<size_t>(sx);
          for (size_t k = 0; k < 3; ++k) sum[k] += w * sharp[4 * i + k];
          weight += w;
        }
      if (!step) continue;
      const size_t i = static_cast<size_t>(y) * static_cast<size_t>(frame.width) + static_cast<size_t>(x);
      for (size_t k = 0; k < 3; ++k) picture.rgba[4 * i + k] = sum[k] / weight;
    }
    return {};
  }));
  return picture;
}

Picture downsample(const Picture& picture, int n) {
  Picture out;
  out.width = picture.width / n;
  out.height = picture.height / n;
  out.rgba.resize(4 * static_cast<size_t>(out.width) * static_cast<size_t>(out.height));
  for (size_t y = 0, i = 0; y < static_cast<size_t>(out.height); ++y)
    for (size_t x = 0; x < static_cast<size_t>(out.width); ++x)
      for (size_t k = 0; k < 4; ++k, ++i) {
        double sum = 0;
        for (size_t v = y * static_cast<size_t>(n); v < (y + 1) * static_cast<size_t>(n); ++v)
          for (size_t u = x * static_cast<size_t>(n); u < (x + 1) * static_cast<size_t>(n); ++u)
            sum += static_cast<double>(picture.rgba[4 * (v * static_cast<size_t>(picture.width) + u) + k]);
        out.rgba[i] = static_cast<float>(sum / (n * n));
      }
  return out;
}

}  // namespace voxkit::render
