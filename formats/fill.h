// Values that stand for "nothing was measured here": kept apart from those that were.
//
// In a FLOAT32 volume with VolumeInfo::fill such voxels are NaN while they are worked on, which no range,
// average or quantiser counts; files of other formats get the value itself back.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "formats/context.h"
#include "formats/source.h"

namespace voxkit {

/// FLOAT32: voxels of the value `fill`, and NaN, become NaN, and info().fill is the value. Of integers only
/// the latter; they keep it as a voxel. Of colours nothing. `fill` NaN: there is no other value than NaN for
/// it. `note`, if given, hears that there are NaN, which a reader will find as the value.
std::unique_ptr<VolumeSource> with_fill(std::unique_ptr<VolumeSource> source, double fill,
                                        const std::function<void(const std::string&)>& note = {});

/// The other way, for writers: NaN of a FLOAT32 volume with a fill value becomes that value.
std::unique_ptr<VolumeSource> fill_restored(std::unique_ptr<VolumeSource> source);

/// What values a FLOAT32 volume has.
struct Census {
  ValueRange range;  ///< of finite values; 0 to 0 where there are none
  std::optional<double>
      outlier;      ///< the least or the greatest value, where it is the only one of its kind, see below
  ValueRange rest;  ///< without the outlier
  bool has_nan = false;
};
/// The outlier: a value that lies more than 1000 times the extent of all other finite values away from them;
/// these must be at least two different ones. It is likely to be a fill value. A forward-only source is used
/// up.
Result<Census> take_census(VolumeSource& source, Context& ctx);

}  // namespace voxkit
