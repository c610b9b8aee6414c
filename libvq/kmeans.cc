#include "libvq/kmeans.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "formats/clock.h"
#include "formats/reservation.h"
#include "libvq/kmeans_assign.h"
#include "libvq/kmeans_means.h"
#include "libvq/nearest_centre.h"
#include "libvq/seeding.h"

namespace voxkit::vq {
namespace {

Status validate(std::span<const Brick> bricks, std::span<const uint64_t> weights,
                const KMeansOptions& options) {
  constexpr uint64_t most_weight = uint64_t{1} << 47;  // sums of 16-bit voxels, doubled, fit 64 bits
  if (options.codewords == 0) return bad_usage("k-means with no codewords: expected at least 1");
  if (bricks.empty() || bricks.size() >= ~uint32_t{0})
    return bad_usage(fmt::format("k-means of {} bricks: expected 1 to 2^32 - 2", bricks.size()));
  if (weights.size() != bricks.size())
    return bad_usage(fmt::format("k-means of {} bricks: {} weights", bricks.size(), weights.size()));
  uint64_t sum = 0;
  for (const uint64_t w : weights) {
    if (w == 0 || w > most_weight - sum)
      return bad_usage("k-means: weights: expected at least 1, in sum 2^47 at most");
    sum += w;
  }
  return {};
}

class KMeans {
 public:
  KMeans(std::span<const Brick> bricks, std::span<const uint64_t> weights, const KMeansOptions& options,
         Context& ctx)
      : bricks_(bricks),
        weights_(weights),
        options_(options),
        ctx_(ctx),
        count_(static_cast<uint32_t>(std::min<size_t>(options.codewords, bricks.size()))),
        reservation_(*ctx.memory),
        space_(bricks) {}

  Result<Clustering> run() {
    VOX_CHECK(reserve());
    const Clock::time_point start = Clock::now();
    VOX_TRY(NearestCentres nearest, NearestCentres::build(bricks_, space_, options_.native, ctx_));
    Context seeding = ctx_;
    seeding.progress = [this](double done) { progress(done / 2); };
    VOX_CHECK(options_.seeding == Seeding::furthest
                  ? seed_furthest(nearest, space_, count_, result_.centres, seeding)
                  : seed_d2(nearest, space_, weights_, count_, result_.centres, seeding));
    result_.seeding_seconds = seconds_since(start);
    const Clock::time_point seeded = Clock::now();
    VOX_CHECK(iterate(nearest));
    result_.kmeans_seconds = seconds_since(seeded);

    result_.error = error(nearest);
    result_.assignment.resize(bricks_.size());
    for (size_t p = 0; p < bricks_.size(); ++p)
      result_.assignment[nearest.tree->index(p)] = nearest.centre[p];
    return std::move(result_);
  }

 private:
  Status reserve() {
    const uint64_t n = bricks_.size();
    VOX_CHECK(reservation_.add(n * (BrickTree::bytes_per_brick + NearestCentres::bytes_per_brick +
                                    Assigner::bytes_per_brick + sizeof(uint32_t)),
                               "searching bricks for k-means"));
    VOX_CHECK(reservation_.add(count_ * (sizeof(Brick) + BrickTree::bytes_per_brick +
                                         BrickTree::bytes_to_build + Means::bytes_per_centre),
                               "centres of k-means"));
    return reservation_.add(std::max(n * BrickTree::bytes_to_build,
                                     std::min<uint64_t>(count_, n - count_) * Means::bytes_per_sum),
                            "sums of k-means");
  }

  Status iterate(NearestCentres& nearest) {
    Means means(nearest, weights_, result_.centres);
    Assigner assigner(nearest, space_);
    report(nearest);
    while (result_.iterations < options_.max_iterations || means.any_empty()) {
      VOX_TRY(const std::vector<uint32_t> changed, means.update(result_.centres, ctx_));
      if (changed.empty()) break;
      VOX_CHECK(assigner.assign(result_.centres, changed, ctx_));
      for (size_t p = 0; p < bricks_.size(); ++p)
        if (nearest.centre[p] != assigner.before(p))
          means.move(p, assigner.before(p), nearest.centre[p], result_.centres);
      ++result_.iterations;
      report(nearest);
      // The number of centres that change falls by about the same factor again and again.
      progress(1 - std::log1p(static_cast<double>(changed.size())) / std::log1p(count_) / 2);
    }
    return {};
  }

  SquaredError error(const NearestCentres& nearest) const {
    SquaredError sum = 0;
    for (size_t p = 0; p < bricks_.size(); ++p)
      sum += SquaredError{nearest.distance[p]} * weights_[nearest.tree->index(p)];
    return sum;
  }
  void report(const NearestCentres& nearest) const {
    if (options_.report) options_.report(result_.iterations, error(nearest));
  }
  void progress(double done) {
    if (done > done_) ctx_.progress(done_ = done);
  }

  std::span<const Brick> bricks_;
  std::span<const uint64_t> weights_;
  const KMeansOptions& options_;
  Context& ctx_;
  uint32_t count_;
  Reservation reservation_;
  KeySpace space_;
  Clustering result_;
  double done_ = 0;
};

}  // namespace

Result<Clustering> kmeans(std::span<const Brick> bricks, std::span<const uint64_t> weights,
                          const KMeansOptions& options, Context& ctx) {
  VOX_CHECK(validate(bricks, weights, options));
  if (options.codewords >= bricks.size()) {
    Clustering same;
    same.centres.assign(bricks.begin(), bricks.end());
    same.assignment.resize(bricks.size());
    std::iota(same.assignment.begin(), same.assignment.end(), 0u);
    return same;
  }
  return KMeans(bricks, weights, options, ctx).run();
}

}  // namespace voxkit::vq
