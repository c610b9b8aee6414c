// K-means where numbers are greatest and ties are many, beside k-means by the book in 128 bits.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "libvq/kmeans.h"
#include "tests/libvq/kmeans_reference.h"
#include "tests/stress/report.h"
#include "tests/stress/search.h"

namespace voxkit::stress {
namespace {

using vq::Brick;
using Wide = unsigned __int128;

constexpr int64_t most_bricks = 12, per_brick = 4;
constexpr int64_t most_weight = (int64_t{1} << 47) / most_bricks;

struct Problem {
  std::vector<Brick> bricks;
  std::vector<uint64_t> weights;
  vq::KMeansOptions options;
};

/// Variables: bricks, k, the greatest number of iterations; of each brick its shape, two values and a weight.
std::vector<Range> ranges() {
  std::vector<Range> all = {{1, most_bricks}, {1, most_bricks}, {0, 40}};
  for (int64_t i = 0; i < most_bricks; ++i)
    all.insert(all.end(), {{0, 9}, {0, 65535}, {0, 65535}, {1, most_weight}});
  return all;
}

Problem problem_of(const Point& at, vq::Seeding seeding) {
  Problem problem;
  for (size_t i = 0; i < static_cast<size_t>(at[0]); ++i) {
    const int64_t* const v = &at[3 + i * per_brick];
    const auto a = static_cast<uint16_t>(v[1]), b = static_cast<uint16_t>(v[2]);
    Brick brick;
    for (size_t k = 0; k < brick.size(); ++k) {
      const bool other = v[0] == 0   ? false                // one value
                         : v[0] == 1 ? k == 0               // one voxel is another
                         : v[0] == 2 ? k == 63              //
                         : v[0] == 3 ? k % 2 == 1           // every second
                         : v[0] == 4 ? k % 2 == 0           //
                         : v[0] == 5 ? k < 32               // half
                         : v[0] == 6 ? k * 2654435761 & 64  // a pattern
                                     : k == i;              // each its own voxel
      brick[k] = other ? b : a;
    }
    if (v[0] == 9 && i > 0) brick = problem.bricks[static_cast<size_t>(v[1]) % i];  // one again
    problem.bricks.push_back(brick);
    problem.weights.push_back(static_cast<uint64_t>(v[3]));
  }
  problem.options.codewords = static_cast<uint32_t>(at[1]);
  problem.options.seeding = seeding;
  problem.options.max_iterations = at[2] == 40 ? ~uint32_t{0} : static_cast<uint32_t>(at[2]);
  return problem;
}

/// What is hard about a problem, and how far the result is from the reference.
struct Outcome {
  int64_t deviations = 0;  ///< centres, assignments, iterations, and the error, that are others
  int64_t unequal_paths = 0;
  uint32_t iterations = 0, filled = 0;
  int64_t ties = 0;           ///< bricks that are as near to two centres
  double greatest_sum = 0;    ///< bits of the largest sum of weights times values
  double greatest_error = 0;  ///< bits of the weighted sum of squares
};

Outcome run(const Problem& p) {
  Context ctx = stress_context();
  const vq::Clustering ours = must(vq::kmeans(p.bricks, p.weights, p.options, ctx));
  vq::KMeansOptions portable = p.options;
  portable.native = false;
  const vq::Clustering plain = must(vq::kmeans(p.bricks, p.weights, portable, ctx));
  Outcome out;
  out.unequal_paths = (ours.centres != plain.centres) + (ours.assignment != plain.assignment) +
                      (ours.iterations != plain.iterations) + (ours.error != plain.error);
  const auto k = p.options.codewords;
  std::vector<Brick> centres = p.bricks;
  std::vector<uint32_t> assignment(p.bricks.size());
  if (k >= p.bricks.size()) {  // the centres are the bricks
    for (uint32_t i = 0; i < assignment.size(); ++i) assignment[i] = i;
  } else {
    auto book = p.options.seeding == vq::Seeding::furthest ? vq::reference::furthest_first(p.bricks, k)
                                                           : vq::reference::d2(p.bricks, p.weights, k);
    vq::reference::k_means(book, p.bricks, p.weights, p.options.max_iterations);
    centres = book.centres;
    assignment = book.centre;
    out.iterations = book.iterations;
    out.filled = book.filled;
    out.deviations += ours.iterations != book.iterations;
  }
  Wide error = 0, greatest = 0;
  for (size_t i = 0; i < p.bricks.size(); ++i) {
    const uint64_t own =
        vq::reference::distance_s(vq::reference::infinite, p.bricks[i], centres[assignment[i]]);
    error += Wide{own} * p.weights[i];
    for (size_t c = 0; c < centres.size(); ++c)
      out.ties += c != assignment[i] &&
                  vq::reference::distance_s(vq::reference::infinite, p.bricks[i], centres[c]) == own;
    for (const uint16_t v : p.bricks[i]) greatest = std::max(greatest, Wide{v} * p.weights[i]);
    out.deviations += i >= ours.assignment.size() || ours.assignment[i] != assignment[i];
  }
  Wide sum = 0;
  for (size_t v = 0; v < vq::brick_voxels; ++v) {
    Wide all = 0;
    for (size_t i = 0; i < p.bricks.size(); ++i) all += Wide{p.bricks[i][v]} * p.weights[i];
    sum = std::max(sum, all);
  }
  out.greatest_sum = std::log2(static_cast<double>(sum) + 1);
  out.greatest_error = std::log2(static_cast<double>(error) + 1);
  out.deviations += ours.centres.size() != centres.size();
  for (size_t c = 0; c < std::min(centres.size(), ours.centres.size()); ++c)
    out.deviations += ours.centres[c] != centres[c];
  out.deviations += ours.error != error;
  return out;
}

std::string input_of(const Point& at) {
  std::string all = fmt::format("bricks={} k={} iterations={}", at[0], at[1], at[2]);
  for (size_t i = 0; i < static_cast<size_t>(at[0]); ++i) {
    const int64_t* const v = &at[3 + i * per_brick];
    all += fmt::format(" {}:{},{}x{}", v[0], v[1], v[2], v[3]);
  }
  return all;
}

struct Aim {
  const char* name;
  double (*of)(const Outcome&);
  const char* unit;
};
constexpr Aim aims[] = {
    {"most ties", [](const Outcome& o) { return static_cast<double>(o.ties); }, "ties"},
    {"most empty clusters", [](const Outcome& o) { return static_cast<double>(o.filled); }, "filled"},
    {"most iterations", [](const Outcome& o) { return static_cast<double>(o.iterations); }, "iterations"},
    {"largest sums", [](const Outcome& o) { return o.greatest_sum; }, "bits of a sum (64 hold it)"},
    {"largest error", [](const Outcome& o) { return o.greatest_error; }, "bits of the error (128 hold it)"},
};

/// Where a cluster becomes empty if seeding takes the 1st, 3rd and 6th: the means of its neighbours come
/// near.
std::vector<Point> starts() {
  std::vector<std::pair<int64_t, int64_t>> points = {{1000, 1}, {1490, 7}, {2000, 1},
                                                     {3200, 1}, {3250, 7}, {4460, 1}};
  std::vector<Point> all;
  std::mt19937 random(1);
  for (int order = 0; order < 200; ++order) {
    for (size_t i = points.size(); i > 1; --i) std::swap(points[i - 1], points[random() % i]);
    Point at = {static_cast<int64_t>(points.size()), 3, 40};
    for (size_t i = 0; i < most_bricks; ++i) {
      const auto [value, weight] = points[i % points.size()];
      at.insert(at.end(), {0, value, 0, weight});
    }
    all.push_back(at);
  }
  return all;
}

void fill(const Effort& effort, Report& report) {
  const auto all = ranges();
  const auto first = starts();
  for (const auto seeding : {vq::Seeding::furthest, vq::Seeding::d2})
    for (const Aim& aim : aims) {
      int64_t deviations = 0, unequal = 0;
      Point worst_at;
      const Worst found = climb(all, first, effort.tries, effort.seed, [&](const Point& at) {
        const Outcome outcome = run(problem_of(at, seeding));
        if (outcome.deviations > deviations || outcome.unequal_paths > unequal) worst_at = at;
        deviations = std::max(deviations, outcome.deviations);
        unequal = std::max(unequal, outcome.unequal_paths);
        return aim.of(outcome) + 1e6 * static_cast<double>(outcome.deviations + outcome.unequal_paths);
      });
      Row row;
      row.what =
          fmt::format("k-means, {}, {}", seeding == vq::Seeding::furthest ? "furthest" : "d2", aim.name);
      row.promise = "as by the book: 0 deviations, with SIMD or without";
      row.worst = fmt::format("{} and {}; {:.4g} {}", deviations, unequal, found.score, aim.unit);
      row.held = deviations == 0 && unequal == 0;
      row.tried = found.tried;
      row.input = input_of(row.held ? found.at : worst_at);
      report.add(row);
    }
}

}  // namespace
}  // namespace voxkit::stress

int main(int argc, char** argv) {
  return voxkit::stress::stress_main(argc, argv, "stress_kmeans", "K-means", 20000, voxkit::stress::fill);
}
