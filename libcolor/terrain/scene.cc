#include "libcolor/terrain/scene.h"

#include <algorithm>

namespace voxkit::color::terrain {

uint64_t Scene::bytes() {
  constexpr uint64_t leaves = uint64_t{6} * 40 * 40 * 40 * sizeof(Leaf);
  return Ground::bytes() + Light::bytes() + leaves +
         (uint64_t{1} << (2 * (side_bits - Ground::range_bits))) * 16;
}

Result<std::unique_ptr<const Scene>> Scene::make(bool box, Context& ctx) {
  const auto planned = planned_houses();
  std::vector<House> houses(planned.begin(), planned.end());
  VOX_TRY(Ground ground, Ground::make(houses, ctx));
  return std::unique_ptr<const Scene>(new Scene(box, std::move(ground), std::move(houses)));
}

Scene::Scene(bool box, Ground ground, std::vector<House> houses)
    : box_(box),
      ground_(std::move(ground)),
      houses_(std::move(houses)),
      forest_(ground_, houses_),
      light_(ground_, houses_, forest_) {
  int32_t cells = side >> Ground::range_bits;
  std::vector<Range> finest;
  for (int32_t k = 0; k < cells; ++k)
    for (int32_t i = 0; i < cells; ++i) {
      const Ground::Range range = ground_.range(i, k);
      finest.push_back({range.lo, range.hi, range.hi});
    }
  const auto raise = [&](int32_t x, int32_t z, int32_t reach, int32_t top) {
    const auto cell_of = [&](int32_t v) { return std::clamp(v >> Ground::range_bits, 0, cells - 1); };
    for (int32_t k = cell_of(z - reach); k <= cell_of(z + reach); ++k)
      for (int32_t i = cell_of(x - reach); i <= cell_of(x + reach); ++i) {
        int32_t& hi = finest[static_cast<size_t>(k * cells + i)].hi;
        hi = std::max(hi, top);
      }
  };
  for (const House& house : houses_) raise(house.x, house.z, house.reach(), house.top());
  for (const Tree& tree : forest_.trees) {
    const TreeModel& model = forest_.model(tree);
    raise(tree.x, tree.z, model.reach + 2 * TreeModel::longest, tree.y + model.hi + 2 * TreeModel::longest);
  }
  ranges_.push_back(std::move(finest));
  while (cells > 1) {
    const auto& fine = ranges_.back();
    std::vector<Range> coarse;
    for (int32_t k = 0; k < cells; k += 2)
      for (int32_t i = 0; i < cells; i += 2) {
        Range all;
        for (int32_t part = 0; part < 4; ++part)
          all.join(fine[static_cast<size_t>((k + part / 2) * cells + i + part % 2)]);
        coarse.push_back(all);
      }
    ranges_.push_back(std::move(coarse));
    cells /= 2;
  }
}

Scene::Range Scene::around(const std::array<int32_t, 3>& lo, const std::array<int32_t, 3>& hi) const {
  size_t level = 0;
  int32_t cells = side >> Ground::range_bits;
  const auto cell_of = [&](int32_t v) {
    return std::clamp(v >> (Ground::range_bits + static_cast<int>(level)), 0, cells - 1);
  };
  // At most 2 x 2 squares.
  while (cells > 1 && (cell_of(hi[0]) - cell_of(lo[0]) > 1 || cell_of(hi[2]) - cell_of(lo[2]) > 1))
    ++level, cells /= 2;
  Range range;
  for (int32_t k = cell_of(lo[2]); k <= cell_of(hi[2]); ++k)
    for (int32_t i = cell_of(lo[0]); i <= cell_of(hi[0]); ++i)
      range.join(ranges_[level][static_cast<size_t>(k * cells + i)]);
  return range;
}

bool Scene::may_meet(const Extent& extent, int32_t edge) const {
  std::array<int32_t, 3> lo, hi;
  for (size_t a = 0; a < 3; ++a) lo[a] = extent.lo[a] - edge, hi[a] = extent.hi[a] + edge;
  Range range = around(lo, hi);
  // The sides of the world go down to its floor.
  if (lo[0] <= 0 || lo[2] <= 0 || hi[0] >= side - 1 || hi[2] >= side - 1) range.lo = 0;
  if (lo[1] <= range.hi && hi[1] >= range.lo) return true;
  if (!box_) return false;
  bool meets = true, inside = true;
  for (size_t a = 0; a < 3; ++a) {
    meets = meets && lo[a] <= hidden_box.hi[a] && hi[a] >= hidden_box.lo[a];
    inside = inside && lo[a] > hidden_box.lo[a] && hi[a] < hidden_box.hi[a];
  }
  return meets && !inside;
}

}  // namespace voxkit::color::terrain
