// Where the voxels of a part are, and which of those around one have a colour already.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

namespace voxkit::color {

/// Cells of 4 x 4 x 4 that have voxels of a part.
struct PartCell {
  uint64_t code;   ///< Morton code of a voxel in it, without the lowest 6 bits
  uint64_t mask;   ///< which of its voxels, by their Morton codes in it, are the part's
  uint32_t first;  ///< the number of its first colour in the part
};

/// Of voxels in Morton order.
std::vector<PartCell> cells_of(std::span<const uint64_t> places);

/// Finds cells by their codes.
class PartCells {
 public:
  /// In Morton order; they must outlive it.
  explicit PartCells(std::span<const PartCell> cells);
  std::span<const PartCell> cells() const { return cells_; }
  /// Null: there is none.
  const PartCell* find(uint64_t code) const {
    for (uint64_t at = slot_of(code);; at = (at + 1) & (slots_.size() - 1)) {
      if (slots_[at] == 0) return nullptr;
      const PartCell& cell = cells_[slots_[at] - 1];
      if (cell.code == code) return &cell;
    }
  }
  static constexpr uint64_t bytes_a_cell = sizeof(PartCell) + 4 * sizeof(uint32_t);

 private:
  uint64_t slot_of(uint64_t code) const { return code * 0x9e3779b97f4a7c15u >> shift_; }
  std::span<const PartCell> cells_;
  std::vector<uint32_t> slots_;  ///< cells, from 1 on; 0: none
  int shift_;
};

/// A neighbour that was coded before a voxel.
struct KnownNeighbor {
  uint32_t number;  ///< of its colour in the part
  uint8_t axes;     ///< bit a: its place differs along axis a
};

/// What was coded before the voxels of a cell, in it and in the 26 around it.
class KnownAround {
 public:
  KnownAround(const PartCells& cells, const PartCell& cell);

  /// Calls visit(neighbor) for the up to 26 voxels around one, as far as they were coded before it: in the
  /// order of their cells, z slowest, and in each of their Morton codes.
  template <class Visit>
  void for_each(uint32_t bit, const Visit& visit) const {
    for (uint8_t i = 0; i < reach[bit].count; ++i) {
      const Reach::Cell& of = reach[bit].cells[i];
      const uint64_t mask = masks_[of.slot];
      uint64_t left = mask & of.voxels;
      if (of.slot == own) left &= (uint64_t{1} << bit) - 1;
      for (; left != 0; left &= left - 1) {
        const auto other = static_cast<uint32_t>(std::countr_zero(left));
        const uint32_t differs = bit ^ other;
        visit(KnownNeighbor{
            firsts_[of.slot] + static_cast<uint32_t>(std::popcount(mask & ((uint64_t{1} << other) - 1))),
            static_cast<uint8_t>(((differs | differs >> 3) & 7) | of.axes)});
      }
    }
  }

 private:
  static constexpr uint32_t own = 13;
  /// Of a voxel: the cells that voxels around it are in, and which voxels these are.
  struct Reach {
    struct Cell {
      uint8_t slot, axes;
      uint64_t voxels;
    };
    std::array<Cell, 8> cells;
    uint8_t count;
  };
  static const std::array<Reach, 64> reach;
  static std::array<Reach, 64> make_reach();

  std::array<uint64_t, 27> masks_{};
  std::array<uint32_t, 27> firsts_{};
};

}  // namespace voxkit::color
