#include "libcolor/simplify/hausdorff.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "formats/parallel.h"
#include "formats/reservation.h"
#include "libcolor/dag/box_walk.h"
#include "libcolor/simplify/ball.h"

namespace voxkit::color {
namespace {

constexpr int cube_height = 5;
constexpr int64_t cube_side = 1 << cube_height;
/// A cube and what is around it.
constexpr int64_t margin = most_simplify, window_side = cube_side + 2 * margin;
static_assert(window_side <= 64);

/// The voxels of a surface in a window, a number for each row along x.
class Window {
 public:
  Window(const DagView& view, Index3 corner, int64_t around) : rows_(window_side * window_side) {
    const Box box{corner - around, corner + cube_side + around};
    BoxWalk(view, box).run([&](const WalkedCell& cell) {
      const uint64_t word = view.leaf(cell.pointer) & leaf_within(cell.corner, box);
      const Index3 at = cell.corner - corner + margin;
      for (uint64_t left = word; left != 0; left &= left - 1) {
        const Index3 place = at + Index3(morton_place(static_cast<uint64_t>(std::countr_zero(left))));
        rows_[static_cast<size_t>(place.z * window_side + place.y)] |= uint64_t{1} << place.x;
      }
      return true;
    });
  }
  /// 32 voxels of the cube, from (0, y, z) and a step on.
  uint32_t row(int64_t y, int64_t z, const Step& step = {}) const {
    const auto at = static_cast<size_t>((z + step.z + margin) * window_side + y + step.y + margin);
    return static_cast<uint32_t>(rows_[at] >> (margin + step.x));
  }

 private:
  std::vector<uint64_t> rows_;
};

/// From a cube of `a` to `b`: the greatest squared length of a step that is needed; more than the steps'
/// where none is enough.
int most_needed(const DagView& a, const DagView& b, Index3 corner, const std::vector<Step>& steps) {
  const Window own(a, corner, 0), other(b, corner, margin);
  int most = 0;
  for (int64_t z = 0; z < cube_side; ++z)
    for (int64_t y = 0; y < cube_side; ++y) {
      uint32_t left = own.row(y, z);
      for (const Step& step : steps) {
        if (left == 0) break;
        const uint32_t found = left & other.row(y, z, step);
        if (found != 0) most = std::max<int>(most, step.squared);
        left ^= found;
      }
      if (left != 0) return steps.back().squared + 1;
    }
  return most;
}

/// The same of all voxels.
Result<int> directed(const DagView& a, const DagView& b, const std::vector<Step>& steps, Context& ctx) {
  const int64_t side = int64_t{1} << a.height;
  std::vector<Index3> corners;
  Reservation memory(*ctx.memory);
  Status status;
  BoxWalk(a, {Index3(0), Index3(side)}, cube_height).run([&](const WalkedCell& cell) {
    if (corners.size() == corners.capacity()) {
      const size_t more = std::max<size_t>(corners.size(), 1 << 10);
      status = memory.add(more * (sizeof(Index3) + sizeof(uint8_t)), "cubes of a surface");
      if (status) corners.reserve(corners.size() + more);
    }
    if (status) corners.push_back(cell.corner);
    return status.has_value();
  });
  VOX_CHECK(status);
  std::vector<uint8_t> most(corners.size());
  VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(corners.size()), [&](int64_t i) -> Status {
    const auto at = static_cast<size_t>(i);
    most[at] = static_cast<uint8_t>(most_needed(a, b, corners[at], steps));
    return {};
  }));
  return most.empty() ? 0 : *std::max_element(most.begin(), most.end());
}

}  // namespace

Result<double> hausdorff_distance(const DagView& a, const DagView& b, double most, Context& ctx) {
  const std::vector<Step> steps = ball(squared_of(most));
  VOX_TRY(const int there, directed(a, b, steps, ctx));
  VOX_TRY(const int back, directed(b, a, steps, ctx));
  const int squared = std::max(there, back);
  if (squared > steps.back().squared)
    return fail(ErrorCode::internal, {},
                fmt::format("voxels that are more than {} away from all that are left", most));
  return std::sqrt(squared);
}

}  // namespace voxkit::color
