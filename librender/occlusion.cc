#include "librender/occlusion.h"

#include <array>
#include <numbers>

#include "formats/parallel.h"

namespace voxkit::render {
namespace {

using glm::vec3;

constexpr int directions = 8, steps = 4, tile = 4;

/// The directions in which a pixel looks. Each of a square of 4 x 4 pixels has its own, so that together
/// they look in 128.
using Star = std::array<std::array<float, 2>, directions>;
const std::array<Star, tile* tile> stars = [] {
  std::array<Star, tile * tile> all{};
  for (size_t turn = 0; turn < all.size(); ++turn)
    for (size_t i = 0; i < directions; ++i) {
      const double angle = 2 * std::numbers::pi / directions *
                           (static_cast<double>(i) + static_cast<double>(turn) / (tile * tile));
      all[turn][i] = {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle))};
    }
  return all;
}();

vec3 normal_of(const Image& normals, int x, int y) {
  const float* n = normals.row(y) + 3 * x;
  return {n[0], n[1], n[2]};
}

/// What rises over the tangent plane by more than a voxel, which may be a step of the surface itself, hides
/// all below it in its direction; the less, the farther away it is.
float openness_at(const Surface& surface, const Image& normals, int x, int y) {
  const Surface::Point& centre = surface(x, y);
  const vec3 normal = normal_of(normals, x, y);
  const float pixel = surface.pixel(centre);
  const float radius = std::clamp(std::max(24 * surface.voxel(), 0.04f) / pixel, 4.0f, 96.0f);
  const float reach = radius * pixel;
  const Star& star = stars[static_cast<size_t>(y % tile * tile + x % tile)];
  float hidden = 0;
  for (const auto& [u, v] : star) {
    float horizon = 0;
    for (int step = 1; step <= steps; ++step) {
      const float r = radius * static_cast<float>(step) / steps;
      const int sx = x + whole_pixels(r * u), sy = y + whole_pixels(r * v);
      if (!surface.inside(sx, sy)) break;
      const Surface::Point& sample = surface(sx, sy);
      if (!Surface::hit(sample)) continue;
      const vec3 to = sample.at - centre.at;
      const float height = glm::dot(to, normal) - surface.voxel(), square = glm::dot(to, to);
      if (height <= 0 || square >= reach * reach) continue;
      const float sine = height / std::sqrt(square);
      if (sine <= horizon) continue;
      hidden += (sine - horizon) * (1 - square / (reach * reach));
      horizon = sine;
    }
  }
  return std::clamp(1 - hidden / directions, 0.0f, 1.0f);
}

}  // namespace

Result<Image> find_openness(const Surface& surface, const Image& normals, Context& ctx) {
  const int width = surface.width(), height = surface.height();
  VOX_TRY(Image rough, Image::create(width, height, 1, SampleType::f32, ctx));
  VOX_CHECK(parallel_for(ctx, height, [&](int64_t row) -> Status {
    const int y = static_cast<int>(row);
    for (int x = 0; x < width; ++x)
      rough.row(y)[x] = Surface::hit(surface(x, y)) ? openness_at(surface, normals, x, y) : 1;
    return {};
  }));

  // The mean over a square, which holds every star once, as far as it is one surface.
  VOX_TRY(Image smooth, Image::create(width, height, 1, SampleType::f32, ctx));
  VOX_CHECK(parallel_for(ctx, height, [&](int64_t row) -> Status {
    const int y = static_cast<int>(row);
    for (int x = 0; x < width; ++x) {
      const Surface::Point& centre = surface(x, y);
      smooth.row(y)[x] = 1;
      if (!Surface::hit(centre)) continue;
      const vec3 normal = normal_of(normals, x, y);
      const float near = 2 * std::max(surface.voxel(), surface.pixel(centre));
      float sum = 0, count = 0;
      for (int sy = std::max(y - tile / 2, 0); sy < std::min(y + tile / 2, height); ++sy)
        for (int sx = std::max(x - tile / 2, 0); sx < std::min(x + tile / 2, width); ++sx) {
          const Surface::Point& sample = surface(sx, sy);
          if (!Surface::hit(sample) || std::abs(glm::dot(sample.at - centre.at, normal)) > near) continue;
          sum += rough.row(sy)[sx];
          ++count;
        }
      smooth.row(y)[x] = sum / count;
    }
    return {};
  }));
  return smooth;
}

}  // namespace voxkit::render
