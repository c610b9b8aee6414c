// The voxels of a small cube of the terrain.
#pragma once

#include <array>
#include <vector>

#include "libcolor/terrain/scene.h"

namespace voxkit::color::terrain {

/// Where the voxels of a grid with n of them along the world's side are sampled: in the middle of x and z, at
/// the lowest y, so that there is ground however few they are.
class Sampling {
 public:
  explicit Sampling(int64_t n) : n_(n) {}
  int64_t n() const { return n_; }
  int32_t x(int64_t i) const { return static_cast<int32_t>(((2 * i + 1) << (side_bits - 1)) / n_); }
  int32_t y(int64_t j) const { return static_cast<int32_t>((j << side_bits) / n_); }
  int32_t edge() const { return std::max(static_cast<int32_t>(side / n_), 1); }
  /// The number of samples of y, from the floor on, that are below `height`, which is not negative.
  int64_t samples_below(int32_t height) const {
    return (int64_t{height} * n_ + (int64_t{1} << side_bits) - 1) >> side_bits;
  }
  int64_t height() const { return samples_below(ceiling); }

 private:
  int64_t n_;
};

/// Memory of a thread, kept from cube to cube of one scene and sampling. Everything is solid or not at each
/// voxel; voxels that are solid and have a neighbour that is not, across a face, are the surface. So it has
/// no holes. Leaves are thin, and laid on top of that.
class Tile {
 public:
  static constexpr int bits = 5;
  static constexpr int32_t width = 1 << bits;

  /// Appends the voxels of the cube at `corner`, whose first place is `first`, in Morton order.
  void run(const Scene& scene, const Sampling& sampling, const std::array<int64_t, 3>& corner, uint64_t first,
           std::vector<SurfaceVoxel>& out);

 private:
  static constexpr size_t across = width + 2;
  static_assert(across == most_across);
  /// Bit j of a column: the voxel at corner y + j - 1 is solid.
  using Columns = std::array<uint64_t, across * across>;
  struct Part {
    const House* house;
    const Tree* tree;
    Columns columns;
  };

  /// The ground of the last columns of cubes: those above each other have the same.
  struct Patch {
    int64_t x = -1, z = -1;
    std::array<GroundPoint, across * across> points;
  };

  void measure();
  const Patch& find_patch();
  void add_ground();
  void add_houses();
  void add_trunks();
  void find_surface();
  void add_leaves();
  void emit(uint64_t first, std::vector<SurfaceVoxel>& out);
  Rgb ground_color(size_t column, int32_t x, int32_t y, int32_t z);
  uint64_t span(int32_t lo, int32_t hi) const;
  Part& add_part();

  const Scene* scene_ = nullptr;
  const Sampling* sampling_ = nullptr;
  std::array<int64_t, 3> corner_{};
  int32_t edge_ = 0;
  std::array<int32_t, across> xs_{}, ys_{}, zs_{};
  Extent extent_{};
  std::array<Patch, 4> patches_{};
  size_t next_patch_ = 0;
  const Patch* ground_ = nullptr;
  Columns solid_{};
  std::vector<Part> parts_;
  size_t part_count_ = 0;
  std::array<uint64_t, width * width * width / 64> surface_{}, leaf_{};
  std::array<Rgb, width * width * width> leaf_colors_{};
};

}  // namespace voxkit::color::terrain
