#include "libmetrics/error_histogram.h"

namespace voxkit {

void ErrorHistogram::add(const ErrorHistogram& other) {
  for (size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
  greatest_ = std::max(greatest_, other.greatest_);
}

std::vector<ErrorHistogram::Bin> ErrorHistogram::bins() const {
  std::vector<Bin> bins;
  for (size_t i = 0; i < counts_.size(); ++i)
    if (counts_[i] > 0) bins.push_back({least_of(i), counts_[i]});
  return bins;
}

uint64_t ErrorHistogram::samples() const {
  uint64_t sum = 0;
  for (const uint64_t count : counts_) sum += count;
  return sum;
}

double ErrorHistogram::percentile(double share) const {
  const double wanted = share * static_cast<double>(samples());
  uint64_t below = 0;
  for (size_t i = 0; i < counts_.size(); ++i) {
    below += counts_[i];
    if (below == 0 || static_cast<double>(below) < wanted) continue;
    if (kind_ == Kind::bytes || i == 0 || i == bins_below_infinity) return least_of(i);
    // Whole errors end before the next bin begins.
    const double next = std::bit_cast<double>((i + least) << shift);
    return std::min(kind_ == Kind::whole ? std::ceil(next) - 1 : next, greatest_);
  }
  return 0;
}

}  // namespace voxkit
