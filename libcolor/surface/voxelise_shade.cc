#include "libcolor/surface/voxelise_shade.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "libcolor/surface/linear_light.h"

namespace voxkit::color {
namespace {

using Place = std::array<double, 3>;

Place minus(const Place& a, const Place& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
double dot(const Place& a, const Place& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Place cross(const Place& a, const Place& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Float4 float4(const glm::vec4& v) {
  return Float4{v.x, v.y, v.z, v.w};
}

using Int4 = int32_t __attribute__((vector_size(16)));
constexpr Float4 all_light = {full_light, full_light, full_light, full_light};

/// A convex polygon: a triangle has three corners, and each of six planes adds one at most.
struct Polygon {
  std::array<Place, 9> corners;
  size_t size = 0;
};

/// The part of a polygon where sign * p[axis] <= limit.
void clip(const Polygon& in, size_t axis, double sign, double limit, Polygon& out) {
  out.size = 0;
  const Place* a = &in.corners[in.size - 1];
  double from = sign * (*a)[axis] - limit;
  for (size_t i = 0; i < in.size; ++i) {
    const Place& b = in.corners[i];
    const double to = sign * b[axis] - limit;
    // Rounding may not make a polygon have more corners than it can have.
    if ((from < 0 && to > 0) || (from > 0 && to < 0)) {
      const double part = from / (from - to);
      if (out.size < out.corners.size())
        out.corners[out.size++] = {(*a)[0] + (b[0] - (*a)[0]) * part, (*a)[1] + (b[1] - (*a)[1]) * part,
                                   (*a)[2] + (b[2] - (*a)[2]) * part};
    }
    if (to <= 0 && out.size < out.corners.size()) out.corners[out.size++] = b;
    a = &b;
    from = to;
  }
}

}  // namespace

TriangleShade::TriangleShade(const VoxelScene& scene, uint32_t index, const std::array<int32_t, 3>& lo) {
  const MeshTriangle& triangle = scene.mesh.triangles[index];
  const SnappedTriangle& snapped = scene.corners[index];
  for (size_t i = 0; i < 3; ++i)
    for (size_t c = 0; c < 3; ++c)
      corners_[i][c] =
          static_cast<double>(snapped.corners[i][c] - int64_t{lo[c]} * units_per_voxel) / units_per_voxel;
  const Place first = minus(corners_[1], corners_[0]), second = minus(corners_[2], corners_[0]);
  const Place normal = cross(first, second);
  if (const double squared = dot(normal, normal); squared > 0) {
    gradient_[0] = cross(second, normal);
    gradient_[1] = cross(normal, first);
    for (Place& g : gradient_)
      for (double& part : g) part /= squared;
  } else {
    gradient_[0] = gradient_[1] = {0, 0, 0};
    weight_[0] = weight_[1] = 1.0 / 3;
  }
  material_ = &scene.mesh.materials[triangle.material];
  if (!scene.mesh.colors.empty())
    for (size_t i = 0; i < 3; ++i) {
      const glm::vec4& color = scene.mesh.colors[triangle.vertices[i]];
      tint_[i] = float4(color);
      tinted_ |= color != glm::vec4(1);
    }
  const Mesh& mesh = scene.mesh;
  if (const int32_t picture = scene.picture_of[triangle.material]; picture >= 0 && !mesh.uvs.empty())
    lay(color_, scene.pictures[static_cast<size_t>(picture)], mesh.uvs, triangle);
  if (const int32_t picture = scene.emission_picture_of[triangle.material]; picture >= 0 && !mesh.uvs.empty())
    lay(emission_, scene.pictures[static_cast<size_t>(picture)],
        mesh.emission_uvs.empty() ? mesh.uvs : mesh.emission_uvs, triangle);
  if (!color_.picture && !emission_.picture && !tinted_)
    plain_ = shade(all_light, Float4{1, 1, 1, 1}, all_light);
}

void TriangleShade::lay(Map& map, const PictureLevels& picture, const std::vector<glm::vec2>& uvs,
                        const MeshTriangle& triangle) const {
  map.picture = &picture;
  for (size_t i = 0; i < 3; ++i) {
    const glm::vec2& uv = uvs[triangle.vertices[i]];
    map.u[i] = uv.x - (i ? map.u[0] : 0);
    map.v[i] = uv.y - (i ? map.v[0] : 0);
  }
  // The longest side of what a voxel's edge covers in the picture: the larger singular value of the map.
  Place s, t;
  for (size_t c = 0; c < 3; ++c) {
    s[c] = static_cast<double>(picture.width()) * (map.u[1] * gradient_[0][c] + map.u[2] * gradient_[1][c]);
    t[c] = static_cast<double>(picture.height()) * (map.v[1] * gradient_[0][c] + map.v[2] * gradient_[1][c]);
  }
  const double ss = dot(s, s), tt = dot(t, t), st = dot(s, t), half = (ss - tt) / 2;
  map.detail = picture.detail((ss + tt) / 2 + std::sqrt(half * half + st * st));
}

/// `glow`: what multiplies the emission.
Shade TriangleShade::shade(Float4 texel, Float4 tint, Float4 glow) const {
  tint *= float4(material_->color);
  const float alpha = texel[3] * tint[3] / static_cast<float>(full_light);
  uint8_t cover = 255;
  if (material_->alpha_mode == AlphaMode::mask) {
    if (alpha < material_->alpha_cutoff) return {};
  } else if (material_->alpha_mode == AlphaMode::blend) {
    cover = static_cast<uint8_t>(std::min(alpha, 1.0f) * 255 + 0.5f);
    if (cover == 0) return {};
  }
  // Colours come multiplied by the picture's alpha.
  if (texel[3] > 0 && texel[3] < static_cast<float>(full_light))
    texel *= static_cast<float>(full_light) / texel[3];
  texel *= tint;
  texel = texel < all_light ? texel : all_light;
  if (material_->emits()) {
    const glm::vec3& emission = material_->emission;
    texel += glow * Float4{emission.r, emission.g, emission.b, 0};
    texel = texel < all_light ? texel : all_light;
  }
  const Int4 light = __builtin_convertvector(texel + 0.5f, Int4);
  return {static_cast<uint16_t>(light[0]), static_cast<uint16_t>(light[1]), static_cast<uint16_t>(light[2]),
          cover};
}

TriangleShade::Weights TriangleShade::weights_at(int x, int y, int z) const {
  const Place from{x + 0.5 - corners_[0][0], y + 0.5 - corners_[0][1], z + 0.5 - corners_[0][2]};
  double b = weight_[0] + dot(gradient_[0], from), c = weight_[1] + dot(gradient_[1], from);
  if (double a = 1 - b - c; a < 0 || b < 0 || c < 0) {
    a = std::max(a, 0.0), b = std::max(b, 0.0), c = std::max(c, 0.0);
    const double sum = a + b + c;
    b /= sum, c /= sum;
  }
  return {b, c};
}

Shade TriangleShade::at(int x, int y, int z) const {
  if (!color_.picture && !emission_.picture && !tinted_) return plain_;
  const Weights weights = weights_at(x, y, z);
  Float4 texel = all_light, tint{1, 1, 1, 1}, glow = all_light;
  if (color_.picture) texel = color_.sample(weights, material_->wrap_u, material_->wrap_v, material_->filter);
  if (emission_.picture)
    glow = emission_.sample(weights, material_->emission_wrap_u, material_->emission_wrap_v,
                            material_->emission_filter);
  if (tinted_)
    tint = tint_[0] + (tint_[1] - tint_[0]) * static_cast<float>(weights.b) +
           (tint_[2] - tint_[0]) * static_cast<float>(weights.c);
  return shade(texel, tint, glow);
}

double TriangleShade::area_in(int x, int y, int z) const {
  const Place lo{static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)};
  Polygon polygons[2];
  Polygon *polygon = &polygons[0], *other = &polygons[1];
  polygon->size = 3;
  for (size_t i = 0; i < 3; ++i) polygon->corners[i] = minus(corners_[i], lo);
  for (size_t axis = 0; axis < 3; ++axis) {
    double least = 1, most = 0;
    for (size_t i = 0; i < polygon->size; ++i) {
      least = std::min(least, polygon->corners[i][axis]);
      most = std::max(most, polygon->corners[i][axis]);
    }
    const auto cut = [&](double sign, double limit) {
      clip(*polygon, axis, sign, limit, *other);
      std::swap(polygon, other);
      return polygon->size >= 3;
    };
    if (least < 0 && !cut(-1, 0)) return 0;
    if (most > 1 && !cut(1, 1)) return 0;
  }
  const auto& corners = polygon->corners;
  Place sum{0, 0, 0};
  for (size_t i = 2; i < polygon->size; ++i) {
    const Place part = cross(minus(corners[i - 1], corners[0]), minus(corners[i], corners[0]));
    for (size_t c = 0; c < 3; ++c) sum[c] += part[c];
  }
  return std::sqrt(dot(sum, sum)) / 2;
}

}  // namespace voxkit::color
