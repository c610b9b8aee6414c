// Which bytes of a file a view needs.
#include "libsvmm/packed/needed_ranges.h"

#include <algorithm>

#include "libsvmm/packed/packed_layout.h"
#include "libsvmm/packed/packed_pages.h"

namespace voxkit::svmm {
namespace {

constexpr uint64_t alignment = 64;  // of chunks; header and trailer are as long, and entries of the table

/// Appends ranges of one level as one where nothing but padding is between them.
void append(std::vector<NeededRange> ranges, std::vector<NeededRange>& out) {
  std::sort(ranges.begin(), ranges.end(), [](const auto& a, const auto& b) { return a.begin < b.begin; });
  const size_t first = out.size();
  for (const NeededRange& range : ranges)
    if (out.size() > first && range.begin < out.back().end + alignment)
      out.back().end = std::max(out.back().end, range.end);
    else
      out.push_back(range);
}

/// The parts that hold the pages `lo` to `last`.
std::vector<uint64_t> parts_of(const PageGrid& grid, Index3 lo, Index3 last) {
  std::vector<uint64_t> parts;
  for (int64_t z = lo.z; z <= last.z; ++z)
    for (int64_t y = lo.y; y <= last.y; ++y) {
      const uint64_t end = grid.number({last.x, y, z}) / grid.pages_a_part();
      uint64_t part = grid.number({lo.x, y, z}) / grid.pages_a_part();
      if (!parts.empty()) part = std::max(part, parts.back() + 1);  // numbers ascend with rows
      for (; part <= end; ++part) parts.push_back(part);
    }
  return parts;
}

}  // namespace

std::vector<NeededRange> needed_ranges(const PackedVolume& volume, const Box& box, int level) {
  const auto& table = volume.container().table();
  const uint64_t file_end = volume.container().file_bytes();
  const auto range_of = [](int of, const ChunkEntry& chunk) {
    return NeededRange{of, chunk.offset, chunk.offset + chunk.stored};
  };
  std::vector<NeededRange> ranges = {
      {NeededRange::index, 0, alignment},
      {NeededRange::index, file_end - alignment * (table.size() + 1), file_end}};
  for (const ChunkEntry& chunk : table)
    if (chunk.kind != pages_kind && chunk.kind != mask_kind && chunk.kind != ranges_kind)
      ranges.push_back(range_of(NeededRange::index, chunk));
  std::vector<NeededRange> needed;
  append(std::move(ranges), needed);

  for (int l = volume.params().levels - 1; l >= level; --l) {
    const PackedPages::Level& pages = volume.pages().levels[static_cast<size_t>(l)];
    const int64_t page = static_cast<int64_t>(pages.grid.side) << l;  // voxels of level 0
    ranges.clear();
    for (const uint64_t part : parts_of(pages.grid, box.lo / page, (box.hi - int64_t{1}) / page))
      for (const PartChunks* chunks : {&pages.masks, &pages.pages})
        if (part < chunks->chunks.size()) ranges.push_back(range_of(l, table[chunks->chunks[part]]));
    append(std::move(ranges), needed);
  }
  return needed;
}

}  // namespace voxkit::svmm
