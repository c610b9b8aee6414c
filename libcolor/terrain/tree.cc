#include "libcolor/terrain/tree.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "libcolor/terrain/ground.h"

namespace voxkit::color::terrain {
namespace {

constexpr std::array<int32_t, 16> cos_of = {256,  237,  181,  98,  0, -98, -181, -237,
                                            -256, -237, -181, -98, 0, 98,  181,  237};

/// A number of lo..hi, by a hash.
int32_t pick(uint32_t h, int32_t lo, int32_t hi) {
  return lo + static_cast<int32_t>(int64_t{hi - lo} * (h >> 8) >> 24);
}

/// What of a crown is at a place: nothing, or how deep it is below the crown's surface, 0..256.
struct InCrown {
  int32_t depth = -1;
  Normal normal;
};

void fill(TreeModel& model, int32_t seed, int32_t filled, int32_t length, const auto& crown) {
  for (size_t axis = 0; axis < 3; ++axis)
    model.cubes[axis] = (axis == 1 ? model.hi - model.lo : 2 * model.reach) / TreeModel::cube + 1;
  model.leaves.assign(static_cast<size_t>(model.cubes[0] * model.cubes[1] * model.cubes[2]), Leaf{});
  size_t n = 0;
  for (int32_t k = 0; k < model.cubes[2]; ++k)
    for (int32_t j = 0; j < model.cubes[1]; ++j)
      for (int32_t i = 0; i < model.cubes[0]; ++i, ++n) {
        const uint32_t h = hash(i + (k << 10), j, seed), g = hash(i + (k << 10), j, seed + 1);
        if (static_cast<int32_t>(h & 255) >= filled) continue;
        const int32_t x =
            i * TreeModel::cube - model.reach + pick(hash(i, j + (k << 10), seed + 2), 0, TreeModel::cube);
        const int32_t y =
            j * TreeModel::cube + model.lo + pick(hash(i, j + (k << 10), seed + 3), 0, TreeModel::cube);
        const int32_t z =
            k * TreeModel::cube - model.reach + pick(hash(i, j + (k << 10), seed + 4), 0, TreeModel::cube);
        const InCrown in = crown(x, y, z);
        if (in.depth < 0) continue;
        Leaf& leaf = model.leaves[n];
        leaf = {x, y, z, 0, 0, 0, 0, 0, in.normal};
        // Leaves hang outwards, each in its own way.
        leaf.slope_x = static_cast<int16_t>(std::clamp(-in.normal.x * 3 / 4 + pick(g, -130, 130), -300, 300));
        leaf.slope_z = static_cast<int16_t>(
            std::clamp(-in.normal.z * 3 / 4 + pick(hash(i, j, k + seed), -130, 130), -300, 300));
        leaf.length = static_cast<int16_t>(pick(g * 2654435761u, length * 3 / 4, length) >> 4);
        leaf.direction = static_cast<uint8_t>(h >> 8 & 15);
        leaf.shade =
            static_cast<uint8_t>(std::clamp(196 - in.depth / 2 + static_cast<int32_t>(h >> 20 & 63), 0, 255));
      }
}

/// Round clumps of leaves around a middle.
TreeModel broadleaf(int32_t seed, int32_t height, std::array<uint8_t, 3> albedo) {
  TreeModel model;
  model.albedo = albedo;
  model.trunk_radius = height / 26;
  model.trunk_height = height * 11 / 16;
  struct Clump {
    int32_t x, y, z, radius;
  };
  std::vector<Clump> clumps;
  const int32_t wide = height * 9 / 32;
  model.lo = INT32_MAX;
  for (int32_t i = 0; i < 15; ++i) {
    const auto part = [&](int32_t axis) { return pick(hash(i, axis, seed), -1024, 1024); };
    Clump c{};
    const int32_t y = i == 0 ? 0 : part(1);
    // Narrower above and below the middle.
    const int32_t room = 1024 - std::abs(y) * 5 / 8;
    c.x = static_cast<int32_t>(int64_t{part(0)} * room / 1024 * wide >> 10);
    c.z = static_cast<int32_t>(int64_t{part(2)} * room / 1024 * wide >> 10);
    c.y = height * 10 / 16 + static_cast<int32_t>(int64_t{y} * (height / 4) >> 10);
    c.radius = pick(hash(i, 9, seed), height / 9, height / 6);
    clumps.push_back(c);
    model.reach = std::max({model.reach, std::abs(c.x) + c.radius, std::abs(c.z) + c.radius});
    model.lo = std::min(model.lo, c.y - c.radius);
    model.hi = std::max(model.hi, c.y + c.radius);
  }
  fill(model, seed, 190, cm(13), [&](int32_t x, int32_t y, int32_t z) {
    InCrown in;
    int64_t best = INT64_MAX;
    const Clump* nearest = nullptr;
    for (const Clump& c : clumps) {
      const int64_t dx = x - c.x, dy = y - c.y, dz = z - c.z;
      const int64_t at = ((dx * dx + dy * dy + dz * dz) << 8) / (int64_t{c.radius} * c.radius);
      if (at < best) best = at, nearest = &c;
    }
    // A shell: leaves grow where there is light.
    if (best > 256 || best < 88) return in;
    in.depth = static_cast<int32_t>(256 - best);
    in.normal = normalised((x - nearest->x) >> 8, ((y - nearest->y) >> 8) + (nearest->radius >> 10),
                           (z - nearest->z) >> 8);
    return in;
  });
  return model;
}

/// Storeys of drooping branches.
TreeModel conifer(int32_t seed, int32_t height, std::array<uint8_t, 3> albedo) {
  TreeModel model;
  model.albedo = albedo;
  model.trunk_radius = height / 40;
  model.trunk_height = height - cm(30);
  model.lo = height / 8;
  model.hi = height;
  model.reach = height * 7 / 32;
  fill(model, seed, 225, cm(12), [&](int32_t x, int32_t y, int32_t z) {
    InCrown in;
    const auto from = static_cast<int32_t>(std::sqrt(static_cast<double>(int64_t{x} * x + int64_t{z} * z)));
    // Branches stick out of each storey.
    const int32_t storey = y / cm(75), within = y % cm(75);
    const int32_t branch = static_cast<int32_t>(
        hash((x * 5 / (from / 8 + 1)) >> 3, (z * 5 / (from / 8 + 1)) >> 3, storey + seed) & 63);
    int64_t radius = int64_t{model.hi - y} * model.reach / (model.hi - model.lo);
    radius = radius * (256 - within * 84 / cm(75) - branch) >> 8;
    if (from > radius || from * 2 < radius) return in;
    in.depth = static_cast<int32_t>(256 - int64_t{from} * 256 / std::max<int64_t>(radius, 1));
    in.normal = normalised(x >> 8, from >> 9, z >> 8);
    return in;
  });
  return model;
}

/// Half of the least width of a leaf: of a voxel, but for the coarsest.
int32_t widest(int32_t voxel) {
  return std::min(voxel * 5 / 8, 2 * TreeModel::longest);
}

uint8_t scaled(int32_t v, int32_t light) {
  return static_cast<uint8_t>(std::clamp(v * light >> 8, 0, 255));
}

}  // namespace

LeafShape::LeafShape(const Leaf& leaf, const Tree& tree, int32_t voxel)
    : x(tree.x + tree.mirror_x * leaf.x),
      y(tree.y + leaf.y),
      z(tree.z + tree.mirror_z * leaf.z),
      length(std::max(leaf.length << 4, widest(voxel))),
      slope_x_(tree.mirror_x * leaf.slope_x),
      slope_z_(tree.mirror_z * leaf.slope_z),
      cos_(tree.mirror_x * cos_of[leaf.direction]),
      sin_(tree.mirror_z * cos_of[(leaf.direction + 12) & 15]),
      width_(std::max(length * 5 / 8, widest(voxel))) {}

int32_t LeafShape::height(int32_t px, int32_t pz, int32_t& rib) const {
  const int32_t dx = px - x, dz = pz - z;
  const int64_t along = (int64_t{dx} * cos_ + int64_t{dz} * sin_) >> 8,
                across = std::abs((int64_t{dz} * cos_ - int64_t{dx} * sin_) >> 8);
  // Two parabolas.
  const int64_t room = int64_t{length} * length - along * along;
  if (room < 0 || across * length * length > width_ * room) return INT32_MIN;
  rib = static_cast<int32_t>(across * 256 / width_);
  return y + ((dx * slope_x_ + dz * slope_z_) >> 8);
}

Forest::Forest(const Ground& ground, std::span<const House> houses) {
  models.push_back(broadleaf(1001, cm(720), {82, 118, 40}));
  models.push_back(broadleaf(1002, cm(850), {70, 108, 44}));
  models.push_back(broadleaf(1003, cm(560), {104, 126, 44}));
  models.push_back(broadleaf(1004, cm(640), {150, 128, 46}));
  models.push_back(conifer(1005, cm(900), {46, 84, 52}));
  models.push_back(conifer(1006, cm(680), {54, 90, 50}));
  constexpr int32_t gap = 5 * metre;
  for (int32_t k = 0; k < side / gap; ++k)
    for (int32_t i = 0; i < side / gap; ++i) {
      const uint32_t h = hash(i, k, 1111);
      Tree tree{};
      tree.x = i * gap + pick(hash(i, k, 1112), 0, gap * 3 / 4);
      tree.z = k * gap + pick(hash(i, k, 1113), 0, gap * 3 / 4);
      const int32_t wood =
          gradient_noise(tree.x, tree.z, 22, 1114) * 2 + gradient_noise(tree.x, tree.z, 20, 1115);
      const int32_t road = ground.road(tree.x, tree.z);
      // Woods, and single trees in the hamlet.
      const bool in_wood = wood > 500 && road > 12 * metre;
      if (!in_wood && (h & 15) >= 2) continue;
      if (in_wood && (h & 15) >= 12) continue;
      const bool dark = in_wood && (gradient_noise(tree.x, tree.z, 21, 1116) > 100 || (h >> 4 & 7) == 0);
      tree.model = static_cast<int32_t>(dark ? 4 + (h >> 8 & 1) : (h >> 8) % 13 / 4);
      tree.mirror_x = (h & 1u << 12) != 0 ? 1 : -1;
      tree.mirror_z = (h & 1u << 13) != 0 ? 1 : -1;
      tree.tint = static_cast<int32_t>(h >> 16 & 63) - 32;
      const TreeModel& m = model(tree);
      const auto inside = [&](int32_t v) { return v > m.reach + cm(60) && v < side - m.reach - cm(60); };
      if (!inside(tree.x) || !inside(tree.z) || road < m.reach / 2 + cm(250) ||
          ground.rock(tree.x, tree.z) > 120)
        continue;
      bool free = true;
      for (const House& house : houses) {
        const House::Local at = house.local(tree.x, tree.z);
        free = free && (std::abs(at.a) > house.length + m.reach + cm(40) ||
                        std::abs(at.b) > house.width + m.reach + cm(40));
      }
      tree.y = ground.height(tree.x, tree.z) - cm(5);
      if (!free || tree.y + m.hi + cm(30) >= ceiling) continue;
      trees.push_back(tree);
    }
}

int32_t Forest::trunk_top(const Tree& tree, int32_t px, int32_t pz) const {
  const TreeModel& m = model(tree);
  const int64_t dx = px - tree.x, dz = pz - tree.z;
  const auto from = static_cast<int64_t>(std::sqrt(static_cast<double>(dx * dx + dz * dz)));
  if (from >= m.trunk_radius * 2) return INT32_MIN;
  // Roots flare at the foot; above, it gets thinner evenly.
  if (from > m.trunk_radius) {
    const int64_t out = from - m.trunk_radius;
    return tree.y +
           static_cast<int32_t>(int64_t{m.trunk_radius - out} * (m.trunk_radius - out) / m.trunk_radius);
  }
  return tree.y + m.trunk_radius +
         static_cast<int32_t>((m.trunk_radius - from) * (m.trunk_height - m.trunk_radius) / m.trunk_radius);
}

Rgb Forest::trunk_color(const Tree& tree, int32_t px, int32_t py, int32_t pz, const Light& light) const {
  const int32_t dx = px - tree.x, dz = pz - tree.z;
  const Normal n = normalised(dx >> 4, 0, dz >> 4);
  const int32_t bark = static_cast<int32_t>(hash((n.x >> 5) * 64 + (n.z >> 5), py >> 14, 1201) & 63);
  const int32_t tone = 224 + bark - static_cast<int32_t>(hash(px, py, pz) & 15);
  const int32_t out = cm(12) >> 8;
  return light.shade({scaled(100, tone), scaled(78, tone), scaled(58, tone)}, n, px + n.x * out, py,
                     pz + n.z * out);
}

Rgb Forest::leaf_color(const Tree& tree, const Leaf& leaf, int32_t rib, int32_t px, int32_t py, int32_t pz,
                       const Light& light) const {
  const TreeModel& m = model(tree);
  const int32_t tone =
      150 + leaf.shade / 2 + (rib < 28 ? 22 : 0) - static_cast<int32_t>(hash(px, py, pz) & 15);
  const int32_t yellow = tree.tint + leaf.direction * 2 - 16;
  const Rgb albedo{scaled(m.albedo[0] + yellow / 2, tone), scaled(m.albedo[1] + yellow / 8, tone),
                   scaled(m.albedo[2], tone)};
  const Normal n =
      normalised(leaf.normal.x * tree.mirror_x, leaf.normal.y + 70, leaf.normal.z * tree.mirror_z);
  return light.shade(albedo, n, px, py + cm(8), pz, 128 + leaf.shade / 2);
}

}  // namespace voxkit::color::terrain
