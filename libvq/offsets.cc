#include "libvq/offsets.h"

#include <algorithm>
#include <bit>

namespace voxkit::vq {
namespace {

std::span<const uint32_t> block_of(const BrickNumbers& numbers, uint64_t block) {
  return std::span(numbers).subspan(block * block_bricks, block_bricks);
}

}  // namespace

BlockPlan plan_block(std::span<const uint32_t> numbers, uint32_t common, const IdOf& id_of) {
  uint64_t lo = ~uint64_t{0}, hi = 0;
  for (const uint32_t number : numbers) {
    if (number == no_number || number == common) continue;
    const uint64_t id = id_of(number);
    lo = std::min(lo, id);
    hi = std::max(hi, id);
  }
  if (lo > hi) return {};
  return {static_cast<uint32_t>(lo), static_cast<int>(std::bit_width(hi - lo + 1))};
}

OffsetsSize measure_offsets(const BrickNumbers& numbers, uint32_t common, const IdOf& id_of) {
  const uint64_t blocks = numbers.size() / block_bricks;
  OffsetsSize size;
  size.bytes = (blocks + divide_up(blocks, uint64_t{1} << block_chunk_log2)) * block_header;
  for (uint64_t block = 0; block < blocks; ++block) {
    const int width = plan_block(block_of(numbers, block), common, id_of).width;
    size.bytes += static_cast<uint64_t>(width) * (block_bricks / 8);
    size.widest = std::max(size.widest, width);
  }
  return size;
}

std::vector<std::byte> pack_offsets(const BrickNumbers& numbers, uint64_t part, uint32_t common,
                                    const IdOf& id_of) {
  const uint64_t first = part << block_chunk_log2;
  const uint64_t blocks = std::min(numbers.size() / block_bricks - first, uint64_t{1} << block_chunk_log2);
  std::vector<std::byte> bytes((blocks + 1) * block_header);
  for (uint64_t i = 0; i <= blocks; ++i) {
    const size_t start = bytes.size();
    store_le(&bytes[i * block_header + 4], static_cast<uint32_t>(start / 8));
    if (i == blocks) break;
    const auto block = block_of(numbers, first + i);
    const BlockPlan plan = plan_block(block, common, id_of);
    store_le(&bytes[i * block_header], plan.base);
    const size_t end = start + static_cast<size_t>(plan.width) * (block_bricks / 8);
    bytes.resize(end + 8);  // entries are stored eight bytes at a time
    for (size_t k = 0; k < block.size(); ++k)
      if (block[k] != no_number && block[k] != common)
        store_bits(&bytes[start], k * static_cast<size_t>(plan.width),
                   static_cast<uint32_t>(id_of(block[k]) - plan.base + 1));
    bytes.resize(end);
  }
  return bytes;
}

}  // namespace voxkit::vq
