// Fewer bricks that stand for many: weighted k-means in whole numbers (Guthe and Goesele 2016, section 4).
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "formats/context.h"
#include "libvq/brick.h"

namespace voxkit::vq {

/// Which bricks are the first centres.
enum class Seeding {
  furthest,  ///< always the brick furthest from all chosen so far
  d2,        ///< at random, with probabilities in proportion to weight and squared distance
};

/// Weights times squared distances, added up: up to 2^85.
using SquaredError = unsigned __int128;

struct KMeansOptions {
  uint32_t codewords = 1;  ///< k, at least 1
  Seeding seeding = Seeding::furthest;
  /// More only while clusters would be empty. 0: the centres are bricks.
  uint32_t max_iterations = ~uint32_t{0};
  /// Told after seeding and after each iteration, on the thread that called.
  std::function<void(uint32_t iteration, SquaredError error)> report = nullptr;
  bool native = true;  ///< false: only instructions that every machine has, to test with
};

struct Clustering {
  std::vector<Brick> centres;        ///< at most k, fewer where there are fewer different bricks
  std::vector<uint32_t> assignment;  ///< for each brick, the number of its centre; all centres are used
  uint32_t iterations = 0;
  double seeding_seconds = 0, kmeans_seconds = 0;
  SquaredError error = 0;  ///< of all voxels: the mean squared error is error / (64 x the sum of weights)
};

/// k centres such that the bricks, each taken `weights` times, are near to them.
///
/// It ends when no centre changes, which it does for every input: distances, sums and means are exact whole
/// numbers, so the error falls in every iteration in which a brick changes its centre. Then each centre is
/// the rounded mean of its bricks (halves up), and no other centre is nearer to any of them. A brick goes to
/// another centre only if that is nearer, to the first of the nearest. A cluster that has become empty gets
/// the brick of which weight times squared distance is greatest, out of those that are not alone in theirs,
/// the first of several.
///
/// With k >= the number of bricks, the centres are the bricks. They may be equal, but are meant to differ.
///
/// The result depends on neither ctx.threads nor the machine. bricks: 1 to 2^32 - 1. weights: as many, each
/// at least 1, together at most 2^47. ErrorCode::usage if not; ErrorCode::limit where memory is short, about
/// 300 bytes for each brick, 128 for each centre, and 512 for each centre of several bricks.
Result<Clustering> kmeans(std::span<const Brick> bricks, std::span<const uint64_t> weights,
                          const KMeansOptions& options, Context& ctx);

}  // namespace voxkit::vq
