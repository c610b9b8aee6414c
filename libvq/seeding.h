// Where k-means begins: which bricks are the first centres (Guthe and Goesele 2016, section 4, Algorithm 2).
#pragma once

#include <span>
#include <vector>

#include "formats/context.h"
#include "libvq/nearest_centre.h"

namespace voxkit::vq {

/// Both seedings append bricks to `centres`, until there are `count` or each brick is one, and keep `nearest`
/// up to date; both must be without centres before. `count` is at most the number of bricks.

/// The brick nearest to the origin, then always the one furthest from all centres. Where several are, the
/// first.
Status seed_furthest(NearestCentres& nearest, const KeySpace& space, uint32_t count,
                     std::vector<Brick>& centres, Context& ctx);

/// Weighted D^2 (D. Arthur, S. Vassilvitskii, "k-means++", SODA 2007): bricks are drawn, each with a
/// probability in proportion to its weight times its squared distance from the nearest centre; at first, its
/// weight alone.
///
/// To the bit: draws come in rounds, the first one of 1 draw, each other of a quarter as many as there are
/// centres, at least 1 and at most 2048. Let s be what a brick's share was at the beginning of the round. A
/// draw is a number r below the sum of all s; it is of the brick i with s_0 + … + s_{i-1} <= r < s_0 + … +
/// s_i. It is taken as a centre if r - (s_0 + … + s_{i-1}) is less than its share now. r is made of
/// SplitMix64(0): as many bits as the sum has, of a number, or of two, the first one being the lower half;
/// numbers that are not below the sum are passed over.
Status seed_d2(NearestCentres& nearest, const KeySpace& space, std::span<const uint64_t> weights,
               uint32_t count, std::vector<Brick>& centres, Context& ctx);

/// Centres that `nearest` has not been told of yet.
class RecentCentres {
 public:
  static constexpr size_t most = 2048;

  explicit RecentCentres(const Kernels& kernels) : kernels_(&kernels) {}
  /// Those from `first` on, none yet. `centres` must not be moved by what is added to it.
  void restart(const std::vector<Brick>& centres);
  size_t size() const { return size_; }
  /// The last one of the centres is one of them.
  void add(const Key& key);
  /// The squared distance of a brick from the nearest of those from the `begin`th on, or `distance` if none
  /// is nearer.
  uint64_t nearest(const Brick& brick, const Key& key, uint64_t distance, size_t begin,
                   const KeySpace& space) const;

 private:
  const Kernels* kernels_;
  const Brick* first_ = nullptr;
  size_t size_ = 0;
  std::vector<Leaf> leaves_;
  std::vector<uint32_t> norms_;
};

}  // namespace voxkit::vq
