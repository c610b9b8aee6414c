#include "libmetrics/volume_stats.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <utility>

#include "formats/copy.h"
#include "formats/reservation.h"

namespace voxkit {
namespace {

constexpr size_t fine_bins = 1 << 16;  // of floats
constexpr size_t most_different = 1 << 16;
constexpr double most_step = 0x1p40;  // floats are summed as whole parts of their range

/// Floats of one value, counted while there are few.
class Different {
 public:
  static constexpr uint64_t most_bytes = most_different * uint64_t{48};  ///< nodes of a table, and the table

  void add(float value, uint64_t times) {
    if (!few_) return;
    uint32_t bits;
    const float one_zero = value == 0 ? 0 : value;
    std::memcpy(&bits, &one_zero, sizeof bits);
    add_bits(bits, times);
  }
  void add_bits(uint32_t bits, uint64_t times) {
    if (!few_) return;
    counts_[bits] += times;
    if (counts_.size() > most_different) {
      few_ = false;
      counts_.clear();
    }
  }
  void merge(const Different& other) {
    if (!other.few_) {
      few_ = false;
      counts_.clear();
    }
    for (const auto& [bits, times] : other.counts_) add_bits(bits, times);
  }
  bool few() const { return few_; }
  /// The values, ascending, and how often each comes.
  std::pair<std::vector<double>, std::vector<uint64_t>> sorted() const {
    std::vector<std::pair<double, uint64_t>> pairs;
    for (const auto& [bits, times] : counts_) {
      float value;
      std::memcpy(&value, &bits, sizeof value);
      pairs.emplace_back(static_cast<double>(value), times);
    }
    std::sort(pairs.begin(), pairs.end());
    std::pair<std::vector<double>, std::vector<uint64_t>> sorted;
    for (const auto& [value, times] : pairs) {
      sorted.first.push_back(value);
      sorted.second.push_back(times);
    }
    return sorted;
  }

 private:
  bool few_ = true;
  std::unordered_map<uint32_t, uint64_t> counts_;
};

/// What has been seen of a volume, by one thread or by all.
struct Tally {
  std::vector<std::vector<uint64_t>> counts;  ///< of each channel, by stored value or bin
  uint64_t nan = 0, infinite = 0, fill = 0, zeros = 0;
  // Of floats:
  Different different;
  float least = INFINITY, greatest = -INFINITY;
  __int128 sum = 0, squares = 0;  ///< of steps

  Tally(size_t channels, size_t bins) : counts(channels, std::vector<uint64_t>(bins)) {}
  void merge(const Tally& other) {
    for (size_t c = 0; c < counts.size(); ++c)
      for (size_t i = 0; i < counts[c].size(); ++i) counts[c][i] += other.counts[c][i];
    nan += other.nan, infinite += other.infinite, fill += other.fill, zeros += other.zeros;
    different.merge(other.different);
    least = std::min(least, other.least), greatest = std::max(greatest, other.greatest);
    sum += other.sum, squares += other.squares;
  }
};

/// Tallies that threads take and give back.
class Tallies {
 public:
  Tallies(size_t channels, size_t bins) : channels_(channels), bins_(bins) {}
  std::unique_ptr<Tally> take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique<Tally>(channels_, bins_);
    auto tally = std::move(free_.back());
    free_.pop_back();
    return tally;
  }
  void give(std::unique_ptr<Tally> tally) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(tally));
  }
  Tally all() const {
    Tally sum(channels_, bins_);
    for (const auto& tally : free_) sum.merge(*tally);
    return sum;
  }

 private:
  size_t channels_, bins_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Tally>> free_;
};

/// Floats as whole numbers of steps from the least on, and as bins.
struct FloatScale {
  double least, steps, bins;
  explicit FloatScale(const ValueRange& range) : least(range.lo) {
    const double width = range.hi - range.lo;
    steps = width > 0 ? most_step / width : 0;
    bins = width > 0 ? static_cast<double>(fine_bins) / width : 0;
  }
};

template <class Visit>
void each_row(ConstVoxelSpan voxels, Index3 size, const Visit& visit) {
  for (int64_t z = 0; z < size.z; ++z)
    for (int64_t y = 0; y < size.y; ++y) visit(voxels.row(y, z));
}

template <class T>
void add_integers(ConstVoxelSpan voxels, Index3 size, uint64_t times, Tally& tally) {
  each_row(voxels, size, [&](const std::byte* row) {
    for (int64_t x = 0; x < size.x; ++x) {
      T value;
      std::memcpy(&value, row + x * static_cast<int64_t>(sizeof(T)), sizeof(T));
      tally.counts[0][value] += times;
    }
  });
}

void add_colors(ConstVoxelSpan voxels, Index3 size, uint64_t times, Tally& tally) {
  const size_t channels = tally.counts.size();
  each_row(voxels, size, [&](const std::byte* row) {
    for (int64_t x = 0; x < size.x; ++x)
      for (size_t c = 0; c < channels; ++c)
        tally.counts[c][std::to_integer<size_t>(row[static_cast<size_t>(x) * channels + c])] += times;
  });
}

void add_floats(ConstVoxelSpan voxels, Index3 size, uint64_t times, const std::optional<double>& fill,
                const FloatScale& scale, Tally& tally) {
  each_row(voxels, size, [&](const std::byte* row) {
    for (int64_t x = 0; x < size.x; ++x) {
      float value;
      std::memcpy(&value, row + 4 * x, 4);
      if (std::isnan(value)) {
        tally.nan += times;
        continue;
      }
      if (fill && static_cast<double>(value) == *fill) {
        tally.fill += times;
        continue;
      }
      if (std::isinf(value)) {
        tally.infinite += times;
        continue;
      }
      tally.zeros += value == 0 ? times : 0;
      tally.least = std::min(tally.least, value);
      tally.greatest = std::max(tally.greatest, value);
      const double from = static_cast<double>(value) - scale.least;
      const auto step = static_cast<int64_t>(std::llround(from * scale.steps));
      tally.sum += static_cast<__int128>(step) * times;
      tally.squares += static_cast<__int128>(step) * step * times;
      const auto bin = static_cast<size_t>(std::max(from * scale.bins, 0.0));
      tally.counts[0][std::min(bin, fine_bins - 1)] += times;
      tally.different.add(value, times);
    }
  });
}

double entropy_of(const std::vector<uint64_t>& counts, uint64_t samples) {
  double bits = 0;
  for (const uint64_t count : counts)
    if (count > 0) {
      const double share = static_cast<double>(count) / static_cast<double>(samples);
      bits -= share * std::log2(share);
    }
  return bits;
}

/// For each share of the samples, calls set(which, i) with the index where it ends.
template <class Set>
void find_percentiles(const std::vector<uint64_t>& counts, uint64_t samples, const Set& set) {
  uint64_t before = 0;
  size_t next = 0;
  for (size_t i = 0; i < counts.size() && next < SampleStats::shares.size(); ++i) {
    before += counts[i];
    while (next < SampleStats::shares.size() &&
           static_cast<double>(before) >= SampleStats::shares[next] / 100 * static_cast<double>(samples) &&
           before > 0)
      set(next++, i);
  }
}

/// Of integers: `value(stored)` is the sample.
template <class Value>
SampleStats integer_stats(const std::vector<uint64_t>& counts, const Value& value) {
  SampleStats stats;
  uint64_t different = 0;
  size_t first = counts.size(), last = 0;
  double sum = 0;
  for (size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    stats.samples += counts[i];
    ++different;
    first = std::min(first, i), last = i;
    sum += static_cast<double>(counts[i]) * value(i);
  }
  stats.different = different;
  stats.entropy = 0;
  if (stats.samples == 0) return stats;
  const auto samples = static_cast<double>(stats.samples);
  stats.least = value(first), stats.greatest = value(last), stats.mean = sum / samples;
  double squares = 0;
  for (size_t i = first; i <= last; ++i) {
    const double off = value(i) - stats.mean;
    squares += static_cast<double>(counts[i]) * off * off;
  }
  stats.deviation = std::sqrt(squares / samples);
  stats.entropy = entropy_of(counts, stats.samples);
  find_percentiles(counts, stats.samples,
                   [&](size_t which, size_t i) { stats.percentiles[which] = value(i); });
  const double extent = stats.greatest - stats.least + 1;
  stats.bin_width = std::ceil(extent / SampleStats::most_bins);
  stats.histogram.resize(static_cast<size_t>(std::ceil(extent / stats.bin_width)));
  for (size_t i = first; i <= last; ++i)
    stats.histogram[std::min(static_cast<size_t>((value(i) - stats.least) / stats.bin_width),
                             stats.histogram.size() - 1)] += counts[i];
  return stats;
}

SampleStats float_stats(const Tally& tally, const ValueRange& range, const FloatScale& scale) {
  SampleStats stats;
  const std::vector<uint64_t>& counts = tally.counts[0];
  for (const uint64_t count : counts) stats.samples += count;
  if (stats.samples == 0) {
    stats.different = 0;
    stats.entropy = 0;
    return stats;
  }
  stats.least = static_cast<double>(tally.least), stats.greatest = static_cast<double>(tally.greatest);
  const double step = scale.steps > 0 ? 1 / scale.steps : 0;
  const auto n = static_cast<__int128>(stats.samples);
  // Exact sums around a whole number near the mean, so that nothing cancels.
  const __int128 center = tally.sum / n, rest = tally.sum - center * n;
  const __int128 around = tally.squares - 2 * center * tally.sum + n * center * center;
  const double off = static_cast<double>(rest) / static_cast<double>(n);
  stats.mean = scale.least + (static_cast<double>(center) + off) * step;
  const double variance = static_cast<double>(around) / static_cast<double>(n) - off * off;
  stats.deviation = std::sqrt(std::max(variance, 0.0)) * step;
  const double width = range.hi - range.lo, fine = width / static_cast<double>(fine_bins);
  if (tally.different.few()) {
    const auto [values, times] = tally.different.sorted();
    stats.different = values.size();
    stats.entropy = entropy_of(times, stats.samples);
    find_percentiles(times, stats.samples,
                     [&, &of = values](size_t which, size_t i) { stats.percentiles[which] = of[i]; });
  } else {
    find_percentiles(counts, stats.samples, [&](size_t which, size_t i) {
      stats.percentiles[which] =
          std::clamp(scale.least + static_cast<double>(i + 1) * fine, stats.least, stats.greatest);
    });
  }
  stats.bin_width = width / SampleStats::most_bins;
  stats.histogram.resize(width > 0 ? SampleStats::most_bins : 1);
  for (size_t i = 0; i < counts.size(); ++i)
    stats.histogram[i * stats.histogram.size() / counts.size()] += counts[i];
  return stats;
}

}  // namespace

Result<VolumeStats> volume_stats(VolumeSource& source, const ValueRange& range, Context& ctx) {
  const VolumeInfo& info = source.info();
  const VoxelFormat format = info.format;
  const bool floats = format == VoxelFormat::float32, colors = is_color(format);
  const size_t channels = colors ? static_cast<size_t>(voxel_bytes(format)) : 1;
  const size_t bins = floats || format == VoxelFormat::density16 ? fine_bins : 256;
  const uint64_t tally_bytes = channels * bins * sizeof(uint64_t) + (floats ? Different::most_bytes : 0);
  VOX_TRY(const Reservation memory,
          Reservation::take(static_cast<uint64_t>(ctx.threads + 1) * tally_bytes, "counts of values", ctx));
  const FloatScale scale(range);
  Tallies tallies(channels, bins);
  VOX_CHECK(visit_voxels(
      source,
      [&](ConstVoxelSpan voxels, Index3 size, int64_t repeats) {
        const auto times = static_cast<uint64_t>(repeats);
        auto tally = tallies.take();
        if (floats)
          add_floats(voxels, size, times, info.fill, scale, *tally);
        else if (colors)
          add_colors(voxels, size, times, *tally);
        else if (format == VoxelFormat::density16)
          add_integers<uint16_t>(voxels, size, times, *tally);
        else
          add_integers<uint8_t>(voxels, size, times, *tally);
        tallies.give(std::move(tally));
      },
      ctx));
  Tally all = tallies.all();
  VolumeStats stats;
  stats.voxels = static_cast<uint64_t>(info.box().voxels());
  stats.nan = all.nan, stats.infinite = all.infinite, stats.fill = all.fill;
  if (floats) {
    stats.void_voxels = all.zeros;
    stats.channels.push_back(float_stats(all, range, scale));
    return stats;
  }
  if (colors) {
    if (channels == 4) stats.void_voxels = all.counts[3][0];
    for (const auto& counts : all.counts)
      stats.channels.push_back(integer_stats(counts, [](size_t i) { return static_cast<double>(i); }));
    return stats;
  }
  std::vector<uint64_t>& counts = all.counts[0];
  if (info.fill && *info.fill >= 0 && *info.fill < static_cast<double>(counts.size()))
    stats.fill = std::exchange(counts[static_cast<size_t>(*info.fill)], 0);
  for (size_t i = 0; i < counts.size(); ++i)
    if (counts[i] > 0 && info.sample(static_cast<double>(i)) == 0) stats.void_voxels += counts[i];
  stats.channels.push_back(
      integer_stats(counts, [&](size_t i) { return info.sample(static_cast<double>(i)); }));
  return stats;
}

}  // namespace voxkit
