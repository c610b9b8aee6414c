#include "libsvmm/encode_level.h"

#include <cstring>

namespace voxkit::svmm {

void relocate_links(std::byte* blocks, uint64_t count, Index3 size, VoxelFormat f, Layout layout,
                    uint64_t base) {
  if (base == 0) return;
  const int64_t voxels = size.x * size.y * size.z;
  const uint64_t block_bytes = structural_block_bytes(static_cast<uint64_t>(voxels), f, layout);
  for (uint64_t b = 0; b < count; ++b, blocks += block_bytes) {
    const StructuralBlock block{blocks, size, f, layout};
    for (int64_t s = 0; s < voxels / 8; ++s) {
      Link link = block.link(s);
      if (link.mask == 0) continue;
      link.first += base;
      if (layout == Layout::plain) {
        store_le(blocks + voxels * value_bytes(f) + s * 8, pack_link(link));
      } else {
        for (int i = 0; i < 8; ++i) {
          std::byte* word = blocks + (s * 8 + i) * word_bytes(f);
          store_word(word, f,
                     (load_word(word, f) & ~15u) | static_cast<uint32_t>(link.first >> (4 * i) & 15u));
        }
      }
    }
  }
}

}  // namespace voxkit::svmm
