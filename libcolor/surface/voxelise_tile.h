// The voxels of a cube of a surface.
#pragma once

#include <span>
#include <vector>

#include "libcolor/surface/surface_batches.h"
#include "libcolor/surface/voxelise_traits.h"

namespace voxkit::color {

/// Memory that a thread works with, kept from cube to cube.
class TileWork {
 public:
  /// Bytes for cubes of up to 2^bits voxels a side, at most, of a scene with or without attributes.
  static uint64_t bytes(int bits, bool with_attributes);

  /// Appends the voxels of `cube` in Morton order, and the attributes that the scene says. `triangles` has
  /// those that touch it, ascending.
  Status run(const VoxelScene& scene, const Cube& cube, std::span<const uint32_t> triangles, VoxelBatch& out);

 private:
  /// A voxel's code in the cube, above 32 bits with the number of a triangle in the list.
  using Pair = uint64_t;
  Status split(const VoxelScene& scene, const Cube& cube, std::span<const uint32_t> triangles,
               VoxelBatch& out);
  static void one_voxel(const VoxelScene& scene, const Cube& cube, std::span<const uint32_t> triangles,
                        std::vector<SurfaceVoxel>& out);
  static void one_voxel_of_traits(const VoxelScene& scene, const Cube& cube,
                                  std::span<const uint32_t> triangles, VoxelBatch& out);
  template <class OfTriangle>
  bool collect(const VoxelScene& scene, const Cube& cube, std::span<const uint32_t> triangles,
               std::vector<OfTriangle>& list);
  void sort(int code_bits);
  void color(const Cube& cube, std::vector<SurfaceVoxel>& out) const;
  void color_and_attribute(const VoxelScene& scene, const Cube& cube, VoxelBatch& out) const;

  std::vector<Pair> pairs_, other_;
  size_t count_ = 0;
  std::vector<TriangleShade> shades_;   ///< of a scene without attributes
  std::vector<TriangleTraits> traits_;  ///< of one with them
};

/// Morton code of the lowest voxel of a cube.
inline uint64_t first_place(const Cube& cube) {
  return spread_bits(static_cast<uint64_t>(cube.lo[0])) |
         spread_bits(static_cast<uint64_t>(cube.lo[1])) << 1 |
         spread_bits(static_cast<uint64_t>(cube.lo[2])) << 2;
}

/// One of the eight cubes that a cube consists of, in Morton order.
inline Cube child_of(const Cube& cube, int child) {
  Cube out{cube.lo, cube.bits - 1};
  for (size_t axis = 0; axis < 3; ++axis) out.lo[axis] += ((child >> axis) & 1) << out.bits;
  return out;
}

/// Appends to list[i] the triangles that touch child i.
void divide(const VoxelScene& scene, const Cube& cube, std::span<const uint32_t> triangles,
            std::array<std::vector<uint32_t>, 8>& lists);

}  // namespace voxkit::color
