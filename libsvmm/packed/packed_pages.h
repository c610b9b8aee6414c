// The pages of an opened file: where they are, what they are coded with, and those that were used lately.
#pragma once

#include <array>
#include <atomic>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

#include "libsvmm/packed/color_page.h"
#include "libsvmm/packed/packed_layout.h"
#include "libsvmm/packed/page_cache.h"

namespace voxkit::svmm {

/// Chunks of one kind of a level.
struct PartChunks {
  uint32_t kind = 0;
  uint64_t entries = 1;        ///< of a page
  std::vector<size_t> chunks;  ///< by part: index into the container's table
  /// Parts whose lengths were found to be right.
  std::unique_ptr<std::atomic<bool>[]> checked;

  PartChunks() = default;
  PartChunks(uint32_t kind, uint64_t entries, uint64_t parts);
};

struct PackedPages {
  struct Level {
    PageGrid grid;
    PartChunks pages, masks;           ///< masks: of colours
    std::optional<page::Model> model;  ///< of scalars; none: not yet known
    std::optional<ColorModel> color;   ///< of colours
  };
  explicit PackedPages(MemoryBudget& memory) : cache(memory) {}

  std::vector<Level> levels;
  mutable PageCache cache;  ///< of codes, or of ColorPage
  mutable std::atomic<uint64_t> decoded{0};

  /// The lengths and entries of a part; ErrorCode::input where it is damaged.
  Result<PartView> part(const Container& container, int level, const PartChunks& chunks,
                        uint64_t number) const;
  /// An entry of a page.
  Result<std::span<const std::byte>> entry(const Container& container, int level, const PartChunks& chunks,
                                           uint64_t number, uint64_t entry = 0) const;
  /// Of scalars.
  Result<std::span<const std::byte>> page(const Container& container, int level, uint64_t number) const {
    return entry(container, level, levels[static_cast<size_t>(level)].pages, number);
  }
};

/// The voxel that a code of scalars, or of indexed colours, stands for.
Voxel voxel_of(uint32_t code, const ValueMap& map, VoxelFormat format);

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
      if (map.kind == CodeKind::indexed) {
        const auto bytes = static_cast<size_t>(voxel_bytes(format));
        for (size_t x = 0; x < count; ++x)
          std::memcpy(to + x * bytes, voxel_of(from[x], map, format).bytes.data(), bytes);
      } else if constexpr (sizeof(T) < 4) {
        std::memcpy(to, from, count * sizeof(T));
      } else {
        auto* const floats = reinterpret_cast<float*>(to);
        for (size_t x = 0; x < count; ++x) floats[x] = map.value(from[x]);
      }
    }
}

/// Names the page that is damaged.
Error at_page(const Container& container, int level, uint64_t number, const PageGrid& grid,
              const Error& error);

/// The coarser pages that were last used: pages that lie together mostly have the same.
struct Ancestors
    : std::array<std::pair<uint64_t, std::shared_ptr<const PageCache::Page>>, max_packed_levels> {
  /// Of colours, the page that a voxel was asked of last, without what is void.
  std::pair<PageCache::Key, std::shared_ptr<const PageCache::Page>> solid;

  static PageCache::Key solid_key(int level, uint64_t number) {
    return {~level, number};  // beside ColorPage, which parents are kept as
  }
};

/// Calls work(T()) with the type of codes of a format.
template <class Work>
auto with_codes(VoxelFormat format, const Work& work) {
  switch (code_bytes(format)) {
    case 4:
      return work(uint32_t());
    case 2:
      return work(uint16_t());
    default:
      return work(uint8_t());
  }
}

/// The codes of a page of scalars, kept or decoded; those of the coarser ones that this takes are kept in
/// `ancestors`. T: of the file's codes.
template <class T>
Result<std::shared_ptr<const PageCache::Page>> codes_of(const Container& container, const PackedPages& pages,
                                                        int level, uint64_t number, Ancestors& ancestors);
/// A voxel of a page of scalars of so many voxels.
template <class T>
Voxel voxel_at(const PageCache::Page& codes, Index3 at, Index3 size, const ValueMap& map,
               VoxelFormat format) {
  T code;
  std::memcpy(&code, codes.data() + static_cast<size_t>((at.z * size.y + at.y) * size.x + at.x) * sizeof(T),
              sizeof(T));
  return voxel_of(code, map, format);
}

/// Of files of scalars, as those of PackedVolume.
Status decode_scalars(const Container& container, const PackedPages& pages, const PackedParams& params,
                      VoxelFormat format, const Box& box, int level, VoxelSpan out);
Result<Voxel> sample_scalar(const Container& container, const PackedPages& pages, const PackedParams& params,
                            VoxelFormat format, Index3 voxel, int level);

/// Of indexed colours, as visit_masks.
Status visit_solid(const PackedVolume& volume,
                   const std::function<Status(Index3 lo, const page::Mask& mask)>& take, Context& ctx);

/// Of files of colours that have channels.
Status decode_colors(const Container& container, const PackedPages& pages, const PackedParams& params,
                     const Box& box, int level, VoxelSpan out);
Result<Voxel> sample_color(const Container& container, const PackedPages& pages, const PackedParams& params,
                           Index3 voxel, int level, Ancestors& last);
Status visit_masks(const Container& container, const PackedPages& pages,
                   const std::function<Status(Index3 lo, const page::Mask& mask)>& take, Context& ctx);

}  // namespace voxkit::svmm
