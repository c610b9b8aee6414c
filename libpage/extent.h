// How large a page is.
#pragma once

namespace voxkit::page {

/// The longest side of a page.
inline constexpr int max_side = 16;
inline constexpr int max_voxels = max_side * max_side * max_side;

/// Voxels of a page along x (fastest in memory), y and z; each 1..16. Pages at the end of a volume may be
/// shorter than others.
struct Extent {
  int nx = max_side, ny = max_side, nz = max_side;
  int voxels() const { return nx * ny * nz; }
  bool valid() const {
    return nx >= 1 && ny >= 1 && nz >= 1 && nx <= max_side && ny <= max_side && nz <= max_side;
  }
  friend bool operator==(const Extent&, const Extent&) = default;
};

}  // namespace voxkit::page
