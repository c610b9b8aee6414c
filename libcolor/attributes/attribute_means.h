// The attributes of a cell, from those of the voxels in it.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "libcolor/surface/attributes.h"
#include "libcolor/surface/linear_light.h"

namespace voxkit::color {

/// What voxels have, added up. Emission is added up in linear light, normals as vectors of one length.
struct AttributeSums {
  struct Vote {
    uint32_t id = 0;
    uint64_t voxels = 0;
  };
  uint64_t voxels = 0, opacity = 0;
  std::array<uint64_t, 3> light{};
  std::array<int64_t, 3> normal{};
  std::array<uint64_t, 2> rm{};
  std::array<Vote, 8> votes{};  ///< of octants
  uint32_t vote_count = 0;

  /// Adds those of an octant: up to 8 of them, each a voxel or elected.
  void add(const AttributeSums& octant);
  /// What most voxels in the octants have is the id of all.
  void elect();
};

class AttributeMeans {
 public:
  explicit AttributeMeans(AttributeSet set) : set_(set), tables_(light_tables()) {}
  /// Those of a voxel.
  AttributeSums of(std::span<const std::byte> voxel) const;
  /// Writes those of a cell with at least one voxel: means over its voxels, each rounded once, of opacity at
  /// least 1; of normals their direction; of ids the one that most of the octants' voxels have, each octant
  /// all those of its own, and of equally many the least.
  void put(const AttributeSums& elected, std::span<std::byte> cell) const;

 private:
  AttributeSet set_;
  const LightTables& tables_;
};

/// The attributes of cells of 2^height voxels a side, from those of voxels in Morton order.
class AttributeCells {
 public:
  /// `height`: 1 or more.
  AttributeCells(AttributeSet set, int height)
      : bytes_(set.bytes()), means_(set), sums_(static_cast<size_t>(height) + 1) {}
  /// Of a voxel that comes behind the one before. If it is in another cell, that one's are appended to
  /// `values`.
  void add(uint64_t place, std::span<const std::byte> voxel, std::vector<std::byte>& values);
  /// Appends those of the last cell, if there is one.
  void finish(std::vector<std::byte>& values);

 private:
  void close(size_t height, std::vector<std::byte>& values);

  size_t bytes_;
  AttributeMeans means_;
  std::vector<AttributeSums> sums_;  ///< by height, of the cells that the last voxel is in
  uint64_t place_ = 0;
};

}  // namespace voxkit::color
