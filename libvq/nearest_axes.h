// The axes along which bricks differ most.
#pragma once

#include <array>
#include <span>

#include "libvq/brick.h"

namespace voxkit::vq {

using Axis = std::array<double, brick_voxels>;

/// The mean of a sample of bricks, at most 2^13 of them, and its principal components: orthonormal, up to
/// rounding, those of the greatest variance first.
struct PrincipalAxes {
  Axis mean;
  std::array<Axis, brick_voxels> axes;
};
PrincipalAxes principal_axes(std::span<const Brick> bricks);

}  // namespace voxkit::vq
