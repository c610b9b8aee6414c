#include "libvq/cluster.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "formats/full_scale.h"
#include "formats/parallel.h"

namespace voxkit::vq {
namespace {

/// Of the unique bricks, as `kmeans` wants them.
struct Unpacked {
  explicit Unpacked(Context& ctx) : reservation(*ctx.memory) {}
  UniqueBricks unique;
  Reservation reservation;
};

Status unpack(const Collected& collected, Unpacked& out, Context& ctx) {
  const uint64_t count = collected.codes.size();
  VOX_CHECK(out.reservation.add(count * (sizeof(Brick) + sizeof(uint64_t)), "the unique bricks"));
  out.unique.bricks.resize(count);
  out.unique.counts.assign(count, 0);
  for (const uint32_t number : collected.numbers)
    if (number != no_number) ++out.unique.counts[number];
  constexpr uint64_t batch = 4096;
  return parallel_for(ctx, static_cast<int64_t>(divide_up(count, batch)), [&](int64_t i) -> Status {
    const uint64_t first = static_cast<uint64_t>(i) * batch;
    for (uint64_t n = first; n < std::min(count, first + batch); ++n)
      out.unique.bricks[n] = collected.codes.decode(n);
    return {};
  });
}

/// From a sum of squared errors of codes to decibels.
class Psnr {
 public:
  Psnr(const UniqueBricks& unique, const VolumeInfo& info, const Quantiser& quantiser) {
    uint16_t lo = 65535, hi = 0;
    for (size_t i = 0; i < unique.bricks.size(); ++i) {
      const BrickRange range = range_of(unique.bricks[i]);
      lo = std::min(lo, range.min);
      hi = std::max(hi, range.max);
      voxels_ += static_cast<double>(unique.counts[i]) * brick_voxels;
    }
    const double step = quantiser.step(), origin = quantiser.origin();
    const double peak = full_scale(info, {origin + step * lo, origin + step * hi});
    peak_in_codes_ = peak / step;
  }
  double of(SquaredError error) const {
    if (error == 0) return std::numeric_limits<double>::infinity();
    return 10 * std::log10(peak_in_codes_ * peak_in_codes_ * voxels_ / static_cast<double>(error));
  }

 private:
  double voxels_ = 0, peak_in_codes_ = 1;
};

}  // namespace

Status cluster(Collected& collected, const Options& options, const VolumeInfo& info,
               const Quantiser& quantiser, Report& report, Context& ctx) {
  const uint64_t unique = collected.codes.size();
  const uint64_t wanted =
      options.reduce > 0 ? std::max<uint64_t>(1, unique / options.reduce) : options.codewords;
  if (wanted == 0 || wanted >= unique) return {};
  if (options.clustering) options.clustering();

  Clustering clustering;
  {
    Unpacked unpacked(ctx);
    VOX_CHECK(unpack(collected, unpacked, ctx));
    const Psnr psnr(unpacked.unique, info, quantiser);
    KMeansOptions means;
    means.codewords = static_cast<uint32_t>(wanted);
    means.seeding = options.seeding;
    means.max_iterations = options.max_iterations;
    if (options.clustered)
      means.report = [&](uint32_t iteration, SquaredError error) {
        options.clustered(iteration, psnr.of(error));
      };
    VOX_TRY(clustering, kmeans(unpacked.unique.bricks, unpacked.unique.counts, means, ctx));
  }
  report.params.seeding = options.seeding;
  report.params.iterations = clustering.iterations;
  report.params.max_error = -1;
  report.seeding_seconds = clustering.seeding_seconds;
  report.kmeans_seconds = clustering.kmeans_seconds;

  UniqueCodes centres(ctx);
  std::vector<uint32_t> numbers(clustering.centres.size(), no_number);
  CodedBrick coded;
  for (uint32_t& place : collected.numbers) {
    if (place == no_number) continue;
    const uint32_t centre = clustering.assignment[place];
    if (numbers[centre] == no_number) {
      code_brick(clustering.centres[centre], coded);
      VOX_TRY(numbers[centre], centres.add(coded.range, coded.code(), hash_of(coded.range, coded.code())));
    }
    place = numbers[centre];
  }
  collected.codes = std::move(centres);
  return {};
}

}  // namespace voxkit::vq
