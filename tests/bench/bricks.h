// The bricks of a volume in memory.
#pragma once

#include <vector>

#include "formats/copy.h"
#include "libvq/brick.h"

namespace voxkit::bench {

/// All whole bricks of an integer volume, in raster order.
inline Result<std::vector<vq::Brick>> bricks_of(VolumeSource& source, Context& ctx) {
  const VolumeInfo& info = source.info();
  const int voxel = voxel_bytes(info.format);
  std::vector<std::byte> voxels(static_cast<size_t>(raw_bytes(info)));
  const VoxelSpan all = packed(voxels.data(), info.dims, info.format);
  VOX_CHECK(read_slab(source, info.box(), all, ctx));
  std::vector<vq::Brick> bricks;
  for (int64_t z = 0; z + vq::brick_edge <= info.dims.z; z += vq::brick_edge)
    for (int64_t y = 0; y + vq::brick_edge <= info.dims.y; y += vq::brick_edge)
      for (int64_t x = 0; x + vq::brick_edge <= info.dims.x; x += vq::brick_edge) {
        vq::Brick& brick = bricks.emplace_back();
        for (size_t i = 0; i < brick.size(); ++i) {
          const auto at = static_cast<int64_t>(i);
          const std::byte* const row = all.row(y + at / 4 % 4, z + at / 16);
          Voxel value;
          std::copy_n(row + (x + at % 4) * voxel, voxel, value.bytes.begin());
          brick[i] = value.as<uint16_t>();
        }
      }
  return bricks;
}

}  // namespace voxkit::bench
