#include "libcolor/predicted/part_voxels.h"

#include "libcolor/surface/morton.h"

namespace voxkit::color {

std::vector<PartCell> cells_of(std::span<const uint64_t> places) {
  std::vector<PartCell> cells;
  for (size_t i = 0; i < places.size(); ++i) {
    if (cells.empty() || cells.back().code != places[i] >> 6)
      cells.push_back({places[i] >> 6, 0, static_cast<uint32_t>(i)});
    cells.back().mask |= uint64_t{1} << (places[i] & 63);
  }
  return cells;
}

PartCells::PartCells(std::span<const PartCell> cells) : cells_(cells) {
  const auto log2 = static_cast<int>(std::bit_width(2 * cells.size() + 1));  // at most half of them are taken
  slots_.resize(uint64_t{1} << log2);
  shift_ = 64 - log2;
  for (uint32_t i = 0; i < cells.size(); ++i) {
    uint64_t at = slot_of(cells[i].code);
    while (slots_[at] != 0) at = (at + 1) & (slots_.size() - 1);
    slots_[at] = i + 1;
  }
}

KnownAround::KnownAround(const PartCells& cells, const PartCell& cell) {
  masks_[own] = cell.mask;
  firsts_[own] = cell.first;
  // Each axis by itself: one less, the same, one more. What would be less than 0 is behind all cells.
  constexpr uint64_t x_bits = spread_bits(0x1fffff);
  std::array<std::array<uint64_t, 3>, 3> along;
  for (int a = 0; a < 3; ++a) {
    const uint64_t bits = x_bits << a, at = cell.code & bits;
    along[static_cast<size_t>(a)] = {(at - (uint64_t{1} << a)) & bits, at, ((at | ~bits) + 1) & bits};
  }
  for (uint32_t slot = 0; slot < 27; ++slot) {
    const uint64_t code = along[0][slot % 3] | along[1][slot / 3 % 3] | along[2][slot / 9];
    if (code >= cell.code) continue;
    if (const PartCell* const other = cells.find(code)) {
      masks_[slot] = other->mask;
      firsts_[slot] = other->first;
    }
  }
}

std::array<KnownAround::Reach, 64> KnownAround::make_reach() {
  std::array<Reach, 64> all{};
  for (uint32_t bit = 0; bit < 64; ++bit) {
    const auto p = morton_place(bit);
    for (uint32_t slot = 0; slot < 27; ++slot) {
      const std::array<uint32_t, 3> cell{slot % 3, slot / 3 % 3, slot / 9};
      Reach::Cell of{static_cast<uint8_t>(slot), 0, 0};
      for (uint32_t a = 0; a < 3; ++a)
        if (cell[a] != 1) of.axes = static_cast<uint8_t>(of.axes | 1u << a);
      for (uint32_t other = 0; other < 64; ++other) {
        const auto q = morton_place(other);
        // Places from the corner of the cell before on.
        const auto near = [](uint32_t at, uint32_t cell_of, uint32_t in) {
          const uint32_t there = 4 * cell_of + in, here = 4 + at;
          return there + 1 >= here && there <= here + 1;
        };
        if (near(p.x, cell[0], q.x) && near(p.y, cell[1], q.y) && near(p.z, cell[2], q.z) &&
            (slot != own || other != bit))
          of.voxels |= uint64_t{1} << other;
      }
      if (of.voxels != 0) all[bit].cells[all[bit].count++] = of;
    }
  }
  return all;
}

const std::array<KnownAround::Reach, 64> KnownAround::reach = make_reach();

}  // namespace voxkit::color
