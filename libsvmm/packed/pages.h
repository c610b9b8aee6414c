// The pages of an opened file: for those that decode it.
#pragma once

#include <fmt/format.h>

#include <atomic>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

#include "libpage/page.h"
#include "libsvmm/packed/packed_layout.h"
#include "libsvmm/packed/page_cache.h"

namespace voxkit::svmm {

struct PackedVolume::Pages {
  struct Level {
    PageGrid grid;
    std::vector<size_t> chunks;  ///< by part: index into the container's table
    /// Parts whose lengths were found to be right.
    std::unique_ptr<std::atomic<bool>[]> checked;
    std::optional<page::Model> model;  ///< none: not yet known
  };
  explicit Pages(MemoryBudget& memory) : cache(memory) {}

  std::vector<Level> levels;
  mutable PageCache cache;  ///< of codes
  mutable std::atomic<uint64_t> decoded{0};

  /// The pages of a part; ErrorCode::input where it is damaged.
  Result<PartView> part(const Container& container, int level, uint64_t number) const {
    const Level& l = levels[static_cast<size_t>(level)];
    VOX_TRY(const auto bytes, container.chunk(l.chunks[number]));
    const PartView view(bytes, l.grid.pages_of(number));
    if (!l.checked[number].load(std::memory_order_acquire)) {
      if (!view.valid())
        return bad_input(container.name(),
                         fmt::format("chunk PAGE {}.{}: lengths of pages that do not add up", level, number));
      l.checked[number].store(true, std::memory_order_release);
    }
    return view;
  }
  Result<std::span<const std::byte>> page(const Container& container, int level, uint64_t number) const {
    const uint64_t a_part = levels[static_cast<size_t>(level)].grid.pages_a_part();
    VOX_TRY(const PartView view, part(container, level, number / a_part));
    return view.page(number % a_part);
  }
};

/// Puts the codes of a page where its voxels go, as far as they are in `box`; `out` is at the box's corner.
template <class T>
void place(const T* codes, const Box& page, const Box& box, const ValueMap& map, VoxelFormat format,
           VoxelSpan out) {
  const Box part = intersect(page, box);
  const Index3 size = page.size();
  for (int64_t z = part.lo.z; z < part.hi.z; ++z)
    for (int64_t y = part.lo.y; y < part.hi.y; ++y) {
      const T* const from =
          codes + ((z - page.lo.z) * size.y + (y - page.lo.y)) * size.x + (part.lo.x - page.lo.x);
      std::byte* const to =
          out.row(y - box.lo.y, z - box.lo.z) + (part.lo.x - box.lo.x) * voxel_bytes(format);
      const auto count = static_cast<size_t>(part.hi.x - part.lo.x);
      if constexpr (sizeof(T) < 4) {
        std::memcpy(to, from, count * sizeof(T));
      } else {
        auto* const floats = reinterpret_cast<float*>(to);
        for (size_t x = 0; x < count; ++x) floats[x] = map.value(from[x]);
      }
    }
}

}  // namespace voxkit::svmm
