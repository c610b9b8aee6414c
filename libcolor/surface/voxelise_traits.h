// What a triangle has at a voxel beside its colour, and the mean over the triangles in one.
#pragma once

#include <utility>

#include "libcolor/surface/voxelise_shade.h"

namespace voxkit::color {

struct Traits {
  Shade shade;
  std::array<uint16_t, 3> glow{};   ///< light that it gives, linear, in 16 bits
  std::array<int32_t, 3> normal{};  ///< along the axes of voxels, of length normal_length, or 0
  std::array<uint16_t, 2> rm{};     ///< roughness and metalness in 16 bits
  uint32_t id = 0;
  static constexpr double normal_length = 1 << 20;
};

/// What is the same for all voxels of a triangle.
class TriangleTraits : public TriangleShade {
 public:
  TriangleTraits(const VoxelScene& scene, uint32_t triangle, const std::array<int32_t, 3>& lo);

  /// As TriangleShade::at.
  Traits traits_at(int x, int y, int z) const;

 private:
  using Vector = std::array<double, 3>;
  std::array<int32_t, 3> normal_at(const Weights& weights) const;

  AttributeSet attributes_;
  Map rm_;
  bool has_normals_ = false;  ///< at all of its corners
  Vector normal_{};           ///< its own
  Vector normals_[3]{};
};

/// The mean over the triangles in a voxel: what it has, each by the area that it has there and by how much of
/// that is there, as ShadeMean; how much is there, by area, but all where one is opaque; the id that weighs
/// most, of equal ones the lowest. Order does not matter.
class TraitMean {
 public:
  /// Also of a triangle that covers nothing there.
  void add(const Traits& traits, double area);
  /// Whether there is a voxel: with opacity where at least 1/255 is covered, else where one covers a half.
  bool there(AttributeSet attributes) const {
    return attributes.has(Attribute::opacity) ? covered_ >= area_ && area_ > 0 : most_ >= least_cover;
  }
  /// Of a voxel that is there.
  std::array<uint16_t, 3> light() const { return mean(light_); }
  /// Appends all attributes of a set.
  void append_to(std::vector<std::byte>& out, AttributeSet attributes) const;

 private:
  using Sum = unsigned __int128;
  template <size_t n>
  std::array<uint16_t, n> mean(const std::array<Sum, n>& sums) const {
    std::array<uint16_t, n> out;
    for (size_t c = 0; c < n; ++c) out[c] = static_cast<uint16_t>((sums[c] + weight_ / 2) / weight_);
    return out;
  }

  uint8_t most_ = 0;
  uint64_t area_ = 0, covered_ = 0;  ///< covered: area times cover
  Sum weight_ = 0;
  std::array<Sum, 3> light_{}, glow_{};
  std::array<Sum, 2> rm_{};
  std::array<__int128, 3> normal_{};
  std::vector<std::pair<uint32_t, uint64_t>> ids_;  ///< and their weights, as they come
};

}  // namespace voxkit::color
