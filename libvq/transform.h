// The four folded transforms of the codebook: what is stored of a brick instead of its voxels.
//
// A brick's voxels less their minimum, u, lie in 0 .. top = max - min. A transform predicts each voxel from
// those before it in raster order and folds the difference into 0 .. top, so that no residual needs more bits
// than the voxels did (Guthe and Goesele 2016, section 3.1, name neither predictors nor folds; these were
// chosen by size among all quadruples of 13 predictors and 2 folds, on nine CT, MR, microscopy and simulation
// volumes).
#pragma once

#include <cstdint>

#include "formats/hd.h"
#include "libvq/brick.h"

namespace voxkit::vq {

/// Numbers are part of FORMAT.md. A, B and C are the neighbours below in x, y and z, 0 outside the brick; a
/// plane through three neighbours predicts A + B - AB, brought into 0 .. top.
enum class Transform : uint8_t {
  none = 0,            ///< the voxel itself
  previous = 1,        ///< A, or on the faces B, or C; folded modulo
  median_modulo = 2,   ///< median of the three planes; folded modulo
  median_bounded = 3,  ///< the same, but on the faces the plane that lies in the face; folded to the bounds
};
inline constexpr int transforms = 4;

/// The nearer of p + e and p + e -/+ (top + 1), with small codes for small |e|: 0, -1, 1, -2 ...
VOX_HD_HOT uint32_t fold_modulo(uint32_t voxel, uint32_t predicted, uint32_t top) {
  const uint32_t up = voxel >= predicted ? voxel - predicted : top + 1 - (predicted - voxel);  // 0 .. top
  return 2 * up <= top ? 2 * up : 2 * (top + 1 - up) - 1;
}
/// The inverse; codes 0 .. top only. Without branches, which could not be foreseen.
VOX_HD_HOT uint32_t unfold_modulo(uint32_t code, uint32_t predicted, uint32_t top) {
  const uint32_t odd = 0 - (code & 1);
  const uint32_t voxel = predicted + ((code >> 1) ^ odd) + (odd & (top + 1));
  return voxel - ((0 - static_cast<uint32_t>(voxel > top)) & (top + 1));
}

/// Codes alternate between both sides, 0, -1, 1, -2 ..., until one is used up; what follows counts on along
/// the other.
VOX_HD_HOT uint32_t fold_bounded(uint32_t voxel, uint32_t predicted, uint32_t top) {
  const uint32_t near = predicted <= top - predicted ? predicted : top - predicted;
  const uint32_t distance = voxel >= predicted ? voxel - predicted : predicted - voxel;
  if (distance > near) return distance + near;
  return voxel >= predicted ? 2 * distance : 2 * distance - 1;
}
/// The inverse; codes 0 .. top only. Most are on both sides, so only what is not is worth a branch.
VOX_HD_HOT uint32_t unfold_bounded(uint32_t code, uint32_t predicted, uint32_t top) {
  const uint32_t room = top - predicted, near = predicted <= room ? predicted : room;
  if (code > 2 * near) return predicted <= room ? code : top - code;
  return predicted + ((code >> 1) ^ (0 - (code & 1)));
}

VOX_HD_HOT uint32_t least(uint32_t a, uint32_t b) {
  return a < b ? a : b;
}
VOX_HD_HOT uint32_t greatest(uint32_t a, uint32_t b) {
  return a < b ? b : a;
}
/// a + b - ab, brought into 0 .. top.
VOX_HD_HOT uint32_t plane(uint32_t a, uint32_t b, uint32_t ab, uint32_t top) {
  return least(greatest(a + b, ab) - ab, top);
}
VOX_HD_HOT uint32_t median(uint32_t a, uint32_t b, uint32_t c) {
  return greatest(least(a, b), least(greatest(a, b), c));
}

/// The median of the planes through the neighbours below along x, y and z (a, b, c) and along two of these.
VOX_HD_HOT uint32_t predict_median(uint32_t a, uint32_t b, uint32_t c, uint32_t ab, uint32_t ac, uint32_t bc,
                                   uint32_t top) {
  return median(plane(a, b, ab, top), plane(a, c, ac, top), plane(b, c, bc, top));
}

template <Transform transform>
VOX_HD_HOT void invert_as(uint16_t* u, uint32_t top) {
  const uint16_t outside[4] = {};
  for (uint32_t z = 0; z < 4; ++z)
    for (uint32_t y = 0; y < 4; ++y) {
      uint16_t* const row = u + 4 * y + 16 * z;
      const uint16_t* const below_y = y ? row - 4 : outside;
      const uint16_t* const below_z = z ? row - 16 : outside;
      const uint16_t* const below_yz = y && z ? row - 20 : outside;
      uint32_t a = 0, ab = 0, ac = 0;
      for (uint32_t x = 0; x < 4; ++x) {
        const uint32_t b = below_y[x], c = below_z[x], bc = below_yz[x];
        uint32_t voxel;
        if constexpr (transform == Transform::previous) {
          voxel = unfold_modulo(row[x], x ? a : y ? b : c, top);
        } else if constexpr (transform == Transform::median_modulo) {
          voxel = unfold_modulo(row[x], predict_median(a, b, c, ab, ac, bc, top), top);
        } else {
          const uint32_t predicted = !z   ? plane(a, b, ab, top)
                                     : !y ? plane(a, c, ac, top)
                                     : !x ? plane(b, c, bc, top)
                                          : predict_median(a, b, c, ab, ac, bc, top);
          voxel = unfold_bounded(row[x], predicted, top);
        }
        row[x] = static_cast<uint16_t>(voxel);
        a = voxel;
        ab = b;
        ac = c;
      }
    }
}

/// Residuals become voxels, in place, in raster order: all <= top before, and so after.
VOX_HD_HOT void invert(Transform transform, uint16_t* u, uint32_t top) {
  switch (transform) {
    case Transform::none:
      break;
    case Transform::previous:
      return invert_as<Transform::previous>(u, top);
    case Transform::median_modulo:
      return invert_as<Transform::median_modulo>(u, top);
    case Transform::median_bounded:
      return invert_as<Transform::median_bounded>(u, top);
  }
}

}  // namespace voxkit::vq
