// Voxels that are written one by one, where almost all of a volume is void.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "formats/result.h"

namespace voxkit {

/// A voxel: its place, its colour as R, G, B in sRGB, and the number of that in a palette, where it is of
/// one.
struct ModelVoxel {
  std::array<int32_t, 3> place;
  std::array<uint8_t, 3> color;
  uint8_t number = 0;
};

class VoxelSink {
 public:
  virtual ~VoxelSink() = default;
  /// Takes voxels inside the volume, in any order; fast where neighbours come after each other.
  virtual Status add(std::span<const ModelVoxel> voxels) = 0;
  /// Completes the file; without it, it never appears.
  virtual Status finish() = 0;
};

}  // namespace voxkit
