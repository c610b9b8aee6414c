// Sparse voxel mip-maps by the book: whole volumes in memory, one voxel at a time, no streaming, no shared
// code with the encoder but the level geometry. What it decodes, at every level, is what the encoder's file
// must decode to (base raw).
#pragma once

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "libsvmm/layout.h"
#include "libsvmm/svmm.h"

namespace voxkit::svmm::reference {

/// One voxel of V_k with everything that is known about the originals below it.
struct Cell {
  int64_t count = 0;  // originals; 0: outside the volume
  std::vector<Voxel> originals;
  double sum = 0, finite = 0;  // FLOAT32: of the finite originals, block by block
  Voxel value;                 // undecoded average
  bool terminal = true;
};

struct Level {
  Index3 dims{0};
  std::vector<Cell> cells;
  uint64_t blocks = 0, terminal_voxels = 0;
  Cell& at(Index3 v) { return cells[static_cast<size_t>((v.z * dims.y + v.y) * dims.x + v.x)]; }
};

inline double component(const Voxel& v, VoxelFormat f, int c) {
  if (f == VoxelFormat::density16) return v.as<uint16_t>();
  if (f == VoxelFormat::float32) return static_cast<double>(v.as<float>());
  return std::to_integer<int>(v.bytes[static_cast<size_t>(c)]);
}

inline double distance_between(const Voxel& a, const Voxel& b, VoxelFormat f, const Params& params) {
  if (a == b) return 0;
  double sum = 0;
  for (int c = 0; c < attributes(f); ++c) {
    const double d = component(a, f, c) - component(b, f, c);
    sum += d * d;
  }
  if (std::isnan(sum)) return INFINITY;
  const double spread = params.layout == Layout::thesis && !is_color(f) ? 2 : 1;
  const double distance = std::sqrt(sum) * spread;
  // -0 and +0, or two NaN: apart, if nothing may be lost.
  return distance == 0 ? 1e-300 : distance;
}

inline int64_t round_half_up(int64_t a, int64_t b) {
  return (2 * a + b) / (2 * b);
}

inline Voxel average(const Cell& cell, VoxelFormat f, const Params& params) {
  const std::vector<Voxel>& originals = cell.originals;
  bool equal = true;
  for (const Voxel& v : originals) equal &= v == originals[0];
  Voxel out;
  if (is_color(f)) {
    int64_t sum[3] = {}, weights = 0, alpha = 0;
    for (const Voxel& v : originals) {
      const int a = f == VoxelFormat::rgba32 ? std::to_integer<int>(v.bytes[3]) : 255;
      const int weight = params.alpha_weight && f == VoxelFormat::rgba32 ? a : 1;
      alpha += a;
      weights += weight;
      for (int c = 0; c < 3; ++c) sum[c] += weight * std::to_integer<int>(v.bytes[static_cast<size_t>(c)]);
    }
    for (size_t c = 0; c < 3; ++c)
      out.bytes[c] = static_cast<std::byte>(weights ? round_half_up(sum[c], weights) : 0);
    if (f == VoxelFormat::rgba32)
      out.bytes[3] = static_cast<std::byte>(round_half_up(alpha, static_cast<int64_t>(originals.size())));
    if (equal) out = originals[0];
    if (f == VoxelFormat::rgba32 && params.layout == Layout::thesis) {
      const double bits = std::round(std::to_integer<int>(out.bytes[3]) * 7 / 255.0);
      out.bytes[3] = static_cast<std::byte>(std::lround(bits * 255 / 7));
    }
  } else if (f == VoxelFormat::float32) {
    if (equal) return originals[0];
    out = Voxel::of(cell.finite > 0 ? static_cast<float>(cell.sum / cell.finite)
                                    : std::numeric_limits<float>::quiet_NaN());
  } else {
    int64_t sum = 0;
    for (const Voxel& v : originals) sum += static_cast<int64_t>(component(v, f, 0));
    const int64_t n = static_cast<int64_t>(originals.size());
    if (f == VoxelFormat::bitmap)
      out = Voxel::of(static_cast<uint8_t>(round_half_up(255 * sum, n)));
    else if (f == VoxelFormat::density8)
      out = Voxel::of(static_cast<uint8_t>(round_half_up(sum, n)));
    else
      out = Voxel::of(static_cast<uint16_t>(round_half_up(sum, n)));
  }
  return out;
}

/// Whether a box of component values, rather than the voxels themselves, decides: above the base the encoder
/// knows only that.
inline bool box_within(const std::vector<Voxel>& originals, const Voxel& value, VoxelFormat f,
                       const Params& params) {
  bool equal = true;
  for (const Voxel& v : originals) equal &= v == originals[0];
  if (equal && value == originals[0]) return true;
  double sum = 0;
  for (int c = 0; c < attributes(f); ++c) {
    double far = 0;
    for (const Voxel& v : originals) {
      const double d = std::abs(component(v, f, c) - component(value, f, c));
      if (!(d <= far)) far = d;
    }
    sum += far * far;
  }
  const double spread = params.layout == Layout::thesis && !is_color(f) ? 2 : 1;
  if (equal && f == VoxelFormat::float32) return true;
  if (sum == 0 && !equal) return params.delta > 0;
  return std::sqrt(sum) * spread <= params.delta * params.full_scale;
}

inline std::vector<Level> encode(const std::vector<Voxel>& voxels, const VolumeInfo& info,
                                 const Params& params) {
  const auto plan = plan_levels(info, params);
  const VoxelFormat f = info.format;
  std::vector<Level> levels(plan.size());
  for (size_t k = 0; k < plan.size(); ++k) {
    levels[k].dims = plan[k].dims;
    levels[k].cells.resize(static_cast<size_t>(plan[k].dims.x * plan[k].dims.y * plan[k].dims.z));
  }
  for (int64_t z = 0; z < info.dims.z; ++z)
    for (int64_t y = 0; y < info.dims.y; ++y)
      for (int64_t x = 0; x < info.dims.x; ++x) {
        Cell& cell = levels[0].at({x, y, z});
        cell.count = 1;
        cell.value = voxels[static_cast<size_t>((z * info.dims.y + y) * info.dims.x + x)];
        cell.originals = {cell.value};
        if (info.format == VoxelFormat::float32 && std::isfinite(cell.value.as<float>()))
          cell.sum = static_cast<double>(cell.value.as<float>()), cell.finite = 1;
      }
  for (size_t k = 0; k + 1 < levels.size(); ++k) {
    const int64_t w = plan[k].blockwidth;
    Level &level = levels[k], &above = levels[k + 1];
    for (int64_t bz = 0; bz < above.dims.z; ++bz)
      for (int64_t by = 0; by < above.dims.y; ++by)
        for (int64_t bx = 0; bx < above.dims.x; ++bx) {
          Cell& parent = above.at({bx, by, bz});
          bool all_terminal = true, padding = false;
          uint64_t terminal = 0;
          std::vector<Cell*> children;
          for (int64_t z = bz * w; z < std::min((bz + 1) * w, level.dims.z); ++z)
            for (int64_t y = by * w; y < std::min((by + 1) * w, level.dims.y); ++y)
              for (int64_t x = bx * w; x < std::min((bx + 1) * w, level.dims.x); ++x) {
                Cell& cell = level.at({x, y, z});
                if (cell.count == 0) {
                  padding |= k > 0;
                  continue;
                }
                children.push_back(&cell);
                parent.count += cell.count;
                parent.sum += cell.sum;
                parent.finite += cell.finite;
                parent.originals.insert(parent.originals.end(), cell.originals.begin(), cell.originals.end());
                all_terminal &= cell.terminal;
                terminal += cell.terminal;
              }
          if (parent.count == 0) continue;
          parent.value = average(parent, f, params);
          const Voxel decoded = decoded_value(parent.value, f);
          const double allowed = params.delta * params.full_scale;
          parent.terminal = all_terminal;
          if (params.bound == Bound::global) {
            bool near = true;
            for (const Voxel& v : parent.originals)
              near &= distance_between(v, decoded, f, params) <= allowed;
            parent.terminal &= k == 0 ? near : box_within(parent.originals, decoded, f, params);
            if (parent.terminal && !near) std::abort();  // the promise
          } else {
            for (Cell* child : children)
              parent.terminal &= distance_between(k == 0 ? child->value : decoded_value(child->value, f),
                                                  decoded, f, params) <= allowed;
          }
          if (padding && params.layout == Layout::thesis)
            parent.terminal &= distance_between(Voxel{}, decoded, f, params) <= allowed;
          if (!parent.terminal) ++level.blocks, level.terminal_voxels += terminal;
        }
  }
  levels.back().blocks = 1;
  for (const Cell& cell : levels.back().cells)
    levels.back().terminal_voxels += cell.count > 0 && cell.terminal;
  return levels;
}

/// What voxel v of level `stop` decodes to, base raw.
inline Voxel decode(std::vector<Level>& levels, const VolumeInfo& info, const Params& params, Index3 v,
                    size_t stop) {
  const auto plan = plan_levels(info, params);
  for (size_t k = levels.size() - 1;; --k) {
    const int64_t scale = static_cast<int64_t>(plan[k].mip_factor / plan[stop].mip_factor);
    const Cell& cell = levels[k].at(v / Index3(scale));
    if (k > stop && !cell.terminal) continue;
    Voxel value = k == 0 ? cell.value : decoded_value(cell.value, info.format);
    if (k == 0 && params.layout == Layout::thesis && info.format == VoxelFormat::rgba32)
      value.bytes[3] =
          static_cast<std::byte>(alpha_from_3_bits(alpha_to_3_bits(std::to_integer<int>(value.bytes[3]))));
    return value;
  }
}

}  // namespace voxkit::svmm::reference
