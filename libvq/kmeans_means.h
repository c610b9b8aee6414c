// The bricks of each cluster, added up.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "formats/context.h"
#include "libvq/nearest_centre.h"

namespace voxkit::vq {

class Means {
 public:
  /// Of centres that are bricks. What is given must stay; `nearest` says which brick is where.
  Means(NearestCentres& nearest, std::span<const uint64_t> weights, std::span<const Brick> centres);
  /// Of memory, for each centre of several bricks that differ, and for each one.
  static constexpr uint64_t bytes_per_sum = 8 * brick_voxels, bytes_per_centre = 8 + 4 + 4 + 1;

  /// A brick has changed its centre.
  void move(size_t position, uint32_t from, uint32_t to, std::span<const Brick> centres);
  bool any_empty() const;
  /// Gives each empty cluster the brick that is worst off; then makes the centres the means of their bricks.
  /// Returns the numbers of those that are others than before, ascending.
  Result<std::vector<uint32_t>> update(std::span<Brick> centres, const Context& ctx);

 private:
  using Sum = std::array<uint64_t, brick_voxels>;
  static constexpr uint32_t none = ~uint32_t{0};

  void add(size_t position, uint32_t centre, std::span<const Brick> centres);
  void remove(size_t position, uint32_t centre);
  void touch(uint32_t centre);
  Status fill_empty(std::span<const Brick> centres);
  Brick mean(uint32_t centre) const;

  NearestCentres& nearest_;
  std::span<const uint64_t> weights_;  // by number of brick
  std::vector<uint64_t> weight_;       // of all bricks of a cluster
  std::vector<uint32_t> count_;        // of bricks
  // Of clusters with bricks other than their centre; most have none, and no sum.
  std::vector<uint32_t> sum_of_;
  std::vector<Sum> sums_;
  std::vector<uint8_t> touched_;
  std::vector<uint32_t> touched_list_;
};

}  // namespace voxkit::vq
