#include "libcolor/edit/lattice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "libcolor/surface/surface.h"

namespace voxkit::color {
namespace {

using Vector = Affine::Vector;

constexpr double tolerance = 0.01;  // of a voxel
constexpr double most_steps = int64_t{1} << (most_levels + 1);

/// The index, in whole and broken steps, of a place.
Vector index_of(const Affine& affine, const Vector& place) {
  const double determinant = affine.determinant();
  Vector index;
  for (size_t a = 0; a < 3; ++a) {
    // Cramer's rule: the place instead of axis a.
    Affine other = affine;
    for (size_t b = 0; b < 3; ++b) other.axes[a][b] = place[b] - affine.origin[b];
    index[a] = other.determinant() / determinant;
  }
  return index;
}

/// Where the first voxel of one grid is in another, if all its corners are on voxels of that.
std::optional<Index3> steps_between(const VolumeInfo& from, const VolumeInfo& to) {
  const Vector first = index_of(from.affine, to.affine.origin);
  Index3 at;
  for (size_t a = 0; a < 3; ++a) {
    if (!(std::abs(first[a]) <= most_steps)) return std::nullopt;
    at[static_cast<int>(a)] = std::llround(first[a]);
  }
  for (uint32_t corner = 0; corner < 8; ++corner) {
    Vector own{};
    for (size_t a = 0; a < 3; ++a)
      if ((corner >> a & 1) != 0) own[a] = static_cast<double>(to.dims[static_cast<int>(a)] - 1);
    const Vector there = index_of(from.affine, to.affine.place(own));
    for (size_t a = 0; a < 3; ++a)
      if (!(std::abs(there[a] - own[a] - static_cast<double>(at[static_cast<int>(a)])) <= tolerance))
        return std::nullopt;
  }
  return at;
}

std::string world_of(const VolumeInfo& info) {
  return fmt::format("world {}, unit {}", name(info.world), name(info.unit));
}

}  // namespace

Result<CommonGrid> common_grid(std::span<const VolumeInfo> volumes, std::span<const std::string> names) {
  const VolumeInfo& first = volumes.front();
  CommonGrid grid{first, {}, {}};
  Index3 lo(0), hi = first.dims;
  for (size_t i = 0; i < volumes.size(); ++i) {
    const VolumeInfo& own = volumes[i];
    if (own.world != first.world || own.unit != first.unit)
      return bad_input(names[i],
                       fmt::format("{}: expected {}, as of {}", world_of(own), world_of(first), names[0]));
    const auto at = steps_between(first, own);
    if (!at) {
      const Vector index = index_of(first.affine, own.affine.origin);
      return bad_input(
          names[i], fmt::format("its first voxel is at {:.9g}, {:.9g}, {:.9g} in steps of {}: expected whole "
                                "numbers up to {}, and axes that are equal",
                                index[0], index[1], index[2], names[0], int64_t{1} << (most_levels + 1)));
    }
    grid.at.push_back(*at);
    for (int a = 0; a < 3; ++a) {
      lo[a] = std::min(lo[a], (*at)[a]);
      hi[a] = std::max(hi[a], (*at)[a] + own.dims[a]);
    }
    if (own.description != first.description && !own.description.empty())
      grid.notes.push_back(fmt::format("{}: dropped: its description", names[i]));
    if (own.space_code != first.space_code)
      grid.notes.push_back(fmt::format("{}: dropped: space code {}: {} of {} counts", names[i],
                                       int{own.space_code}, int{first.space_code}, names[0]));
  }
  grid.info.dims = hi - lo;
  if (std::max({grid.info.dims.x, grid.info.dims.y, grid.info.dims.z}) > int64_t{1} << most_levels ||
      !checked_voxels(grid.info.dims))
    return bad_input({},
                     fmt::format("a grid of {} x {} x {} voxels would hold all: expected at most {} a side, "
                                 "and 2^62 of them",
                                 grid.info.dims.x, grid.info.dims.y, grid.info.dims.z, 1 << most_levels));
  const auto corner = std::find(grid.at.begin(), grid.at.end(), lo);
  grid.info.affine = corner == grid.at.end()
                         ? first.affine.moved_to({static_cast<double>(lo.x), static_cast<double>(lo.y),
                                                  static_cast<double>(lo.z)})
                         : first.affine;
  // Of a volume that begins where the grid does the origin is as it is, without rounding.
  if (corner != grid.at.end())
    grid.info.affine.origin = volumes[static_cast<size_t>(corner - grid.at.begin())].affine.origin;
  for (Index3& at : grid.at) at -= lo;
  return grid;
}

}  // namespace voxkit::color
