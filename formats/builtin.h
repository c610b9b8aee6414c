// Volumes that are computed, not stored: what is behind names such as "menger:5".
// All are random access, thread-safe and hold no voxels; the same name gives the same voxels on every
// machine.
#pragma once

#include <cstdint>
#include <memory>

#include "formats/source.h"

namespace voxkit {

/// Highest level whose voxels can be counted in 62 bits.
inline constexpr int max_menger_level = 13;

/// builtin_menger.cc: the Menger sponge of 3^level voxels a side, level 0 … max_menger_level, as RGBA32. A
/// voxel is void (0,0,0,0) where two or more of x, y, z have the ternary digit 1 in the same place; of the
/// others, 20^level in number, the colour is (255 x / N, 255 y / N, 255 z / N, 255), fractions dropped.
/// `uniform` knows single voxels and every box that lies in one of the sponge's holes.
std::unique_ptr<VolumeSource> menger_source(int level);

}  // namespace voxkit
