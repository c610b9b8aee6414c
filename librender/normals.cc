#include "librender/normals.h"

#include <array>
#include <numbers>

#include "formats/parallel.h"

namespace voxkit::render {
namespace {

using glm::vec3;

constexpr float widest = 128;  // pixels; samples on wider circles are too far apart to be one surface

/// Directions on a circle, eight a turn.
const std::array<std::array<float, 2>, 8> circle = [] {
  std::array<std::array<float, 2>, 8> points{};
  for (size_t i = 0; i < 8; ++i) {
    const double angle = static_cast<double>(i) * std::numbers::pi / 4;
    points[i] = {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle))};
  }
  return points;
}();

/// The same where a surface is so steep that all neighbours are far: from the nearer one of both along each
/// axis, which is the one on this surface. 0 where even that is too far.
vec3 steep_area(const Surface& surface, int x, int y, int step) {
  const Surface::Point& centre = surface(x, y);
  constexpr float steepest = 32;  // depth over width
  const float reach = steepest * static_cast<float>(step) * surface.pixel(centre);
  const auto nearer = [&](int across, int down) {
    vec3 best(0);
    float least = reach * reach;
    for (const int sign : {1, -1}) {
      const int sx = x + sign * across * step, sy = y + sign * down * step;
      if (!surface.inside(sx, sy) || !Surface::hit(surface(sx, sy))) continue;
      const vec3 to = surface(sx, sy).at - centre.at;
      if (glm::dot(to, to) >= least) continue;
      least = glm::dot(to, to);
      best = static_cast<float>(sign) * to;
    }
    return best;
  };
  const vec3 area = glm::cross(nearer(1, 0), nearer(0, 1));
  const float length = glm::length(area);
  return length > 0 ? area / length : area;
}

/// The areas of the polygons through samples on circles around a pixel, as a vector towards the viewer:
/// whatever steps lie within a circle, its area is that of the slope across them. The circles grow until
/// about the size of a voxel is covered; samples farther off belong to something else.
vec3 area_around(const Surface& surface, int x, int y) {
  const Surface::Point& centre = surface(x, y);
  const float pixel = surface.pixel(centre);
  const float radius = std::clamp(1.5f * surface.voxel() / pixel, 1.0f, widest);
  const float reach = 2.5f * std::max(surface.voxel(), radius * pixel);
  const float step = std::max(1.0f, radius / 3);
  vec3 sum(0);
  for (float r = step; r < radius + 0.01f; r += step) {
    std::array<vec3, 8> around;
    std::array<bool, 8> valid{};
    for (size_t i = 0; i < 8; ++i) {
      const int sx = x + whole_pixels(r * circle[i][0]), sy = y + whole_pixels(r * circle[i][1]);
      if (!surface.inside(sx, sy) || !Surface::hit(surface(sx, sy))) continue;
      around[i] = surface(sx, sy).at - centre.at;
      valid[i] = glm::dot(around[i], around[i]) <= reach * reach;
    }
    for (size_t i = 0; i < 8; ++i) {
      const size_t j = (i + 2) % 8;
      if (valid[i] && valid[j]) sum += glm::cross(around[j], around[i]);
    }
  }
  sum /= radius * radius * pixel * pixel;
  if (sum == vec3(0)) sum = steep_area(surface, x, y, whole_pixels(step));
  return glm::dot(sum, centre.at) > 0 ? -sum : sum;
}

/// The mean of the areas within twice that size, those that face elsewhere left out: evens out steps wider
/// than a voxel and keeps edges.
vec3 normal_at(const Surface& surface, const vec3* areas, int x, int y) {
  const Surface::Point& centre = surface(x, y);
  const vec3 own = areas[surface.index(x, y)];
  const float pixel = surface.pixel(centre);
  const float radius = std::clamp(3 * surface.voxel() / pixel, 2.0f, widest);
  const float reach = 2 * radius * pixel;
  vec3 sum = own;
  for (int ring = 1; ring <= 3; ++ring)
    for (const auto& [u, v] : circle) {
      const float r = radius * static_cast<float>(ring) / 3;
      const int sx = x + whole_pixels(r * u), sy = y + whole_pixels(r * v);
      if (!surface.inside(sx, sy) || !Surface::hit(surface(sx, sy))) continue;
      const vec3 to = surface(sx, sy).at - centre.at;
      if (glm::dot(to, to) > reach * reach) continue;
      // Weighted by the cosine of the angle between the two, to the power of four; a pixel without a normal
      // of its own takes what it finds.
      const vec3 other = areas[surface.index(sx, sy)];
      const float along = std::max(glm::dot(own, other), 0.0f);
      const float squares = glm::dot(own, own) * glm::dot(other, other);
      const float alike = squares > 0 ? along * along / squares : 1;
      sum += other * (alike * alike);
    }
  const float length = glm::length(sum);
  return length > 0 ? sum / length : -glm::normalize(centre.at);
}

}  // namespace

Result<Image> find_normals(const Surface& surface, Context& ctx) {
  const int width = surface.width(), height = surface.height();
  const uint64_t pixels = static_cast<uint64_t>(width) * static_cast<uint64_t>(height);
  VOX_TRY(const auto buffer, Buffer::allocate(pixels * sizeof(vec3), "normals", ctx));
  vec3* areas = reinterpret_cast<vec3*>(buffer->data());
  VOX_CHECK(parallel_for(ctx, height, [&](int64_t row) -> Status {
    const int y = static_cast<int>(row);
    for (int x = 0; x < width; ++x)
      areas[surface.index(x, y)] = Surface::hit(surface(x, y)) ? area_around(surface, x, y) : vec3(0);
    return {};
  }));
  VOX_TRY(Image normals, Image::create(width, height, 3, SampleType::f32, ctx));
  VOX_CHECK(parallel_for(ctx, height, [&](int64_t row) -> Status {
    const int y = static_cast<int>(row);
    for (int x = 0; x < width; ++x) {
      const vec3 normal = Surface::hit(surface(x, y)) ? normal_at(surface, areas, x, y) : vec3(0);
      for (int k = 0; k < 3; ++k) normals.row(y)[3 * x + k] = normal[k];
    }
    return {};
  }));
  return normals;
}

}  // namespace voxkit::render
