// Fewer voxels within a distance: those of a cube, by themselves.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "formats/volume.h"
#include "libcolor/simplify/ball.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// A cube has 2^cover_bits voxels a side.
inline constexpr int cover_bits = 6;

/// Chooses few voxels of a cube so that each one that is given has one of them within a distance, and the
/// other way around: of all places those that have most voxels around that no other one has yet, as long as
/// there are such voxels (the greedy algorithm for set cover, D. S. Johnson 1974). What a surface is tight by
/// is kept: see is_loose. One object does one cube after the other, and keeps its memory.
class CubeCover {
 public:
  /// Squared distances of at most `squared`, 1 to 64.
  explicit CubeCover(int squared);
  /// Memory of such an object.
  static uint64_t bytes(int squared);

  /// What is left of a cube, in Morton order.
  struct Voxels {
    std::vector<SurfaceVoxel> voxels;
    std::vector<std::byte> attributes;  ///< of each as many bytes as there were
  };
  /// `in`: all voxels of a cube, at least one, in Morton order, with `attribute_bytes` each. Those of `out`
  /// are in the cube and within `dims`, no more than there are in `in`. Its colours are means, in linear
  /// light, of the voxels that are nearest to it; its attributes those of the first of the nearest ones.
  void cover(const VoxelRun& in, size_t attribute_bytes, Index3 dims, Voxels& out);

 private:
  void enter(std::span<const SurfaceVoxel> voxels, Index3 dims);
  bool is_loose(uint32_t cell) const;
  void choose();
  void keep(uint32_t cell);
  size_t rank(uint32_t cell) const;
  void write(const VoxelRun& in, size_t attribute_bytes, Voxels& out);

  /// Places become cells of the cube with a margin around, so that steps lead nowhere else.
  uint32_t cell_of(uint64_t place) const;
  template <class Visit>
  void around(uint32_t cell, const Visit& visit) const {
    for (const int32_t step : steps_) visit(cell + static_cast<uint32_t>(step));
  }

  uint32_t margin_ = 1, side_;    ///< of the cube and its margins
  std::vector<int32_t> steps_;    ///< the ball's, in cells
  std::vector<uint8_t> lengths_;  ///< of these, squared
  std::vector<uint8_t> empty_, cells_;
  std::vector<uint16_t>
      gains_;  ///< how many voxels a cell would cover that are not covered yet; 0 between cubes
  std::vector<uint32_t> numbers_[2];  ///< of the voxels that were and that are left, where there are such
  std::vector<uint32_t> own_, candidates_;
  std::vector<std::vector<uint32_t>> by_rank_;
  struct Kept {
    uint64_t place;
    uint32_t cell;
  };
  std::vector<Kept> kept_;
  struct Light {
    std::array<uint64_t, 3> sum{};
    uint64_t count = 0;
  };
  std::vector<Light> light_;
  uint64_t cube_ = 0;
};

}  // namespace voxkit::color
