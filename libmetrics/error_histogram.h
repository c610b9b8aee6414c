// How the absolute errors of a comparison are distributed.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace voxkit {

/// Counts of errors, of every sample one, in bins that depend on the kind of the samples only, so that
/// histograms can be compared and added.
class ErrorHistogram {
 public:
  /// bytes: 8 bit integers; one bin for each error. whole: wider integers, real: floats; one bin for 0, then
  /// eight of equal width from each power of two to the next: whole errors below 16 have a bin each, others
  /// share it with those that are less than an eighth greater.
  enum class Kind { bytes, whole, real };

  explicit ErrorHistogram(Kind kind = Kind::bytes)
      : kind_(kind), counts_(kind == Kind::bytes ? 384 : bins_below_infinity + 1) {}

  /// Counts an error, at least 0 and no NaN, `times` over.
  void add(double error, uint64_t times = 1) {
    counts_[bin_of(error)] += times;
    greatest_ = std::max(greatest_, error);
  }
  /// Adds the counts of a histogram of the same kind. The order of additions makes no difference.
  void add(const ErrorHistogram& other);

  struct Bin {
    double least = 0;  ///< the bin's first error; the last bin of whole and real holds infinity only
    uint64_t count = 0;
  };
  /// The bins that are not empty, from the least errors to the greatest.
  std::vector<Bin> bins() const;
  uint64_t samples() const;
  /// An error that at least `share` (0 < share <= 1) of all samples do not exceed: the greatest of the bin in
  /// which they end, and never more than the greatest of all. 0 where nothing was counted.
  double percentile(double share) const;

 private:
  // The exponent of a double and the three bits after it, from those of the least difference of two floats.
  static constexpr int shift = 52 - 3;
  static constexpr uint64_t least = std::bit_cast<uint64_t>(0x1p-149) >> shift;
  static constexpr uint64_t greatest = std::bit_cast<uint64_t>(0x1.cp129) >> shift;
  static constexpr size_t bins_below_infinity = greatest - least + 2;

  size_t bin_of(double error) const {
    if (kind_ == Kind::bytes) return std::min(static_cast<size_t>(error), counts_.size() - 1);
    if (std::isinf(error)) return bins_below_infinity;
    const uint64_t bits = std::bit_cast<uint64_t>(error) >> shift;
    return bits < least ? 0 : std::min<size_t>(bits - least + 1, bins_below_infinity - 1);
  }
  double least_of(size_t bin) const {
    if (kind_ == Kind::bytes) return static_cast<double>(bin);
    if (bin == bins_below_infinity) return std::numeric_limits<double>::infinity();
    return bin == 0 ? 0 : std::bit_cast<double>((bin - 1 + least) << shift);
  }

  Kind kind_;
  std::vector<uint64_t> counts_;
  double greatest_ = 0;
};

}  // namespace voxkit
