// Meshes to voxelise, and what comes of it.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <vector>

#include "libcolor/surface/voxelise.h"

namespace voxkit::color {

class MeshTest : public testing::Test {
 protected:
  MeshTest() { ctx_.memory = &memory_; }

  static MeshMaterial plain(float r, float g, float b, float a = 1) {
    MeshMaterial material;
    material.color = {r, g, b, a};
    return material;
  }
  static void add_triangle(Mesh& mesh, const std::array<glm::dvec3, 3>& corners, uint32_t material = 0,
                           const std::array<glm::vec2, 3>& uvs = {}) {
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (size_t i = 0; i < 3; ++i) {
      mesh.positions.push_back(corners[i]);
      mesh.uvs.push_back(uvs[i]);
    }
    mesh.triangles.push_back({{first, first + 1, first + 2}, material});
  }
  /// A square at z = 0 from (0, 0) to (side, side) with the whole of a picture on it: v goes down as y goes
  /// up.
  static void add_square(Mesh& mesh, double side, uint32_t material = 0, double z = 0, float uv = 1) {
    add_triangle(mesh, {{{0, 0, z}, {side, 0, z}, {0, side, z}}}, material, {{{0, uv}, {uv, uv}, {0, 0}}});
    add_triangle(mesh, {{{side, side, z}, {0, side, z}, {side, 0, z}}}, material,
                 {{{uv, 0}, {0, 0}, {uv, uv}}});
  }
  template <class TexelAt>
  Picture picture(int64_t width, int64_t height, TexelAt texel_at) {
    auto made = plain_picture(width, height, 0xff000000, ctx_);
    EXPECT_TRUE(made);
    for (int64_t y = 0; y < height; ++y)
      for (int64_t x = 0; x < width; ++x) {
        const std::array<uint8_t, 4> texel = texel_at(x, y);
        std::memcpy(made->data() + 4 * (y * width + x), texel.data(), 4);
        made->has_alpha |= texel[3] != 255;
      }
    return std::move(*made);
  }

  /// Without attributes where nothing is said.
  std::vector<SurfaceVoxel> voxelise(Mesh mesh, VoxeliseOptions options) {
    if (!options.attributes) options.attributes.emplace();
    auto surface = make_surface(std::move(mesh), options, ctx_);
    EXPECT_TRUE(surface) << surface.error().what;
    if (!surface) return {};
    info_ = (*surface)->info();
    std::vector<SurfaceVoxel> voxels;
    const Status status = (*surface)->read(ctx_, [&](std::span<const SurfaceVoxel> run) -> Status {
      for (const SurfaceVoxel& voxel : run) {
        EXPECT_TRUE(voxels.empty() || voxel.place > voxels.back().place);
        voxels.push_back(voxel);
      }
      return {};
    });
    EXPECT_TRUE(status) << status.error().what;
    return voxels;
  }
  static std::map<uint64_t, Rgb> by_place(const std::vector<SurfaceVoxel>& voxels) {
    std::map<uint64_t, Rgb> map;
    for (const SurfaceVoxel& voxel : voxels) map[voxel.place] = voxel.color;
    return map;
  }

  MemoryBudget memory_;
  Context ctx_;
  VolumeInfo info_;  ///< of the last surface
  std::mt19937 random_{11};
};

inline bool operator==(const SurfaceVoxel& a, const SurfaceVoxel& b) {
  return a.place == b.place && a.color == b.color;
}

}  // namespace voxkit::color
