// Which centre is nearest to each brick, after some have moved (Guthe and Goesele 2016, Algorithms 3 and 4).
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "formats/context.h"
#include "libvq/nearest_centre.h"

namespace voxkit::vq {

/// The paper's cases: a brick at distance 0 stays. One whose centre did not move, or moved nearer, can only
/// be taken by a centre that moved, for it was nearest to its own before. One whose centre moved away has to
/// look at all of them; here, only if it is now further than a bound on how near any other may be, which is
/// kept for each brick.
class Assigner {
 public:
  /// `nearest` has centres that are bricks, and stays.
  Assigner(NearestCentres& nearest, const KeySpace& space);
  /// Of memory, for each brick; beside a tree of the centres.
  static constexpr uint64_t bytes_per_brick = 8 + 4;

  /// `changed`: the numbers of the centres that are not what they were in the last call. Bricks may have been
  /// given to these since.
  Status assign(std::span<const Brick> centres, std::span<const uint32_t> changed, const Context& ctx);
  /// The centre that a brick had before the last call.
  uint32_t before(size_t position) const { return before_[position]; }

 private:
  struct ChangedFinder;
  struct AllFinder;

  bool consider(size_t position, uint32_t centre, uint64_t distance);
  Status follow(std::span<const Brick> centres, const Context& ctx);
  void follow_branch(std::span<const Brick> centres, const Branch& branch, std::vector<uint32_t>& further);
  Status look_at_changed(std::span<const Brick> centres, std::span<const uint32_t> changed,
                         const Context& ctx);
  Status look_at_all(std::span<const Brick> centres, const Context& ctx);
  void move_in_tree(std::span<const Brick> centres, std::span<const uint32_t> changed);

  NearestCentres& nearest_;
  const KeySpace& space_;
  std::vector<uint64_t> others_;  ///< no other centre is nearer than the root of this, which is >= distance
  std::vector<uint32_t> before_;
  std::vector<uint8_t> moved_;       ///< of centres: whether this call was told that they changed
  std::vector<uint32_t> further_;    ///< bricks that have to look at all centres, in the order of positions
  std::unique_ptr<BrickTree> tree_;  ///< of centres
  std::vector<uint32_t> place_;      ///< of each centre in it
  size_t moves_ = 0;                 ///< of centres, since it was built
};

}  // namespace voxkit::vq
