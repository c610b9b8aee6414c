// Walking from voxel to voxel of a compressed volume, on the host or a device (thesis sections 3.1
// and 3.2.2).
#pragma once

#include <bit>

#include "libsvmm/base_voxel.h"
#include "libsvmm/store.h"

namespace voxkit::svmm {

/// Finds the voxels of a volume one after the other, and remembers the blocks between the root and where it
/// is: the next search begins at the smallest of them that holds the voxel; or, without a path, at the root,
/// and then nothing is kept by level. `Pools` tells where blocks are: `const std::byte* block(int level,
/// uint64_t number)`, null if there is no such block.
template <class Pools, bool with_path = true>
class Walk {
 public:
  VOX_HD_HOT Walk(const View& view, const Pools& pools) : view_(&view), pools_(&pools), level_(view.root) {
    blocks_[root_slot()] = pools.block(level_, 0);
  }

  struct Found {
    Voxel value;    ///< as decoded
    int log2_edge;  ///< of an aligned cell, in base voxels, that has this value throughout the volume
  };
  /// The terminal voxel that covers base voxel `v` (inside the volume), or the first one on the way whose
  /// edge is at most 2^finest (-1: all detail). Eight terminal voxels of a subblock that have one value are
  /// one cell. Void, as large as the volume, if a block is missing.
  VOX_HD_HOT Found locate(uint32_t x, uint32_t y, uint32_t z, int finest) {
    if constexpr (with_path)
      climb(x, y, z, finest);
    else
      level_ = view_->root;
    const std::byte* block = blocks_[with_path ? level_ : root_slot()];
    for (;;) {
      const LevelView& level = view_->levels[level_];
      if (block == nullptr) return {{}, view_->log2_side};
      bytes_ += level.lookup_bytes;
      const int64_t vx = x >> level.shift & level.within, vy = y >> level.shift & level.within,
                    vz = z >> level.shift & level.within;
      const int64_t subblock = (vz >> 1) * level.slice + (vy >> 1) * level.row + (vx >> 1);
      const int i = static_cast<int>((vz & 1) * 4 + (vy & 1) * 2 + (vx & 1));
      if (level_ == 0) return base_voxel(block, vx, vy, vz, subblock, i);
      const StructuralBlock here{block, level.size, view_->format, view_->layout};
      const Link link = here.link(subblock);
      const Voxel value = here.value(subblock * 8 + i);
      if (!(link.mask >> i & 1u)) {
        const bool whole = link.mask == 0 && same_in_subblock(here, subblock, value);
        return {decoded_value(value, view_->format), level.shift + (whole && level.shift < 31 ? 1 : 0)};
      }
      if (level.shift <= finest) return {decoded_value(value, view_->format), level.shift};
      --level_;
      parent_ = value;
      block = pools_->block(level_, link.child(i));
      if constexpr (with_path) blocks_[level_] = block;
      ++entered_;
    }
  }
  /// Blocks entered, and bytes of links and values looked at, so far.
  VOX_HD_HOT uint32_t blocks_entered() const { return entered_; }
  VOX_HD_HOT uint32_t bytes_read() const { return bytes_; }

 private:
  VOX_HD_HOT int root_slot() const { return with_path ? view_->root : 0; }
  /// Up to the first block that holds the voxel and whose own equivalent voxel is not fine enough already.
  VOX_HD_HOT void climb(uint32_t x, uint32_t y, uint32_t z, int finest) {
    const uint32_t apart = (x ^ at_[0]) | (y ^ at_[1]) | (z ^ at_[2]);
    at_[0] = x, at_[1] = y, at_[2] = z;
    int bits = std::bit_width(apart);
    bits = finest + 1 > bits ? finest + 1 : bits;  // the block's edge is more than 2^finest
    const int level = view_->level_of_bits[bits];
    level_ = level > level_ ? level : level_;
  }
  VOX_HD_HOT Found base_voxel(const std::byte* block, int64_t x, int64_t y, int64_t z, int64_t subblock,
                              int i) const {
    const LevelView& level = view_->levels[0];
    if (view_->base == Base::raw && view_->layout == Layout::plain && view_->format == VoxelFormat::rgba32) {
      const std::byte* p = block + subblock * 32;
      const Voxel value = Voxel::of(load_aligned_le<uint32_t>(p + 4 * i));
      return {value, level.within != 1 && same_words(p, value) ? 1 : 0};
    }
    const Voxel value =
        decode_base_voxel(block, level.size, {x, y, z}, view_->format, view_->base, view_->layout, parent_);
    const bool bits = view_->format == VoxelFormat::bitmap || view_->base == Base::bitmap;
    if (!bits) return {value, 0};
    const int shared =
        level.within == 1 || view_->format == VoxelFormat::bitmap ? 0 : shared_bytes(view_->format);
    const auto occupied = static_cast<unsigned>(block[subblock * (shared + 1) + shared]);
    return {value, occupied == 0 || occupied == 255 ? 1 : 0};
  }
  /// Eight 32-bit values.
  VOX_HD_HOT static bool same_words(const std::byte* p, const Voxel& value) {
    const uint64_t pair = value.as<uint32_t>() * uint64_t{0x100000001};
    return ((load_aligned_le<uint64_t>(p) ^ pair) | (load_aligned_le<uint64_t>(p + 8) ^ pair) |
            (load_aligned_le<uint64_t>(p + 16) ^ pair) | (load_aligned_le<uint64_t>(p + 24) ^ pair)) == 0;
  }
  VOX_HD_HOT bool same_in_subblock(const StructuralBlock& block, int64_t subblock, const Voxel& value) const {
    if (view_->layout == Layout::plain && view_->value_bytes == 4)
      return same_words(block.bytes + subblock * 32, value);
    if (view_->layout == Layout::plain && view_->value_bytes == 1)
      return load_aligned_le<uint64_t>(block.bytes + subblock * 8) ==
             value.as<uint32_t>() * uint64_t{0x0101010101010101};
    for (int i = 0; i < 8; ++i)
      if (block.value(subblock * 8 + i).template as<uint32_t>() != value.as<uint32_t>()) return false;
    return true;
  }

  const View* view_;
  const Pools* pools_;
  int level_;  ///< of the innermost block of the path
  uint32_t entered_ = 0, bytes_ = 0, at_[3] = {};
  Voxel parent_;  ///< undecoded value of the equivalent voxel of the base block
  const std::byte* blocks_[with_path ? max_levels : 1];  ///< of the path by level, or the root
};

/// The blocks of a mapped file. A chunk is verified when it is first asked for; `Store::status` tells what
/// was wrong.
class MappedPools {
 public:
  explicit MappedPools(const Volume& volume) : volume_(&volume), store_(&volume.store()) {}
  [[gnu::always_inline]] const std::byte* block(int level, uint64_t number) const {
    const Store::LevelStore& here = store_->levels[static_cast<size_t>(level)];
    if (number >= here.blocks) return store_->block_or_null(*volume_, level, number);
    const uint64_t chunk = number >> here.chunk_log2;
    const std::byte* bytes = here.found[chunk].load(std::memory_order_acquire);
    if (bytes == nullptr) return store_->block_or_null(*volume_, level, number);
    return bytes + (number - (chunk << here.chunk_log2)) * here.block_bytes;
  }

 private:
  const Volume* volume_;
  const Store* store_;
};

/// The blocks of each level in one piece, as they are uploaded to a device.
struct FlatPools {
  struct Pool {
    const std::byte* bytes;
    uint64_t blocks, block_bytes;
  } levels[max_levels];
  VOX_HD_HOT const std::byte* block(int level, uint64_t number) const {
    const Pool& pool = levels[level];
    return number < pool.blocks ? pool.bytes + number * pool.block_bytes : nullptr;
  }
};

}  // namespace voxkit::svmm
