// An octree as bytes: FORMAT.md, section 4.9.
#pragma once

#include <vector>

#include "formats/context.h"
#include "libcolor/octree/octree.h"

namespace voxkit::color {

/// A part of the masks ends with the page with which it has that many bytes or more.
inline constexpr uint64_t mask_part_bytes = 1 << 16;

struct EncodedOctree {
  std::vector<std::byte> directory;
  std::vector<std::vector<std::byte>> parts;  ///< of masks
  uint64_t nodes = 0, bytes = 0;
};

/// Codes an octree that is ready. Does not depend on ctx.threads. Memory: 24 bytes a sampled octant, of 2^21
/// at most. Errors: ErrorCode::limit, ErrorCode::interrupted.
Result<EncodedOctree> encode_octree(const Octree& octree, Context& ctx);

}  // namespace voxkit::color
