// Sources made from sources: part of a volume, another size, another type of voxel. Voxels are made as they
// are read.
#pragma once

#include <memory>
#include <string_view>

#include "formats/context.h"
#include "formats/source.h"

namespace voxkit {

/// The voxels of `box`, which must lie inside the volume and not be empty (ErrorCode::usage). The origin
/// moves along.
Result<std::unique_ptr<VolumeSource>> crop(std::unique_ptr<VolumeSource> source, const Box& box,
                                           Context& ctx);

/// The volume at another size (each side 1..2^20), independently along each axis: linear between voxel
/// centres where there are more voxels than before, the average over each voxel's extent where there are
/// fewer. Labels are those of the nearest voxel. Integers are averaged exactly and rounded half up; colours
/// of RGBA32 are weighted by alpha. Spacing and origin follow. Not for forward-only sources
/// (ErrorCode::usage), nor for voxels that cover more than 2^24 of the source's.
Result<std::unique_ptr<VolumeSource>> resample(std::unique_ptr<VolumeSource> source, Index3 dims);

/// What voxels are converted to.
struct TargetType {
  VoxelFormat format = VoxelFormat::density8;
  SampleType sample_type = SampleType::u8;  ///< scalars only
};
/// "u8", "i8", "u16", "i16", "f32", "rgba8", "bit".
Result<TargetType> parse_target_type(std::string_view name);
std::vector<std::string> target_type_names();

/// True if `convert_type` needs the range of the source's values: not every value that the source may have
/// fits.
bool needs_range(const VolumeInfo& info, const TargetType& type);

/// Voxels as another type.
/// - Values that fit keep their sample values (biases are added and removed).
/// - Where needs_range: if the source's samples are integers and `range` fits the type, values are kept too;
/// otherwise
///   `range` is mapped linearly to the whole type (what is outside goes to its ends, NaN to the least value),
///   rounded to nearest, and slope and intercept are changed so that real values stay what they were, as well
///   as can be.
/// - Scalars become (g, g, g, g) for RGBA32, with g as for u8: density determines colour and coverage. Bits
/// become 0 or 255.
/// - Colours become scalars by their luma of Rec. 709 (for RGBA32 times alpha), in integers, rounded to
/// nearest.
/// - A bit is whether the sample value is not zero (RGBA32: alpha; RGB24: any channel; NaN: no).
/// `range`: stored values, as from `measure_range`; unused unless needs_range.
Result<std::unique_ptr<VolumeSource>> convert_type(std::unique_ptr<VolumeSource> source,
                                                   const TargetType& type, const ValueRange& range,
                                                   Context& ctx);

/// Real values as FLOAT32: slope * sample + intercept, in double precision, rounded once. Scalars only.
Result<std::unique_ptr<VolumeSource>> apply_scale(std::unique_ptr<VolumeSource> source, Context& ctx);

}  // namespace voxkit
