// How far one volume is from another: PSNR and its relatives, streaming, in bounded memory.
#pragma once

#include <cstdint>
#include <optional>

#include "formats/context.h"
#include "formats/source.h"
#include "libmetrics/error_histogram.h"

namespace voxkit {

/// The differences between A (the reference) and B. Errors are per sample: colours have 3 or 4 samples a
/// voxel.
struct VolumeDiff {
  Index3 dims{0};
  uint64_t voxels = 0;
  VoxelFormat voxel_format{};  ///< of A
  std::string_view type_name;  ///< of A, as type_name() says it
  double peak = 0;             ///< full_scale(A), or what the caller said
  double mse = 0, rmse = 0;    ///< over all samples, alpha included
  double psnr_db = 0;          ///< 10 log10(peak^2 / mse); infinite where nothing differs
  double snr_db = 0;           ///< 10 log10(mean square of A / mse)
  double max_abs_error = 0, mean_abs_error = 0;
  double max_distance = 0;        ///< greatest Euclidean distance of two voxels; for scalars max_abs_error
  uint64_t differing_voxels = 0;  ///< voxels whose bytes differ (of different formats: whose values differ)
  std::optional<double> grmse;    ///< colours: sqrt(sum of squared R, G, B errors / 3 voxels)
  std::optional<double> grmse_distance;  ///< colours: sqrt(sum of squared R, G, B errors / voxels)
};

/// Compares two volumes of the same extent. Scalars are compared as sample values (biases removed, scales not
/// applied), integers in exact integer arithmetic, others in double precision in a fixed order: the result is
/// the same for any number of threads. RGB24 beside RGBA32 has alpha 255. A NaN beside a NaN is no error;
/// beside a number it is an infinite one. Boxes where both sources are uniform are not read. `peak`:
/// overrides full_scale. `errors`: nullptr, or a sink of `error_volume_info` that receives |A - B| and is
/// finished. `histogram`: nullptr, or what is set to the histogram of the errors. Errors: ErrorCode::usage
/// where extents differ or a colour meets a scalar; those of the sources and the sink.
Result<VolumeDiff> diff_volumes(VolumeSource& a, VolumeSource& b, std::optional<double> peak,
                                VolumeSink* errors, Context& ctx, ErrorHistogram* histogram = nullptr);

/// What |A - B| is stored as: the format of both, without bias, or FLOAT32 where they differ.
VolumeInfo error_volume_info(const VolumeInfo& a, const VolumeInfo& b);

}  // namespace voxkit
