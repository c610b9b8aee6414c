// Encoding of blocks and groups of blocks of one level: `EncodeBlock` and `EncodeLevel` of thesis
// sections 2.2.3, 2.2.4.
#pragma once

#include <vector>

#include "libsvmm/base_block.h"
#include "libsvmm/commonest.h"
#include "libsvmm/layout.h"
#include "libsvmm/moments.h"

namespace voxkit::svmm {

/// An equivalent voxel while its level is being made.
template <VoxelFormat F>
struct Node {
  Moments<F> moments;  ///< of the original voxels it stands for; empty: outside the volume
  Voxel value;         ///< their average, as it will be decoded
  uint64_t block = 0;  ///< of the block below; meaningful if not terminal
  bool terminal = true;
};

/// Whether sets of a format's voxels may have their commonest in place of an average: of a BITMAP its
/// coverage, rounded, is as much.
template <VoxelFormat F>
inline constexpr bool has_commonest = !is_color(F) && F != VoxelFormat::bitmap;

/// The commonest of the values that `visit(add)` adds with add(voxel bytes, times).
template <VoxelFormat F, class Visit>
Voxel commonest(const Visit& visit) {
  thread_local Commonest counts;
  counts.clear();
  visit([&](const std::byte* v, uint64_t times) { counts.add(Moments<F>::key(Moments<F>::load(v)), times); });
  return Voxel::of(Moments<F>::from_key(counts.key()));
}

/// The stored blocks of one level, in order. Block numbers, and links to them, count from the buffer's own
/// start until they are committed to the file.
struct BlockBuffer {
  std::vector<std::byte> bytes;
  uint64_t blocks = 0;
  uint64_t terminal_voxels = 0;
};

/// A dense grid of nodes, x fastest. What lies outside it is outside the volume.
template <VoxelFormat F>
struct NodeGrid {
  Index3 size{0};
  std::vector<Node<F>> nodes;

  /// All nodes outside the volume.
  void reset(Index3 new_size) {
    resize(new_size);
    std::fill(nodes.begin(), nodes.end(), Node<F>{});
  }
  /// For a caller who sets every node.
  void resize(Index3 new_size) {
    size = new_size;
    nodes.resize(static_cast<size_t>(size.x * size.y * size.z));
  }
  Node<F>& at(Index3 v) { return nodes[static_cast<size_t>((v.z * size.y + v.y) * size.x + v.x)]; }
  const Node<F>* find(Index3 v) const {
    if (v.x >= size.x || v.y >= size.y || v.z >= size.z) return nullptr;
    return &nodes[static_cast<size_t>((v.z * size.y + v.y) * size.x + v.x)];
  }
};

/// Appends the values and links of the block of `size` nodes at `lo` of `grid`; returns its terminal voxels.
template <VoxelFormat F>
uint64_t write_structural_block(const NodeGrid<F>& grid, Index3 lo, Index3 size, Layout layout,
                                std::vector<std::byte>& out) {
  const int64_t voxels = size.x * size.y * size.z;
  const size_t start = out.size();
  out.resize(start + structural_block_bytes(static_cast<uint64_t>(voxels), F, layout));
  std::byte* const values = &out[start];
  std::byte* const links = values + voxels * value_bytes(F);
  uint64_t terminal_voxels = 0;
  int64_t s = 0;
  for (int64_t z = 0; z < size.z; z += 2)
    for (int64_t y = 0; y < size.y; y += 2)
      for (int64_t x = 0; x < size.x; x += 2, ++s) {
        Link link;
        Voxel subblock[8];
        for (int i = 0; i < 8; ++i) {
          const Node<F>* node = grid.find(lo + Index3(x + (i & 1), y + (i >> 1 & 1), z + (i >> 2)));
          if (!node || node->moments.empty()) continue;
          subblock[i] = node->value;
          terminal_voxels += node->terminal;
          if (node->terminal) continue;
          if (link.mask == 0) link.first = node->block;
          link.mask = static_cast<uint8_t>(link.mask | 1u << i);
        }
        if (layout == Layout::plain) {
          for (int i = 0; i < 8; ++i)
            std::memcpy(values + (s * 8 + i) * value_bytes(F), subblock[i].bytes.data(),
                        static_cast<size_t>(value_bytes(F)));
          store_le(links + s * 8, pack_link(link));
        } else {
          for (int i = 0; i < 8; ++i)
            store_word(values + (s * 8 + i) * word_bytes(F), F, thesis_word(subblock[i], F, link, i));
        }
      }
  return terminal_voxels;
}

/// Adds `base` to every link of structural blocks, whose children were numbered from 0.
void relocate_links(std::byte* blocks, uint64_t count, Index3 size, VoxelFormat f, Layout layout,
                    uint64_t base);

/// Encodes the block of w^3 nodes at `lo` of level >= 1 and sets its equivalent voxel, `parent`. `level_size`
/// is what the grid can hold of the level, whose sides are rounded up to even: layout thesis takes nodes
/// within it, but outside the volume, for void voxels that must be near enough as well (the published sizes
/// say so); their weight in averages is zero all the same.
template <VoxelFormat F>
void encode_block(const NodeGrid<F>& grid, const Index3& lo, const Index3& level_size, int w,
                  const Criterion& criterion, BlockBuffer& out, Node<F>& parent) {
  parent = {};
  bool all_terminal = true, padding = false;
  const Index3 hi{std::min(lo.x + w, level_size.x), std::min(lo.y + w, level_size.y),
                  std::min(lo.z + w, level_size.z)};
  for (int64_t z = lo.z; z < hi.z; ++z)
    for (int64_t y = lo.y; y < hi.y; ++y)
      for (int64_t x = lo.x; x < hi.x; ++x) {
        const Node<F>& node = *grid.find({x, y, z});
        padding |= node.moments.empty();
        if (node.moments.empty()) continue;
        parent.moments.add(node.moments);
        all_terminal &= node.terminal;
      }
  if (parent.moments.empty()) return;
  parent.value = parent.moments.value(criterion);
  if constexpr (has_commonest<F>)
    if (criterion.labels)
      parent.value = commonest<F>([&](const auto& add) {
        for (int64_t z = lo.z; z < hi.z; ++z)
          for (int64_t y = lo.y; y < hi.y; ++y)
            for (int64_t x = lo.x; x < hi.x; ++x)
              if (const Node<F>& node = *grid.find({x, y, z}); !node.moments.empty())
                add(node.value.bytes.data(), node.moments.count);
      });
  bool homogeneous = all_terminal && (!criterion.global || parent.moments.within(parent.value, criterion));
  if (padding && criterion.layout == Layout::thesis)
    homogeneous &= Moments<F>::near(Voxel{}.bytes.data(), parent.value, criterion);
  if (homogeneous && !criterion.global)
    for (int64_t z = lo.z; z < hi.z && homogeneous; ++z)
      for (int64_t y = lo.y; y < hi.y && homogeneous; ++y)
        for (int64_t x = lo.x; x < hi.x && homogeneous; ++x) {
          const Node<F>& node = *grid.find({x, y, z});
          const Voxel decoded = decoded_value(node.value, F);
          homogeneous =
              node.moments.empty() || Moments<F>::near(decoded.bytes.data(), parent.value, criterion);
        }
  if (homogeneous) return;
  parent.terminal = false;
  parent.block = out.blocks++;
  out.terminal_voxels += write_structural_block(grid, lo, Index3(w), criterion.layout, out.bytes);
}

/// Copies the voxels of a block of extent `size`, of which `valid` lie inside the volume, to block order; the
/// rest is zero.
template <int Bytes>
void gather_block(const ConstVoxelSpan& voxels, const Index3& size, const Index3& valid, std::byte* out) {
  if (valid == size) {  // pairs of voxels along x are neighbours in both orders
    for (int64_t z = 0; z < size.z; z += 2)
      for (int64_t y = 0; y < size.y; y += 2) {
        const std::byte* rows[4] = {voxels.row(y, z), voxels.row(y + 1, z), voxels.row(y, z + 1),
                                    voxels.row(y + 1, z + 1)};
        for (int64_t x = 0; x < size.x * Bytes; x += 2 * Bytes)
          for (int i = 0; i < 4; ++i, out += 2 * Bytes) std::memcpy(out, rows[i] + x, 2 * Bytes);
      }
    return;
  }
  std::memset(out, 0, static_cast<size_t>(size.x * size.y * size.z) * Bytes);
  for (int64_t z = 0; z < valid.z; ++z)
    for (int64_t y = 0; y < valid.y; ++y)
      for (int64_t x = 0; x < valid.x; ++x)
        std::memcpy(out + voxel_index({x, y, z}, size) * Bytes, voxels.row(y, z) + x * Bytes, Bytes);
}

/// Whether `n` voxels (an even number) are the same, byte for byte. Pairs are compared, as `gather_block`
/// wrote them: a wider load would have to wait for both stores.
template <int Bytes>
bool all_equal(const std::byte* voxels, int64_t n) {
  if (std::memcmp(voxels, voxels + Bytes, Bytes) != 0) return false;
  for (int64_t i = 2; i < n; i += 2)
    if (std::memcmp(voxels, voxels + i * Bytes, 2 * Bytes) != 0) return false;
  return true;
}

/// Encodes the block of w^3 voxels of the base level at `voxels`, of which `valid` lie inside the volume (at
/// least one), and sets its equivalent voxel, `parent`. `scratch` holds w^3 voxels.
template <VoxelFormat F>
void encode_base_block(const ConstVoxelSpan& voxels, const Index3& valid, int w, const Params& params,
                       const Criterion& criterion, std::vector<std::byte>& scratch, BlockBuffer& out,
                       Node<F>& parent) {
  constexpr int bytes = voxel_bytes(F);
  const Index3 size(w);
  const int64_t count = valid.x * valid.y * valid.z, all = size.x * size.y * size.z;
  const std::byte* const block = scratch.data();
  gather_block<bytes>(voxels, size, valid, scratch.data());
  // Visits the voxels inside the volume, in block order, while visit returns true.
  const auto every = [&](auto visit) {
    if (count == all) {
      for (int64_t i = 0; i < all; ++i)
        if (!visit(block + i * bytes)) return false;
      return true;
    }
    for (int64_t z = 0; z < valid.z; ++z)
      for (int64_t y = 0; y < valid.y; ++y)
        for (int64_t x = 0; x < valid.x; ++x)
          if (!visit(block + voxel_index({x, y, z}, size) * bytes)) return false;
    return true;
  };

  Moments<F> moments;  // a local, not parent's: it can stay in registers
  if (count == all && all_equal<bytes>(block, all)) {
    Voxel v;
    std::memcpy(v.bytes.data(), block, bytes);
    moments.add_uniform(v, static_cast<uint64_t>(count), criterion);
  } else if (count == all) {
    moments.add(block, all, criterion);
  } else {
    every([&](const std::byte* v) {
      moments.add(v, 1, criterion);
      return true;
    });
  }
  Voxel value = moments.value(criterion);
  if constexpr (has_commonest<F>)
    if (criterion.labels && !moments.uniform())
      value = commonest<F>([&](const auto& add) {
        every([&](const std::byte* v) {
          add(v, 1);
          return true;
        });
      });
  parent.moments = moments;
  parent.value = value;
  bool homogeneous = moments.within(value, criterion);
  if (!homogeneous && is_color(F))  // the box of values is too wide, but perhaps no voxel is in its corner
    homogeneous = every([&](const std::byte* v) { return Moments<F>::near(v, value, criterion); });
  parent.terminal = homogeneous;
  if (homogeneous) return;
  parent.block = out.blocks++;
  out.terminal_voxels += static_cast<uint64_t>(count);
  encode_base_block(block, size, F, params.base, params.layout, out.bytes);
}

}  // namespace voxkit::svmm
