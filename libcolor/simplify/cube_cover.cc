#include "libcolor/simplify/cube_cover.h"

#include <algorithm>

#include "libcolor/surface/linear_light.h"
#include "libcolor/surface/morton.h"

namespace voxkit::color {
namespace {

constexpr uint32_t cube_side = 1 << cover_bits;
constexpr uint64_t cube_places = uint64_t{1} << 3 * cover_bits;

/// What a cell is.
enum : uint8_t { exact = 1, kept = 2, uncovered = 4, outside = 8 };

uint32_t side_of(int squared, uint32_t& margin) {
  while ((margin + 1) * (margin + 1) <= static_cast<uint32_t>(squared)) ++margin;
  return cube_side + 2 * margin;
}

// A voxel and the 26 around it: bit x + 3y + 9z.
constexpr uint32_t not_first_x = 0x6db6db6, not_last_x = 0x36db6db, not_first_y = 0x7e3f1f8,
                   not_last_y = 0x0fc7e3f;
constexpr uint32_t faces_x = 1 << 12 | 1 << 14, faces_y = 1 << 10 | 1 << 16, faces_z = 1 << 4 | 1 << 22;

/// Those of `open` that a way through faces leads to from `from`.
uint32_t reached_in(uint32_t open, uint32_t from) {
  for (;;) {
    uint32_t next = from | (from & not_last_x) << 1 | (from & not_first_x) >> 1;
    next |= (from & not_last_y) << 3 | (from & not_first_y) >> 3 | from << 9 | from >> 9;
    next &= open;
    if (next == from) return from;
    from = next;
  }
}

}  // namespace

CubeCover::CubeCover(int squared) : side_(side_of(squared, margin_)) {
  for (const Step& step : ball(squared)) {
    const auto side = static_cast<int32_t>(side_);
    steps_.push_back((step.z * side + step.y) * side + step.x);
    lengths_.push_back(step.squared);
  }
  empty_.assign(size_t{side_} * side_ * side_, outside);
  for (uint64_t place = 0; place < cube_places; ++place) empty_[cell_of(place)] = 0;
  gains_.resize(empty_.size());
  for (auto& numbers : numbers_) numbers.resize(empty_.size());
}

uint64_t CubeCover::bytes(int squared) {
  uint32_t margin = 1;
  const uint64_t side = side_of(squared, margin);
  // Of a cube, lists of cells and of voxels.
  return side * side * side * 12 + cube_places * (5 * sizeof(uint32_t) + sizeof(Kept) + sizeof(Light));
}

uint32_t CubeCover::cell_of(uint64_t place) const {
  const glm::uvec3 at = morton_place(place & (cube_places - 1)) + margin_;
  return (at.z * side_ + at.y) * side_ + at.x;
}

void CubeCover::enter(std::span<const SurfaceVoxel> voxels, Index3 dims) {
  cube_ = voxels.front().place / cube_places;
  cells_ = empty_;
  const Index3 inside = dims - Index3(morton_place(cube_)) * int64_t{cube_side};
  if (std::min({inside.x, inside.y, inside.z}) < int64_t{cube_side})
    for (uint64_t place = 0; place < cube_places; ++place) {
      const Index3 at(morton_place(place));
      if (at.x >= inside.x || at.y >= inside.y || at.z >= inside.z) cells_[cell_of(place)] = outside;
    }
  own_.clear();
  for (const SurfaceVoxel& voxel : voxels) {
    const uint32_t cell = cell_of(voxel.place);
    cells_[cell] = exact | uncovered;
    numbers_[0][cell] = static_cast<uint32_t>(own_.size());
    own_.push_back(cell);
  }
}

/// Whether a voxel may go without opening a way through the surface: there is void on both sides of it, and
/// around it all that is void already comes together. Of what is outside of the cube nothing is known: it
/// counts as there.
bool CubeCover::is_loose(uint32_t cell) const {
  uint32_t open = 0;
  for (uint32_t i = 0; i < 27; ++i) {
    const uint32_t at = cell + ((i / 9 - 1) * side_ + (i / 3 % 3 - 1)) * side_ + i % 3 - 1;
    if ((cells_[at] & (exact | outside)) == 0) open |= 1u << i;
  }
  bool between = false;
  for (const uint32_t faces : {faces_x, faces_y, faces_z}) between |= (open & faces) == faces;
  const uint32_t faces = open & (faces_x | faces_y | faces_z);
  return between && (faces & ~reached_in(open, faces & (~faces + 1))) == 0;
}

/// Which candidates come first: those that cover more; of these the ones that are voxels already, then those
/// at even places, so that patterns repeat.
size_t CubeCover::rank(uint32_t cell) const {
  if (gains_[cell] == 0) return 0;
  const uint32_t x = cell % side_ - margin_, y = cell / side_ % side_ - margin_,
                 z = cell / side_ / side_ - margin_;
  const uint32_t even = 3 - (x & 1) - (y & 1) - (z & 1);
  return 8 * size_t{gains_[cell]} + ((cells_[cell] & exact) != 0 ? 4 : 0) + even;
}

void CubeCover::keep(uint32_t cell) {
  const uint32_t m = margin_;
  cells_[cell] |= kept;
  kept_.push_back({cube_ * cube_places +
                       morton_code(cell % side_ - m, cell / side_ % side_ - m, cell / side_ / side_ - m),
                   cell});
  around(cell, [&](uint32_t near) {
    if ((cells_[near] & uncovered) == 0) return;
    cells_[near] &= static_cast<uint8_t>(~uncovered);
    around(near, [&](uint32_t other) { --gains_[other]; });
  });
}

void CubeCover::choose() {
  candidates_.clear();
  for (const uint32_t cell : own_)
    around(cell, [&](uint32_t near) {
      if (gains_[near]++ == 0 && (cells_[near] & outside) == 0) candidates_.push_back(near);
    });
  kept_.clear();
  for (const uint32_t cell : own_)
    if (!is_loose(cell)) keep(cell);
  const auto enlist = [&](uint32_t cell, size_t at) {
    if (by_rank_.size() <= at) by_rank_.resize(at + 1);
    by_rank_[at].push_back(cell);
  };
  for (const uint32_t cell : candidates_) enlist(cell, rank(cell));
  // Ranks only sink. What has sunk is put where it belongs when its turn comes.
  for (size_t r = by_rank_.size(); r-- > 1;) {
    for (const uint32_t cell : by_rank_[r]) {
      if (const size_t now = rank(cell); now < r)
        enlist(cell, now);
      else
        keep(cell);
    }
    by_rank_[r].clear();
  }
  if (!by_rank_.empty()) by_rank_[0].clear();
}

void CubeCover::write(const VoxelRun& in, size_t attribute_bytes, Voxels& out) {
  std::sort(kept_.begin(), kept_.end(), [](const Kept& a, const Kept& b) { return a.place < b.place; });
  for (size_t i = 0; i < kept_.size(); ++i) numbers_[1][kept_[i].cell] = static_cast<uint32_t>(i);
  light_.assign(kept_.size(), {});
  const LightTables& tables = light_tables();
  const auto add = [&](Light& light, Rgb color) {
    light.sum[0] += tables.linear[color.r];
    light.sum[1] += tables.linear[color.g];
    light.sum[2] += tables.linear[color.b];
    ++light.count;
  };
  // Each voxel gives its colour to what is nearest to it.
  for (size_t i = 0; i < own_.size(); ++i)
    for (const int32_t step : steps_)
      if (const uint32_t near = own_[i] + static_cast<uint32_t>(step); (cells_[near] & kept) != 0) {
        add(light_[numbers_[1][near]], in.voxels[i].color);
        break;
      }
  out.voxels.clear();
  out.attributes.clear();
  for (size_t k = 0; k < kept_.size(); ++k) {
    Light& light = light_[k];
    size_t step = 0;
    const auto near = [&] { return kept_[k].cell + static_cast<uint32_t>(steps_[step]); };
    while ((cells_[near()] & exact) == 0) ++step;
    const auto nearest = numbers_[0][near()];
    if (light.count == 0)  // then it takes that of the nearest ones
      for (const uint8_t length = lengths_[step]; step < steps_.size() && lengths_[step] == length; ++step)
        if ((cells_[near()] & exact) != 0) add(light, in.voxels[numbers_[0][near()]].color);
    const auto mean = [&](uint64_t sum) {
      return tables.stored[(2 * sum + light.count) / (2 * light.count)];
    };
    out.voxels.push_back({kept_[k].place, {mean(light.sum[0]), mean(light.sum[1]), mean(light.sum[2])}});
    const auto attributes = in.attributes.subspan(nearest * attribute_bytes, attribute_bytes);
    out.attributes.insert(out.attributes.end(), attributes.begin(), attributes.end());
  }
}

void CubeCover::cover(const VoxelRun& in, size_t attribute_bytes, Index3 dims, Voxels& out) {
  enter(in.voxels, dims);
  choose();
  write(in, attribute_bytes, out);
}

}  // namespace voxkit::color
