// A volume with its axes in another order or direction: voxels move, places do not.
#pragma once

#include <array>
#include <memory>
#include <string_view>

#include "formats/context.h"
#include "formats/source.h"

namespace voxkit {

/// For each axis of a new volume: which one of the old it is, and whether it runs the other way.
struct AxisOrder {
  std::array<int, 3> from{0, 1, 2};  ///< each of 0, 1, 2 once
  std::array<bool, 3> reversed{};
  bool is_identity() const;
};

/// The same voxels with their axes so; the affine follows, so that no voxel changes its place. A source that
/// is read front to back stays that where z is the slowest axis still, in its direction; else it is spooled,
/// decoded, to a temporary file first. Errors: those of the source.
Result<std::unique_ptr<VolumeSource>> reordered(std::unique_ptr<VolumeSource> source, const AxisOrder& order,
                                                Context& ctx);

/// The order that makes a volume's axes point, mostly, to sides of a patient, as in "RAS", "LPS", "IAR": one
/// of L and R, of P and A, of I and S each. "canonical" is RAS, or +x +y +z of worlds that are not
/// anatomical. Errors: ErrorCode::usage for other words, and for letters where the world of `info` is not
/// anatomical.
Result<AxisOrder> order_for(std::string_view orientation, const VolumeInfo& info);

}  // namespace voxkit
