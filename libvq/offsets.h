// The offset volume as it is written: which brick is where, in blocks of 4^3 places with a base of their own
// (Guthe and Goesele 2016, section 3.2; FORMAT.md, section 3.3).
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "libvq/layout.h"

namespace voxkit::vq {

/// Brick numbers of whole blocks, one block after the other, in each x fastest, then y, then z.
using BrickNumbers = std::vector<uint32_t>;
/// At places of a block that lie outside the volume.
inline constexpr uint32_t no_number = 0xffffffff;

/// What entries say for a brick with a number: the number, or an address.
using IdOf = std::function<uint64_t(uint32_t)>;

/// The bits of an entry of a block, where entries of `common` are 0, and its base.
struct BlockPlan {
  uint32_t base = 0;
  int width = 0;
};
BlockPlan plan_block(std::span<const uint32_t> numbers, uint32_t common, const IdOf& id_of);

/// Bytes of all chunks of the offset volume, and the widest entries.
struct OffsetsSize {
  uint64_t bytes = 0;
  int widest = 0;
};
OffsetsSize measure_offsets(const BrickNumbers& numbers, uint32_t common, const IdOf& id_of);
/// One chunk of it.
std::vector<std::byte> pack_offsets(const BrickNumbers& numbers, uint64_t part, uint32_t common,
                                    const IdOf& id_of);

}  // namespace voxkit::vq
