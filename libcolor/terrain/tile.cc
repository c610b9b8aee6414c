#include "libcolor/terrain/tile.h"

#include <algorithm>
#include <bit>

#include "libcolor/surface/morton.h"

namespace voxkit::color::terrain {
namespace {

constexpr auto width = static_cast<size_t>(Tile::width);

/// Bits of a number of 0..31 at every third place.
constexpr std::array<uint32_t, width> spread = [] {
  std::array<uint32_t, width> table{};
  for (uint32_t i = 0; i < width; ++i) table[i] = static_cast<uint32_t>(spread_bits(i));
  return table;
}();

}  // namespace

void Tile::run(const Scene& scene, const Sampling& sampling, const std::array<int64_t, 3>& corner,
               uint64_t first, std::vector<SurfaceVoxel>& out) {
  scene_ = &scene;
  sampling_ = &sampling;
  corner_ = corner;
  edge_ = sampling.edge();
  measure();
  solid_.fill(0);
  surface_.fill(0);
  leaf_.fill(0);
  part_count_ = 0;
  if (!scene.in_the_air(extent_)) add_ground();
  add_houses();
  add_trunks();
  if (solid_ != Columns{}) find_surface();
  add_leaves();
  emit(first, out);
}

void Tile::measure() {
  for (size_t i = 0; i < across; ++i) {
    const int64_t step = static_cast<int64_t>(i) - 1;
    xs_[i] = sampling_->x(corner_[0] + step);
    ys_[i] = sampling_->y(corner_[1] + step);
    zs_[i] = sampling_->x(corner_[2] + step);
  }
  extent_ = {{xs_.front(), ys_.front(), zs_.front()}, {xs_.back(), ys_.back(), zs_.back()}};
}

/// The voxels whose samples are at heights lo..hi, as bits of a column.
uint64_t Tile::span(int32_t lo, int32_t hi) const {
  const int64_t begin = lo <= 0 ? -1 : sampling_->samples_below(lo),
                end = hi < 0 ? 0 : sampling_->samples_below(hi + 1);
  const int64_t base = corner_[1] - 1;
  const int64_t from = std::clamp<int64_t>(begin - base, 0, across),
                to = std::clamp<int64_t>(end - base, 0, across);
  return from >= to ? 0 : ((uint64_t{1} << to) - 1) & ~((uint64_t{1} << from) - 1);
}

const Tile::Patch& Tile::find_patch() {
  for (const Patch& patch : patches_)
    if (patch.x == corner_[0] && patch.z == corner_[2]) return patch;
  Patch& patch = patches_[next_patch_++ % patches_.size()];
  patch.x = corner_[0], patch.z = corner_[2];
  // What is outside of the world is not looked at.
  std::array<int32_t, across> xs, zs;
  for (size_t i = 0; i < across; ++i)
    xs[i] = std::clamp(xs_[i], 0, side - 1), zs[i] = std::clamp(zs_[i], 0, side - 1);
  scene_->ground().patch(xs, zs, edge_, patch.points.data());
  return patch;
}

void Tile::add_ground() {
  const int64_t n = sampling_->n();
  ground_ = &find_patch();
  for (size_t k = 0; k < across; ++k)
    for (size_t i = 0; i < across; ++i) {
      const int64_t x = corner_[0] + static_cast<int64_t>(i) - 1,
                    z = corner_[2] + static_cast<int64_t>(k) - 1;
      if (x < 0 || z < 0 || x >= n || z >= n) continue;
      uint64_t& column = solid_[k * across + i];
      column = span(0, ground_->points[k * across + i].height);
      if (scene_->box() && xs_[i] >= hidden_box.lo[0] && xs_[i] <= hidden_box.hi[0] &&
          zs_[k] >= hidden_box.lo[2] && zs_[k] <= hidden_box.hi[2])
        column &= ~span(hidden_box.lo[1], hidden_box.hi[1]);
    }
}

Tile::Part& Tile::add_part() {
  if (part_count_ == parts_.size()) parts_.emplace_back();
  Part& part = parts_[part_count_++];
  part.house = nullptr;
  part.tree = nullptr;
  part.columns.fill(0);
  return part;
}

void Tile::add_houses() {
  for (const House& house : scene_->houses()) {
    const int32_t reach = house.reach();
    if (extent_.lo[0] > house.x + reach || extent_.hi[0] < house.x - reach ||
        extent_.lo[2] > house.z + reach || extent_.hi[2] < house.z - reach || extent_.lo[1] > house.top() ||
        extent_.hi[1] < house.base - metre)
      continue;
    Part& part = add_part();
    part.house = &house;
    for (size_t k = 0; k < across; ++k)
      for (size_t i = 0; i < across; ++i) {
        const House::Parts parts = house.column(xs_[i], zs_[k]);
        // What is taken away is taken from the walls, which come first.
        uint64_t column = 0;
        for (int p = 0; p < parts.solids; ++p) {
          const Interval& solid = parts.solid[static_cast<size_t>(p)];
          column |= span(solid.lo, solid.hi);
          if (p > 0) continue;
          for (int q = 0; q < parts.hollows; ++q) {
            const Interval& hollow = parts.hollow[static_cast<size_t>(q)];
            column &= ~span(hollow.lo, hollow.hi);
          }
        }
        part.columns[k * across + i] = column;
        solid_[k * across + i] |= column;
      }
  }
}

void Tile::add_trunks() {
  for (const Tree& tree : scene_->forest().trees) {
    const TreeModel& model = scene_->forest().model(tree);
    const int32_t reach = 2 * model.trunk_radius, top = tree.y + model.trunk_height + model.trunk_radius;
    if (extent_.lo[0] > tree.x + reach || extent_.hi[0] < tree.x - reach || extent_.lo[2] > tree.z + reach ||
        extent_.hi[2] < tree.z - reach || extent_.lo[1] > top || extent_.hi[1] < tree.y - metre)
      continue;
    Part& part = add_part();
    part.tree = &tree;
    for (size_t k = 0; k < across; ++k)
      for (size_t i = 0; i < across; ++i) {
        const int32_t to = scene_->forest().trunk_top(tree, xs_[i], zs_[k]);
        if (to == INT32_MIN) continue;
        part.columns[k * across + i] = span(tree.y - metre, to);
        solid_[k * across + i] |= part.columns[k * across + i];
      }
  }
}

void Tile::find_surface() {
  constexpr uint64_t inner = ((uint64_t{1} << width) - 1) << 1;
  for (size_t k = 1; k <= width; ++k)
    for (size_t i = 1; i <= width; ++i) {
      const uint64_t* const column = &solid_[k * across + i];
      const uint64_t hidden =
          (*column << 1) & (*column >> 1) & column[1] & *(column - 1) & column[across] & *(column - across);
      const uint32_t at = spread[i - 1] | spread[k - 1] << 2;
      for (uint64_t left = *column & ~hidden & inner; left != 0; left &= left - 1) {
        const uint32_t code = at | spread[static_cast<size_t>(std::countr_zero(left)) - 1] << 1;
        surface_[code >> 6] |= uint64_t{1} << (code & 63);
      }
    }
}

void Tile::add_leaves() {
  const Forest& forest = scene_->forest();
  // How far leaves reach that are made as wide as voxels.
  const int32_t margin = 2 * TreeModel::longest;
  for (const Tree& tree : forest.trees) {
    const TreeModel& model = forest.model(tree);
    if (extent_.lo[0] > tree.x + model.reach + margin || extent_.hi[0] < tree.x - model.reach - margin ||
        extent_.lo[2] > tree.z + model.reach + margin || extent_.hi[2] < tree.z - model.reach - margin ||
        extent_.lo[1] > tree.y + model.hi + margin || extent_.hi[1] < tree.y + model.lo - margin)
      continue;
    forest.leaves_in(tree, extent_.lo, extent_.hi, [&](const Leaf& leaf) {
      const LeafShape shape(leaf, tree, edge_);
      if (const int32_t rise = shape.rise(); shape.y + rise < extent_.lo[1] || shape.y - rise > extent_.hi[1])
        return;
      if (shape.x + shape.length < xs_[1] || shape.x - shape.length > xs_[width] ||
          shape.z + shape.length < zs_[1] || shape.z - shape.length > zs_[width])
        return;
      const auto first = [&](int32_t lo, int32_t corner) {
        return static_cast<size_t>(std::clamp((lo - corner) / edge_ - 1, 0, Tile::width - 1)) + 1;
      };
      for (size_t k = first(shape.z - shape.length, zs_[1]); k <= width && zs_[k] <= shape.z + shape.length;
           ++k)
        for (size_t i = first(shape.x - shape.length, xs_[1]); i <= width && xs_[i] <= shape.x + shape.length;
             ++i) {
          int32_t rib = 0;
          const int32_t y = shape.height(xs_[i], zs_[k], rib);
          if (y < 0) continue;
          const int64_t j = sampling_->samples_below(y + 1) - 1 - corner_[1];
          if (j < 0 || j >= Tile::width || (solid_[k * across + i] >> (j + 1) & 1) != 0) continue;
          const uint32_t code = spread[i - 1] | spread[k - 1] << 2 | spread[static_cast<size_t>(j)] << 1;
          uint64_t& word = leaf_[code >> 6];
          const uint64_t bit = uint64_t{1} << (code & 63);
          if ((word & bit) != 0) continue;
          word |= bit;
          leaf_colors_[code] = forest.leaf_color(tree, leaf, rib, xs_[i], y, zs_[k], scene_->light());
        }
    });
  }
}

Rgb Tile::ground_color(size_t column, int32_t x, int32_t y, int32_t z) {
  const auto& around = ground_->points;
  const GroundPoint& p = around[column];
  const int64_t n = sampling_->n();
  const bool at_side = x - edge_ < 0 || z - edge_ < 0 || x + edge_ >= side || z + edge_ >= side;
  const Light& light = scene_->light();
  const int32_t depth = p.height - y;
  if (at_side && depth > std::max(edge_, cm(4))) {
    const Normal out = normalised(x - edge_ < 0       ? -256
                                  : x + edge_ >= side ? 256
                                                      : 0,
                                  0,
                                  z - edge_ < 0       ? -256
                                  : z + edge_ >= side ? 256
                                                      : 0);
    return light.shade(Ground::strata(x, y, z, depth), out, x, p.height + metre, z);
  }
  // No light gets to the box.
  if (scene_->box() && y <= hidden_box.hi[1] + edge_ && p.height > hidden_box.hi[1] + edge_ && depth > edge_)
    return {};
  // Slopes in 1/256, over two voxels.
  const auto slope = [&](const GroundPoint& from, const GroundPoint& to) {
    return static_cast<int32_t>(
        std::clamp<int64_t>((int64_t{to.height} - from.height) * n >> 17, -4000, 4000));
  };
  const int32_t sx = slope(around[column - 1], around[column + 1]),
                sz = slope(around[column - across], around[column + across]);
  const Normal normal = normalised(-sx, 256, -sz);
  const Rgb albedo = Ground::albedo(p, x, z, std::max(260 - normal.y * 260 / 256, 0), edge_);
  const int32_t hollow = around[column - 1].height + around[column + 1].height +
                         around[column - across].height + around[column + across].height - 4 * p.height;
  const int32_t cavity = 256 - static_cast<int32_t>(std::clamp<int64_t>(int64_t{hollow} * n >> 19, -24, 110));
  // The light is that at the surface, which is up to an edge above the sample.
  return light.shade(albedo, normal, x, std::min(p.height, y + edge_), z, cavity);
}

void Tile::emit(uint64_t first, std::vector<SurfaceVoxel>& out) {
  for (uint32_t word = 0; word < surface_.size(); ++word)
    for (uint64_t left = surface_[word] | leaf_[word]; left != 0; left &= left - 1) {
      const uint64_t bit = left & (~left + 1);
      const uint32_t code = word << 6 | static_cast<uint32_t>(std::countr_zero(left));
      if ((leaf_[word] & bit) != 0) {
        out.push_back({first + code, leaf_colors_[code]});
        continue;
      }
      const auto place = morton_place(code);
      const size_t i = place.x + 1, j = place.y + 1, k = place.z + 1, column = k * across + i;
      const Part* owner = nullptr;
      for (size_t p = 0; p < part_count_ && owner == nullptr; ++p)
        if ((parts_[p].columns[column] >> j & 1) != 0) owner = &parts_[p];
      const int32_t x = xs_[i], y = ys_[j], z = zs_[k];
      const Rgb color = owner == nullptr ? ground_color(column, x, y, z)
                        : owner->house   ? owner->house->color(x, y, z, edge_, scene_->light())
                                       : scene_->forest().trunk_color(*owner->tree, x, y, z, scene_->light());
      out.push_back({first + code, color});
    }
}

}  // namespace voxkit::color::terrain
