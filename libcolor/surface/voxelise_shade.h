// The colour of a triangle at a voxel.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <vector>

#include "formats/mesh/mesh.h"
#include "libcolor/surface/picture_levels.h"
#include "libcolor/surface/surface.h"
#include "libcolor/surface/triangle_cells.h"

namespace voxkit::color {

/// A mesh on the grid of a surface. Points are triangles whose corners are one, behind the others.
struct VoxelScene {
  SurfaceKind kind = SurfaceKind::thin;
  std::vector<SnappedTriangle> corners;  ///< of mesh.triangles
  Mesh mesh;                             ///< without its pictures, and positions that nobody needs
  size_t first_point = SIZE_MAX;
  std::vector<PictureLevels> pictures;
  /// Of a material: indices into pictures, or -1.
  std::vector<int32_t> picture_of, emission_picture_of, rm_picture_of;
  AttributeSet attributes;    ///< what voxels have beside colours
  glm::dmat3 normal_axes{1};  ///< takes normals of the mesh to the axes of voxels, but for their length

  /// Which voxels a triangle is in.
  TriangleCells cells(uint32_t triangle) const {
    return {corners[triangle], triangle < first_point ? kind : SurfaceKind::conservative};
  }
};

/// Cover from which on a voxel is there: a half of 255. Voxels are there or not.
inline constexpr uint8_t least_cover = 128;

/// Linear light in 16 bits, and how much of the area is there, 1..255; 0 = nothing is. In one register: parts
/// of a word that are written one by one wait for each other when it is read.
class Shade {
 public:
  Shade() = default;
  Shade(uint16_t r, uint16_t g, uint16_t b, uint8_t cover)
      : bits_(uint64_t{cover} << 48 | uint64_t{b} << 32 | uint32_t{g} << 16 | r) {}
  uint8_t cover() const { return static_cast<uint8_t>(bits_ >> 48); }
  uint16_t light(size_t channel) const { return static_cast<uint16_t>(bits_ >> (16 * channel)); }

 private:
  uint64_t bits_ = 0;
};

/// What is the same for all voxels of a triangle. Places are counted in voxels from `lo`.
class TriangleShade {
 public:
  TriangleShade(const VoxelScene& scene, uint32_t triangle, const std::array<int32_t, 3>& lo);

  /// At the point of the triangle that is nearest to the centre of a voxel, or beside its border close to
  /// that.
  Shade at(int x, int y, int z) const;

  /// Area of the part of the triangle that is in a voxel, in squares of its edge; 1.3 at most.
  double area_in(int x, int y, int z) const;

 protected:
  using Place = std::array<double, 3>;
  /// How much of the second and the third corner there is at a point.
  struct Weights {
    double b = 0, c = 0;
  };
  /// A picture on the triangle.
  struct Map {
    const PictureLevels* picture = nullptr;
    double u[3] = {0, 0, 0}, v[3] = {0, 0, 0};  ///< at the first corner, and from there to the others
    PictureLevels::Detail detail;
    Float4 sample(const Weights& at, PictureWrap wrap_u, PictureWrap wrap_v, PictureFilter filter) const {
      return picture->sample(u[0] + at.b * u[1] + at.c * u[2], v[0] + at.b * v[1] + at.c * v[2], wrap_u,
                             wrap_v, filter, detail);
    }
  };
  Weights weights_at(int x, int y, int z) const;
  void lay(Map& map, const PictureLevels& picture, const std::vector<glm::vec2>& uvs,
           const MeshTriangle& triangle) const;
  const MeshMaterial* material_;
  Map emission_;

 private:
  Shade shade(Float4 texel, Float4 tint, Float4 glow) const;
  std::array<Place, 3> corners_{};
  Place gradient_[2];          ///< of the weights of the second and the third corner
  double weight_[2] = {0, 0};  ///< at the first corner
  Map color_;
  bool tinted_ = false;  ///< has colours at its corners
  Float4 tint_[3];
  Shade plain_;  ///< where it is the same everywhere
};

/// The mean over the triangles in a voxel.
class ShadeMean {
 public:
  void add(const Shade& shade, double area) {
    // Whatever is there counts; order does not matter.
    const uint64_t weight = (1 + static_cast<uint64_t>(area * 65536)) * shade.cover();
    weight_ += weight;
    most_ = std::max(most_, shade.cover());
    for (size_t c = 0; c < 3; ++c) light_[c] += static_cast<unsigned __int128>(weight) * shade.light(c);
  }
  /// Whether one of them covers enough.
  bool there() const { return most_ >= least_cover; }
  std::array<uint16_t, 3> light() const {
    std::array<uint16_t, 3> out;
    for (size_t c = 0; c < 3; ++c) out[c] = static_cast<uint16_t>((light_[c] + weight_ / 2) / weight_);
    return out;
  }

 private:
  uint8_t most_ = 0;
  unsigned __int128 weight_ = 0;
  std::array<unsigned __int128, 3> light_{};
};

}  // namespace voxkit::color
