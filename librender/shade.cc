#include "librender/shade.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <utility>

#include "formats/parallel.h"
#include "librender/light.h"
#include "librender/normals.h"
#include "librender/occlusion.h"
#include "librender/stored.h"
#include "librender/surface.h"

namespace voxkit::render {
namespace {

using glm::vec3;

/// What is left of specular light.
float shine(float x) {
  for (int i = 0; i < log2_shine; ++i) x *= x;
  return x;
}

/// Whether distance jumps at a pixel: one of the pixels around it is void where it is not, or it is off the
/// straight line between two of them by more than a slope of voxels could be.
bool at_step(const Surface& surface, int x, int y) {
  const Surface::Point& here = surface(x, y);
  const float limit = 3 * std::max(surface.voxel(), surface.pixel(here));
  for (const auto& [dx, dy] : {std::pair{1, 0}, {1, 1}, {0, 1}, {-1, 1}}) {
    const bool both = surface.inside(x - dx, y - dy) && surface.inside(x + dx, y + dy);
    if (!both) continue;
    const Surface::Point &before = surface(x - dx, y - dy), &after = surface(x + dx, y + dy);
    if (Surface::hit(before) != Surface::hit(here) || Surface::hit(after) != Surface::hit(here)) return true;
    if (Surface::hit(here) && std::abs(before.distance + after.distance - 2 * here.distance) > limit)
      return true;
  }
  return false;
}

/// Section 3.4: at a step in depth the pixel becomes the mean of both sides.
Result<Image> blend_steps(const Image& sharp, const Surface& surface, Context& ctx) {
  const int width = surface.width(), height = surface.height();
  VOX_TRY(Image picture, Image::create(width, height, 4, SampleType::f32, ctx));
  VOX_CHECK(parallel_for(ctx, height, [&](int64_t row) -> Status {
    const int y = static_cast<int>(row);
    std::copy_n(sharp.row(y), 4 * width, picture.row(y));
    for (int x = 0; x < width; ++x) {
      if (!at_step(surface, x, y)) continue;
      float sum[3] = {}, weight = 0;
      for (int sy = std::max(y - 1, 0); sy <= std::min(y + 1, height - 1); ++sy)
        for (int sx = std::max(x - 1, 0); sx <= std::min(x + 1, width - 1); ++sx) {
          const float w = (sx == x ? 2.0f : 1.0f) * (sy == y ? 2.0f : 1.0f);
          for (int k = 0; k < 3; ++k) sum[k] += w * sharp.row(sy)[4 * sx + k];
          weight += w;
        }
      for (int k = 0; k < 3; ++k) picture.row(y)[4 * x + k] = sum[k] / weight;
    }
    return {};
  }));
  return picture;
}

}  // namespace

Result<Picture> shade(const Frame& frame, const Camera& camera, double voxel, const ShadeOptions& options,
                      Context& ctx) {
  VOX_TRY(const Surface surface, Surface::create(frame, camera, voxel, ctx));
  std::optional<Image> normals, openness;
  if (options.phong || options.ssao || options.normals) {
    VOX_TRY(normals, frame.has.has(color::Attribute::normal) ? stored_normals(frame, surface, ctx)
                                                             : find_normals(surface, ctx));
  }
  if (options.ssao) {
    VOX_TRY(openness, find_openness(surface, *normals, ctx));
  }
  const vec3 light = light_of(surface.rays());
  const bool glows = frame.has.has(color::Attribute::emissive) && (options.phong || options.ssao);
  VOX_TRY(Image picture, Image::create(frame.width, frame.height, 4, SampleType::f32, ctx));
  VOX_CHECK(parallel_for(ctx, frame.height, [&](int64_t row) -> Status {
    const int y = static_cast<int>(row);
    for (int x = 0; x < frame.width; ++x) {
      const Pixel& pixel = frame.pixels[surface.index(x, y)];
      const Surface::Point& point = surface(x, y);
      float diffuse = 1, specular = 0;
      if (Surface::hit(point) && options.phong) {
        const float* n = normals->row(y) + 3 * x;
        const vec3 normal(n[0], n[1], n[2]), half = glm::normalize(light - glm::normalize(point.at));
        diffuse = ambient_light + diffuse_light * std::max(0.0f, glm::dot(normal, light));
        specular = specular_light * shine(std::max(0.0f, glm::dot(normal, half)));
      }
      if (openness) diffuse *= openness->row(y)[x];
      float* out = picture.row(y) + 4 * x;
      const float* const glow = glows ? frame.traits[surface.index(x, y)].emissive : nullptr;
      for (int k = 0; k < 3; ++k) {
        const bool lights = glow && glow[k] > 0;
        const float body = lights ? without_light(pixel.color[k], glow[k]) : pixel.color[k];
        const float lit = std::clamp(
            body * diffuse + specular * pixel.color[3] + (1 - pixel.color[3]) * options.background[k], 0.0f,
            1.0f);
        out[k] = lights ? with_light(lit, glow[k]) : lit;
      }
      out[3] = 1;
    }
    return {};
  }));
  if (!options.normals) normals.reset();
  openness.reset();
  if (options.depth_antialias) {
    VOX_TRY(picture, blend_steps(picture, surface, ctx));
  }
  return Picture{std::move(picture), std::move(normals)};
}

Result<Image> downsample(const Image& image, int n, Context& ctx) {
  const int channels = image.channels();
  VOX_TRY(Image out, Image::create(image.width() / n, image.height() / n, channels, SampleType::f32, ctx));
  VOX_CHECK(parallel_for(ctx, out.height(), [&](int64_t y) -> Status {
    for (int64_t x = 0; x < out.width(); ++x)
      for (int k = 0; k < channels; ++k) {
        double sum = 0;
        for (int64_t v = y * n; v < (y + 1) * n; ++v)
          for (int64_t u = x * n; u < (x + 1) * n; ++u)
            sum += static_cast<double>(image.row(v)[u * channels + k]);
        out.row(y)[x * channels + k] = static_cast<float>(sum / (n * n));
      }
    return {};
  }));
  return out;
}

}  // namespace voxkit::render
