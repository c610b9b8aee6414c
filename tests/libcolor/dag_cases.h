// DAGs to test with, and where a plain walk finds each colour.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <vector>

#include "libcolor/dag/dag_builder.h"
#include "libcolor/dag/dag_recount.h"
#include "libcolor/dag/dag_view.h"
#include "tests/libcolor/scenes.h"

namespace voxkit::color {

inline Result<Dag> build(const Voxels& voxels, int height, size_t run = 1000) {
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  DagBuilder builder(height, ctx);
  for (size_t i = 0; i < voxels.size(); i += run)
    VOX_CHECK(builder.add(std::span(voxels).subspan(i, std::min(run, voxels.size() - i))));
  return builder.finish();
}

inline Result<Dag> build(const Voxels& voxels, int height, Colors colors, Counts counts, Curve curve) {
  VOX_TRY(const Dag dag, build(voxels, height));
  MemoryBudget memory;
  Context ctx;
  ctx.memory = &memory;
  return recount(dag, colors, counts, curve, ctx);
}

/// Numbers colours by walking through all cells, level by level downwards, as the paper's definition has it.
class PlainOrder {
 public:
  PlainOrder(const Voxels& voxels, int height, Colors colors, Curve curve)
      : all_(colors == Colors::all), curve_(curve) {
    for (const SurfaceVoxel& v : voxels)
      for (int h = 0; h <= height; ++h) cells_.insert({h, v.place >> 3 * h});
    if (!voxels.empty()) walk(height, 0, first_state(curve_));
  }
  std::map<uint64_t, uint64_t> index;                       ///< of voxels
  std::map<std::pair<int, uint64_t>, uint64_t> cell_index;  ///< with Colors::all, of cells by height
  uint64_t count = 0;

 private:
  void walk(int h, uint64_t cell, OrderState state) {
    if (h == 0) {
      index[cell] = count++;
      return;
    }
    if (all_) cell_index[{h, cell}] = count++;
    for (const uint64_t octant : octant_orders.octant[state])
      if (cells_.count({h - 1, cell << 3 | octant}))
        walk(h - 1, cell << 3 | octant, octant_orders.next[state][octant]);
  }
  std::set<std::pair<int, uint64_t>> cells_;
  bool all_;
  Curve curve_;
};

struct Case {
  const char* name;
  int height;
  Voxels voxels;
};
inline std::vector<Case> cases() {
  std::vector<Case> all;
  all.push_back({"nothing", 5, {}});
  all.push_back({"one voxel", 5, {{0, {}}}});
  all.push_back({"the last voxel", 5, {{(1u << 15) - 1, {}}}});
  all.push_back(
      {"one word", 2, voxels_where(2, [](uint32_t x, uint32_t y, uint32_t z) { return x + y > z; })});
  all.push_back({"full", 4, voxels_where(4, [](uint32_t, uint32_t, uint32_t) { return true; })});
  all.push_back({"sphere", 6, sphere_shell(6)});
  all.push_back(
      {"plane", 6, voxels_where(6, [](uint32_t x, uint32_t y, uint32_t z) { return x / 2 + y / 3 == z; })});
  all.push_back({"scattered", 7, scattered(7, 3000, 1)});
  all.push_back({"scattered far", 21, scattered(21, 3000, 2)});
  return all;
}

struct Variant {
  Colors colors;
  Counts counts;
  Curve curve;
};
inline std::vector<Variant> variants() {
  std::vector<Variant> all;
  for (const Colors colors : {Colors::leaf, Colors::all})
    for (const Counts counts : {Counts::node, Counts::pointer})
      for (const Curve curve : {Curve::morton, Curve::hilbert}) all.push_back({colors, counts, curve});
  return all;
}

/// All voxels of a case, and all cells that have colours, are found with the number that a plain walk gives
/// them, and no others.
inline void expect_order(const DagView& view, const Case& c, const PlainOrder& order) {
  CellFinder finder(view);
  for (const auto& [place, index] : order.index) {
    const Found found = find_voxel(view, place), next = finder.find(place, 0);
    ASSERT_TRUE(found.there && next.there) << place;
    ASSERT_EQ(found.color, index) << place;
    ASSERT_EQ(next.color, index) << place;
  }
  for (const auto& [cell, index] : order.cell_index) {
    const uint64_t place = cell.second << 3 * cell.first;
    const Found found = find_cell(view, place, cell.first), next = finder.find(place, cell.first);
    ASSERT_TRUE(found.there && next.there);
    ASSERT_EQ(found.color, index) << "height " << cell.first;
    ASSERT_EQ(next.color, index) << "height " << cell.first;
  }
  // No other voxels: all places of small grids, neighbours in the large one.
  const uint64_t end = c.voxels.empty() ? 64 : uint64_t{1} << 3 * std::min(c.height, 7);
  for (uint64_t place = 0; place < end; ++place)
    ASSERT_EQ(finder.find(place, 0).there, order.index.count(place) == 1) << place;
  for (const SurfaceVoxel& v : c.voxels)
    if (c.height > 7) {
      ASSERT_EQ(find_voxel(view, v.place ^ 1).there, order.index.count(v.place ^ 1) == 1);
    }
}

}  // namespace voxkit::color
