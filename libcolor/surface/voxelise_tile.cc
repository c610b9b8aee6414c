#include "libcolor/surface/voxelise_tile.h"

#include <algorithm>

#include "libcolor/surface/linear_light.h"

namespace voxkit::color {
namespace {

/// What a thread holds at once; a cube with more is split.
constexpr size_t most_triangles = size_t{1} << 15;
size_t most_pairs(int bits) {
  return std::max<size_t>(size_t{1} << (3 * bits), 4096);
}

Rgb stored(uint16_t r, uint16_t g, uint16_t b) {
  static const uint8_t* const table = light_tables().stored.data();
  return {table[r], table[g], table[b]};
}
Rgb stored(const Shade& shade) {
  return stored(shade.light(0), shade.light(1), shade.light(2));
}
template <class Mean>
Rgb stored(const Mean& mean) {
  const auto light = mean.light();
  return stored(light[0], light[1], light[2]);
}

}  // namespace

uint64_t TileWork::bytes(int bits, bool with_attributes) {
  return 2 * sizeof(Pair) * (most_pairs(bits) + (size_t{4} << bits)) +
         most_triangles * (with_attributes ? sizeof(TriangleTraits) : sizeof(TriangleShade));
}

void divide(const VoxelScene& scene, const Cube& cube, std::span<const uint32_t> triangles,
            std::array<std::vector<uint32_t>, 8>& lists) {
  for (const uint32_t triangle : triangles) {
    const TriangleCells cells = scene.cells(triangle);
    for (int child = 0; child < 8; ++child)
      if (cells.touches(child_of(cube, child))) lists[static_cast<size_t>(child)].push_back(triangle);
  }
}

Status TileWork::run(const VoxelScene& scene, const Cube& cube, std::span<const uint32_t> triangles,
                     VoxelBatch& out) {
  const bool plain = scene.attributes.empty();
  if (cube.bits == 0) {
    if (plain)
      one_voxel(scene, cube, triangles, out.voxels);
    else
      one_voxel_of_traits(scene, cube, triangles, out);
    return {};
  }
  if (triangles.size() > most_triangles ||
      !(plain ? collect(scene, cube, triangles, shades_) : collect(scene, cube, triangles, traits_)))
    return split(scene, cube, triangles, out);
  sort(3 * cube.bits);
  if (plain)
    color(cube, out.voxels);
  else
    color_and_attribute(scene, cube, out);
  return {};
}

Status TileWork::split(const VoxelScene& scene, const Cube& cube, std::span<const uint32_t> triangles,
                       VoxelBatch& out) {
  VOX_CHECK(check_interrupt());
  std::array<std::vector<uint32_t>, 8> lists;
  divide(scene, cube, triangles, lists);
  for (int child = 0; child < 8; ++child) {
    auto& list = lists[static_cast<size_t>(child)];
    if (!list.empty()) VOX_CHECK(run(scene, child_of(cube, child), list, out));
    list = {};
  }
  return {};
}

void TileWork::one_voxel(const VoxelScene& scene, const Cube& cube, std::span<const uint32_t> triangles,
                         std::vector<SurfaceVoxel>& out) {
  ShadeMean mean;
  for (const uint32_t triangle : triangles)
    scene.cells(triangle).each_cell(
        cube, [] {},
        [&](uint64_t) {
          const TriangleShade shade(scene, triangle, cube.lo);
          if (const Shade seen = shade.at(0, 0, 0); seen.cover()) mean.add(seen, shade.area_in(0, 0, 0));
        });
  if (mean.there()) out.push_back({first_place(cube), stored(mean)});
}

void TileWork::one_voxel_of_traits(const VoxelScene& scene, const Cube& cube,
                                   std::span<const uint32_t> triangles, VoxelBatch& out) {
  TraitMean mean;
  for (const uint32_t triangle : triangles)
    scene.cells(triangle).each_cell(
        cube, [] {},
        [&](uint64_t) {
          const TriangleTraits traits(scene, triangle, cube.lo);
          mean.add(traits.traits_at(0, 0, 0), traits.area_in(0, 0, 0));
        });
  if (!mean.there(scene.attributes)) return;
  out.voxels.push_back({first_place(cube), stored(mean)});
  mean.append_to(out.attributes, scene.attributes);
}

/// False where there are too many pairs.
template <class OfTriangle>
bool TileWork::collect(const VoxelScene& scene, const Cube& cube, std::span<const uint32_t> triangles,
                       std::vector<OfTriangle>& list) {
  count_ = 0;
  list.clear();
  const size_t limit = most_pairs(cube.bits), row = TriangleCells::most_in_row(cube);
  bool fits = true;
  for (const uint32_t triangle : triangles) {
    const auto number = static_cast<uint64_t>(list.size());
    const size_t before = count_;
    scene.cells(triangle).each_cell(
        cube,
        [&] {
          if (count_ > limit) {
            fits = false;
            count_ = before;
          }
          if (pairs_.size() < count_ + row) pairs_.resize(std::max(2 * pairs_.size(), count_ + row));
        },
        [&](uint64_t code) { pairs_[count_++] = code << 32 | number; });
    if (!fits) return false;
    if (count_ > before) list.emplace_back(scene, triangle, cube.lo);
  }
  return true;
}

/// By code, then by triangle: counting from the lowest digit of the code up, which keeps the order that is
/// there.
void TileWork::sort(int code_bits) {
  const auto begin = pairs_.begin();
  if (count_ < 512) {
    std::sort(begin, begin + static_cast<ptrdiff_t>(count_));
    return;
  }
  if (other_.size() < pairs_.size()) other_.resize(pairs_.size());
  const int digits = (code_bits + 10) / 11, bits = (code_bits + digits - 1) / digits;
  std::vector<uint32_t> places(size_t{1} << bits);
  for (int shift = 32; shift < 32 + code_bits; shift += bits) {
    std::fill(places.begin(), places.end(), 0);
    const uint64_t mask = places.size() - 1;
    for (size_t i = 0; i < count_; ++i) ++places[(pairs_[i] >> shift) & mask];
    uint32_t sum = 0;
    for (uint32_t& place : places) sum += std::exchange(place, sum);
    for (size_t i = 0; i < count_; ++i) other_[places[(pairs_[i] >> shift) & mask]++] = pairs_[i];
    std::swap(pairs_, other_);
  }
}

void TileWork::color(const Cube& cube, std::vector<SurfaceVoxel>& out) const {
  const uint64_t first = first_place(cube);
  out.reserve(out.size() + count_);
  const auto put = [&](uint32_t code, Rgb color) {
    // In place: a voxel that is put together elsewhere is read before its parts are there.
    SurfaceVoxel& voxel = out.emplace_back();
    voxel.place = first | code;
    voxel.color = color;
  };
  for (size_t i = 0; i < count_;) {
    const auto code = static_cast<uint32_t>(pairs_[i] >> 32);
    const glm::ivec3 at = morton_place(code);
    const auto shade_of = [&](size_t pair) -> const TriangleShade& {
      return shades_[static_cast<uint32_t>(pairs_[pair])];
    };
    size_t end = i + 1;
    while (end < count_ && pairs_[end] >> 32 == code) ++end;
    if (end == i + 1) {
      if (const Shade seen = shade_of(i).at(at.x, at.y, at.z); seen.cover() >= least_cover)
        put(code, stored(seen));
    } else {
      ShadeMean mean;
      for (size_t pair = i; pair < end; ++pair)
        if (const Shade seen = shade_of(pair).at(at.x, at.y, at.z); seen.cover())
          mean.add(seen, shade_of(pair).area_in(at.x, at.y, at.z));
      if (mean.there()) put(code, stored(mean));
    }
    i = end;
  }
}

void TileWork::color_and_attribute(const VoxelScene& scene, const Cube& cube, VoxelBatch& out) const {
  const uint64_t first = first_place(cube);
  out.voxels.reserve(out.voxels.size() + count_);
  out.attributes.reserve(out.attributes.size() + count_ * scene.attributes.bytes());
  for (size_t i = 0; i < count_;) {
    const auto code = static_cast<uint32_t>(pairs_[i] >> 32);
    const glm::ivec3 at = morton_place(code);
    const auto is_here = [&](size_t pair) { return pair < count_ && pairs_[pair] >> 32 == code; };
    const bool alone = !is_here(i + 1);
    TraitMean mean;
    for (; is_here(i); ++i) {
      const TriangleTraits& traits = traits_[static_cast<uint32_t>(pairs_[i])];
      mean.add(traits.traits_at(at.x, at.y, at.z), alone ? 0 : traits.area_in(at.x, at.y, at.z));
    }
    if (!mean.there(scene.attributes)) continue;
    out.voxels.push_back({first | code, stored(mean)});
    mean.append_to(out.attributes, scene.attributes);
  }
}

}  // namespace voxkit::color
