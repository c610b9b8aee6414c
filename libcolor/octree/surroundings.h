// What is known around an octant of an octree's node before it is coded: the context of its bit.
#pragma once

#include <array>
#include <cstdint>

#include "libcolor/octree/node_walk.h"

namespace voxkit::color {

/// Facts about the cells around an octant, each yes or no; their numbers are part of FORMAT.md, section 4.9:
/// 0 to 124: a cell up to two octants away is solid, as far as is known; 125 to 151: one next to it is open,
/// in a node that is there but not known; 152 to 154: which octant it is; 155: none before it is solid.
inline constexpr uint32_t open_facts = 125, octant_facts = 152, none_before_fact = 155, fact_count = 156;

/// The facts of one octant, as they are looked up: planes of cells, in rows of 8 bits.
struct Facts {
  /// Planes -2 to 2 of solid cells, -1 to 1 of open ones, and the last facts.
  std::array<uint64_t, 9> words;

  bool operator[](uint32_t fact) const {
    const auto [word, bit] = places[fact];
    return (words[word] >> bit & 1) != 0;
  }

  struct Place {
    uint8_t word, bit;
  };
  static constexpr std::array<Place, fact_count> places = [] {
    std::array<Place, fact_count> of{};
    for (uint32_t f = 0; f < fact_count; ++f) {
      uint32_t word, bit;
      if (f < open_facts) {
        word = f / 25, bit = f % 5 + 8 * (f / 5 % 5);
      } else if (f < octant_facts) {
        const uint32_t open = f - open_facts;
        word = 5 + open / 9, bit = open % 3 + 1 + 8 * (open / 3 % 3 + 1);
      } else {
        word = 8, bit = f - octant_facts;
      }
      of[f] = {static_cast<uint8_t>(word), static_cast<uint8_t>(bit)};
    }
    return of;
  }();
};

/// The 6 x 6 x 6 cells around the octants of a node, from two below it to two above.
class Surroundings {
 public:
  /// Of a node with these neighbours, of which those from `first` on and before the node itself are known.
  Surroundings(const OctreeLevel& level, const Neighbors& neighbors, uint64_t first) {
    const uint32_t node = neighbors[center];
    for (uint32_t i = 0; i < neighbors.size(); ++i) {
      const uint32_t neighbor = neighbors[i];
      if (neighbor == no_node || i == center) continue;
      const uint32_t plane = i / 9 * 2, shift = i % 3 * 2 + i / 3 % 3 * 16;
      const bool known = neighbor < node && neighbor >= first;
      const uint32_t mask = known ? level.mask(neighbor) : 0xff;
      auto& planes = known ? solid_ : open_;
      planes[plane] |= spread(mask & 15) << shift;
      planes[plane + 1] |= spread(mask >> 4) << shift;
    }
  }

  Facts facts_of(uint32_t octant) const {
    const uint32_t plane = octant >> 2, shift = (octant & 1) + 8 * (octant >> 1 & 1);
    Facts facts;
    for (size_t z = 0; z < 5; ++z) facts.words[z] = solid_[plane + z] >> shift;
    for (size_t z = 0; z < 3; ++z) facts.words[5 + z] = open_[plane + 1 + z] >> shift;
    facts.words[8] = octant | (none_ ? 8u : 0u);
    return facts;
  }
  /// The octant is solid; those that are not said to be are void.
  void set_solid(uint32_t octant) {
    solid_[2 + (octant >> 2)] |= uint64_t{1} << (2 + (octant & 1) + 8 * (2 + (octant >> 1 & 1)));
    none_ = false;
  }
  bool none() const { return none_; }

 private:
  /// Four octants as two rows.
  static uint64_t spread(uint32_t mask) { return (mask & 3) | (mask & 12) << 6; }

  std::array<uint64_t, 6> solid_{}, open_{};
  bool none_ = true;
};

/// Goes through the bits of a node's mask that have to be coded: all but the last one, where no other is set.
/// `decide` is given the facts, and the bit if it is known, and says what it is. The mask.
template <class Decide>
uint8_t code_mask(Surroundings& around, uint8_t known, const Decide& decide) {
  uint32_t mask = 0;
  for (uint32_t octant = 0; octant < 8; ++octant) {
    const bool solid =
        octant == 7 && around.none() ? true : decide(around.facts_of(octant), (known >> octant & 1) != 0);
    if (!solid) continue;
    mask |= 1u << octant;
    around.set_solid(octant);
  }
  return static_cast<uint8_t>(mask);
}

}  // namespace voxkit::color
