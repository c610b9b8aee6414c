// Volumes that are computed, not stored: what is behind names such as "menger:5".
// All are random access, thread-safe and hold no voxels; the same name gives the same voxels on every
// machine.
#pragma once

#include <array>
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

/// The test signal of Marschner and Lobb (1994), f_M = 6, alpha = 0.25, at a point of [-1, 1]^3: nearly all
/// of its spectrum lies below the Nyquist frequency of 40 samples a side. In 0 … 1. Equal to the last bit on
/// every machine (it calls no sin or cos of the system, whose last bits differ).
double marschner_lobb(double x, double y, double z);
/// Its gradient there, per unit length.
std::array<double, 3> marschner_lobb_gradient(double x, double y, double z);
/// builtin_fields.cc: that signal at `side` >= 2 samples along each axis of [-1, 1], both ends included, as
/// DENSITY16: round(65535 rho). Slope, spacing and origin of the info give back rho and the coordinates.
std::unique_ptr<VolumeSource> marschner_lobb_source(int64_t side);

/// builtin_fields.cc: a ball of radius 0.4 side in the middle of side^3 voxels (side >= 1), as DENSITY8: 255
/// inside, 0 outside, and round(255 (1/2 + R - d)) where the centre of the voxel is within half a voxel of
/// the surface. Exact: in whole numbers. `uniform` knows every box that is inside or outside as a whole.
std::unique_ptr<VolumeSource> sphere_source(int64_t side);

/// builtin_noise.cc: independent bytes, all 256 values equally likely, side^3 (side >= 1) as DENSITY8:
/// nothing compresses it.
std::unique_ptr<VolumeSource> noise_source(int64_t side, uint64_t seed);

/// builtin_membrane.cc: what an electron microscope sees of nervous tissue, as DENSITY8: bright cells of some
/// 100 voxels across with dark curved membranes that meet in threes, dark round organelles, uneven staining,
/// and sensor noise of a few grey levels that differs from section to section (z) while the tissue changes
/// slowly. dims: any volume.
std::unique_ptr<VolumeSource> membrane_source(Index3 dims, uint64_t seed);

/// builtin_cells.cc: a segmentation, `count` cells in side^3 voxels: each voxel is in the cell of the nearest
/// of so many random points. Labels of 32 bits that lie far apart, by a table, as DENSITY8 or, of more than
/// 256 cells, DENSITY16. side >= 1; count 1 to most_cells.
inline constexpr uint64_t most_cells = 65536;
std::unique_ptr<VolumeSource> cells_source(int64_t side, int64_t count);

}  // namespace voxkit
