// What casting or direct volume rendering leaves: a picture before shading, and what it cost.
#pragma once

#include <cstdint>
#include <vector>

#include "librender/pixel.h"

namespace voxkit::render {

/// The pixels of a picture before shading, row by row from the top, and what they cost.
struct Frame {
  int width = 0, height = 0;
  std::vector<Pixel> pixels;
  std::vector<PixelDetail> details;  ///< as many, or none
  uint64_t rays = 0, rays_hit = 0;
  uint64_t cells_visited = 0;   ///< of one value each, whatever their size
  uint64_t blocks_touched = 0;  ///< times that a block was entered
  uint64_t bytes_touched = 0;   ///< of links and values looked at
  double seconds = 0;           ///< of casting alone
  double lookup_seconds = 0;    ///< of that, for colours that were looked up afterwards
};

}  // namespace voxkit::render
