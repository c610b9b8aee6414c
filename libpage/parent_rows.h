// The parents of a page's voxels, and what they add to the plan of a row.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "libpage/page.h"
#include "libpage/predictor.h"

namespace voxkit::page {

/// The parents along a side of a page, and one before and one behind these.
inline constexpr int parent_side = max_side / 2 + 2;

/// Which neighbour of its parent a voxel is next to.
constexpr int toward(int at) {
  return at % 2 != 0 ? 1 : -1;
}

/// Parents as a model has them, twice along x, so that each stands where its children are.
template <class Stored>
struct ParentRows {
  using Row = std::array<Stored, row_stride>;
  std::array<std::array<Row, parent_side>, parent_side> rows;

  /// From the page of parents, of which each sample is taken through `stored`. Outside it there are the
  /// nearest inside.
  template <class T, class StoredOf>
  void load(const Parent<T>& parent, Extent extent, const StoredOf& stored) {
    const Extent e = parent.extent;
    const int nz = (extent.nz + 1) / 2 + 2, ny = (extent.ny + 1) / 2 + 2;
    for (int z = 0; z < nz; ++z)
      for (int y = 0; y < ny; ++y) {
        const int from_z = std::clamp(parent.z + z - 1, 0, e.nz - 1),
                  from_y = std::clamp(parent.y + y - 1, 0, e.ny - 1);
        const T* const from = parent.samples.data() + (from_z * e.ny + from_y) * e.nx;
        Stored* const to = rows[static_cast<size_t>(z)][static_cast<size_t>(y)].data() + row_start - 2;
        for (int x = 0; x < parent_side; ++x)
          to[2 * x] = to[2 * x + 1] = stored(from[std::clamp(parent.x + x - 1, 0, e.nx - 1)]);
      }
  }
  /// Of row (y, z): the row of its parents; those next to its voxels along y, z and both; those on the other
  /// side along y and z.
  std::array<const Stored*, 6> around(int y, int z) const {
    const auto row = [&](int py, int pz) {
      return rows[static_cast<size_t>(pz + 1)][static_cast<size_t>(py + 1)].data() + row_start;
    };
    const int py = y / 2, pz = z / 2, dy = toward(y), dz = toward(z);
    return {row(py, pz),           row(py + dy, pz), row(py, pz + dz),
            row(py + dy, pz + dz), row(py - dy, pz), row(py, pz - dz)};
  }
};

/// Which of its parent's children the first voxel of a row is; the next one has a number higher by one.
constexpr uint32_t first_child(int y, int z) {
  return static_cast<uint32_t>((z & 1) * 4 + (y & 1) * 2);
}

/// Whether the parents of all voxels of a page that begin at (x, y, z) of theirs are in it.
inline bool covers(Extent parents, int x, int y, int z, Extent extent) {
  return parents.valid() && x >= 0 && y >= 0 && z >= 0 && x < parents.nx && y < parents.ny &&
         z < parents.nz && x + (extent.nx + 1) / 2 <= parents.nx && y + (extent.ny + 1) / 2 <= parents.ny &&
         z + (extent.nz + 1) / 2 <= parents.nz;
}
/// Whether a page of parents has those of all voxels of a page, and is whole.
template <class T>
bool covers(const Parent<T>& parent, Extent extent) {
  return covers(parent.extent, parent.x, parent.y, parent.z, extent) &&
         parent.samples.size() == static_cast<size_t>(parent.extent.voxels());
}

}  // namespace voxkit::page
