// Everything that stands in the terrain, and where nothing does.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "libcolor/terrain/ground.h"
#include "libcolor/terrain/light.h"
#include "libcolor/terrain/tree.h"

namespace voxkit::color::terrain {

/// A box in units, both ends included.
struct Extent {
  std::array<int32_t, 3> lo, hi;
};

/// A closed box under the ground that no light gets into.
inline constexpr Extent hidden_box{{side / 16, metre, side / 16},
                                   {side / 16 * 15, 9 * metre / 2, side / 16 * 15}};

class Scene {
 public:
  static Result<std::unique_ptr<const Scene>> make(bool box, Context& ctx);
  static uint64_t bytes();

  const Ground& ground() const { return ground_; }
  const std::vector<House>& houses() const { return houses_; }
  const Forest& forest() const { return forest_; }
  const Light& light() const { return light_; }
  bool box() const { return box_; }
  /// Whether a surface may be in an extent, a margin of `edge` around it.
  bool may_meet(const Extent& extent, int32_t edge) const;
  /// Whether all of an extent is above the ground.
  bool in_the_air(const Extent& extent) const { return extent.lo[1] > around(extent.lo, extent.hi).ground; }

 private:
  /// Heights: of the lowest ground, of the highest, and of the highest of everything.
  struct Range {
    int32_t lo = INT32_MAX, ground = INT32_MIN, hi = INT32_MIN;
    void join(const Range& r) {
      lo = std::min(lo, r.lo), ground = std::max(ground, r.ground), hi = std::max(hi, r.hi);
    }
  };
  Scene(bool box, Ground ground, std::vector<House> houses);
  /// Of a part of the world, or of more.
  Range around(const std::array<int32_t, 3>& lo, const std::array<int32_t, 3>& hi) const;

  bool box_;
  Ground ground_;
  std::vector<House> houses_;
  Forest forest_;
  Light light_;
  std::vector<std::vector<Range>> ranges_;  ///< of squares of 2^16 units, and of 2 x 2, 4 x 4 … of them
};

}  // namespace voxkit::color::terrain
