#include "libcolor/surface/voxelise_traits.h"

#include <algorithm>
#include <cmath>

#include "libcolor/surface/heaviest.h"
#include "libcolor/surface/linear_light.h"
#include "libcolor/surface/octahedral.h"

namespace voxkit::color {
namespace {

using Vector = std::array<double, 3>;

Vector vector(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

uint16_t light16(double value) {
  return static_cast<uint16_t>(std::min(value, static_cast<double>(full_light)) + 0.5);
}

uint8_t byte_of(uint16_t value) {
  return static_cast<uint8_t>((value + 128) / 257);
}

}  // namespace

TriangleTraits::TriangleTraits(const VoxelScene& scene, uint32_t index, const std::array<int32_t, 3>& lo)
    : TriangleShade(scene, index, lo), attributes_(scene.attributes) {
  const Mesh& mesh = scene.mesh;
  const MeshTriangle& triangle = mesh.triangles[index];
  if (const int32_t picture = scene.rm_picture_of[triangle.material]; picture >= 0 && !mesh.uvs.empty())
    lay(rm_, scene.pictures[static_cast<size_t>(picture)], mesh.rm_uvs.empty() ? mesh.uvs : mesh.rm_uvs,
        triangle);
  if (!attributes_.has(Attribute::normal)) return;
  const auto& [a, b, c] = triangle.vertices;
  const glm::dvec3 cross =
      glm::cross(mesh.positions[b] - mesh.positions[a], mesh.positions[c] - mesh.positions[a]);
  normal_ = vector(scene.normal_axes * cross);
  if (mesh.normals.empty()) return;
  has_normals_ = true;
  for (size_t i = 0; i < 3; ++i) {
    // To the axes of voxels, and then of length 1: corners count alike.
    const glm::dvec3 normal = scene.normal_axes * glm::dvec3(mesh.normals[triangle.vertices[i]]);
    const double length = glm::length(normal);
    has_normals_ &= length > 0;
    normals_[i] = vector(length > 0 ? normal / length : glm::dvec3(0));
  }
}

std::array<int32_t, 3> TriangleTraits::normal_at(const Weights& weights) const {
  const auto scaled = [](const Vector& v) -> std::array<int32_t, 3> {
    const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    if (!(length > 0) || !std::isfinite(length)) return {};
    std::array<int32_t, 3> out;
    for (size_t c = 0; c < 3; ++c)
      out[c] = static_cast<int32_t>(std::lround(v[c] / length * Traits::normal_length));
    return out;
  };
  if (has_normals_) {
    Vector mixed;
    for (size_t c = 0; c < 3; ++c)
      mixed[c] = normals_[0][c] * (1 - weights.b - weights.c) + normals_[1][c] * weights.b +
                 normals_[2][c] * weights.c;
    if (const auto out = scaled(mixed); out != std::array<int32_t, 3>{}) return out;
  }
  return scaled(normal_);
}

Traits TriangleTraits::traits_at(int x, int y, int z) const {
  Traits out;
  out.shade = at(x, y, z);
  if (out.shade.cover() == 0) return out;
  const Weights weights = weights_at(x, y, z);
  if (attributes_.has(Attribute::emissive) && material_->emits()) {
    Float4 glow{full_light, full_light, full_light, full_light};
    if (emission_.picture)
      glow = emission_.sample(weights, material_->emission_wrap_u, material_->emission_wrap_v,
                              material_->emission_filter);
    for (size_t c = 0; c < 3; ++c)
      out.glow[c] = light16(glow[static_cast<int>(c)] * material_->emission[static_cast<int>(c)]);
  }
  if (attributes_.has(Attribute::rm)) {
    double roughness = full_light, metalness = full_light;
    if (rm_.picture) {
      const Float4 texel =
          rm_.sample(weights, material_->rm_wrap_u, material_->rm_wrap_v, material_->rm_filter);
      roughness = texel[1], metalness = texel[2];
    }
    out.rm = {light16(roughness * material_->roughness), light16(metalness * material_->metalness)};
  }
  if (attributes_.has(Attribute::normal)) out.normal = normal_at(weights);
  out.id = material_->number;
  return out;
}

void TraitMean::add(const Traits& traits, double area) {
  const uint8_t cover = traits.shade.cover();
  // Whatever is there counts.
  const uint64_t area16 = 1 + static_cast<uint64_t>(area * 65536), weight = area16 * cover;
  most_ = std::max(most_, cover);
  area_ += area16;
  covered_ += weight;
  if (cover == 0) return;
  weight_ += weight;
  for (size_t c = 0; c < 3; ++c) {
    light_[c] += static_cast<Sum>(weight) * traits.shade.light(c);
    glow_[c] += static_cast<Sum>(weight) * traits.glow[c];
    normal_[c] += static_cast<__int128>(weight) * traits.normal[c];
  }
  for (size_t c = 0; c < 2; ++c) rm_[c] += static_cast<Sum>(weight) * traits.rm[c];
  if (ids_.empty() || ids_.back().first != traits.id) ids_.emplace_back(traits.id, 0);
  ids_.back().second += weight;
}

void TraitMean::append_to(std::vector<std::byte>& out, AttributeSet attributes) const {
  const auto put = [&](uint8_t value) { out.push_back(std::byte{value}); };
  if (attributes.has(Attribute::emissive))
    for (const uint16_t light : mean(glow_)) put(light_tables().stored[light]);
  if (attributes.has(Attribute::opacity))
    put(most_ == 255 ? 255 : static_cast<uint8_t>((2 * covered_ + area_) / (2 * area_)));
  if (attributes.has(Attribute::normal)) {
    const Octahedral o = octahedral_of(static_cast<double>(normal_[0]), static_cast<double>(normal_[1]),
                                       static_cast<double>(normal_[2]));
    put(o.u), put(o.v);
  }
  if (attributes.has(Attribute::rm))
    for (const uint16_t part : mean(rm_)) put(byte_of(part));
  if (attributes.has(Attribute::id)) {
    auto ids = ids_;
    const uint32_t id = heaviest(ids);
    for (int shift = 0; shift < 32; shift += 8) put(static_cast<uint8_t>(id >> shift));
  }
}

}  // namespace voxkit::color
