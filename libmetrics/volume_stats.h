// What values a volume has: extremes, moments, percentiles, entropy and a histogram, streaming, in bounded
// memory.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "formats/context.h"
#include "formats/source.h"

namespace voxkit {

/// The samples of a scalar volume, or of one channel of colours, that are finite and not the fill value; as
/// sample values (biases removed, scales not applied).
struct SampleStats {
  static constexpr std::array<double, 9> shares = {0.1, 1, 5, 25, 50, 75, 95, 99, 99.9};  ///< percent

  uint64_t samples = 0;
  // All 0 where there are no samples:
  double least = 0, greatest = 0, mean = 0;
  double deviation = 0;  ///< root of the mean squared distance from the mean
  /// The least value that so many percent of the samples, of `shares`, are not above; of floats of more than
  /// 65536 different values up to a 65536th of the range above it.
  std::array<double, shares.size()> percentiles{};
  /// Of integers, and of floats of up to 65536 different values:
  std::optional<uint64_t> different;
  std::optional<double> entropy;  ///< of order 0, bits a sample

  static constexpr int most_bins = 64;
  double bin_width = 0;             ///< of integers a whole number
  std::vector<uint64_t> histogram;  ///< samples by value, from `least` on, in bins of this width
};

struct VolumeStats {
  uint64_t voxels = 0;
  uint64_t void_voxels = 0;  ///< of the value 0; of colours with an alpha of 0
  uint64_t fill = 0;         ///< of the fill value
  uint64_t nan = 0, infinite = 0;
  std::vector<SampleStats> channels;  ///< one, or R, G, B and, where there is one, A
};

/// Reads all voxels once; boxes that are known to be uniform are not read. `range`: of FLOAT32, as from
/// measure_range; of others unused. Counts are whole numbers and sums are of them, so the result is the same
/// for any number of threads. Memory: up to 4 MiB a thread. A forward-only source is used up. Errors: those
/// of the source; ErrorCode::limit.
Result<VolumeStats> volume_stats(VolumeSource& source, const ValueRange& range, Context& ctx);

}  // namespace voxkit
