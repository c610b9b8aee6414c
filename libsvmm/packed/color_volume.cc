// An opened file of colours.
#include "libsvmm/packed/packed_pages.h"

namespace voxkit::svmm {
namespace {

/// The bytes of a page.
struct ColorBytes {
  std::span<const std::byte> mask;
  std::array<std::span<const std::byte>, most_channels> channels;
};

Result<ColorBytes> bytes_of(const Container& container, const PackedPages& pages, int level,
                            uint64_t number) {
  const PackedPages::Level& l = pages.levels[static_cast<size_t>(level)];
  ColorBytes bytes;
  VOX_TRY(bytes.mask, pages.entry(container, level, l.masks, number));
  for (size_t c = 0; c < l.color->models.size(); ++c) {
    VOX_TRY(bytes.channels[c], pages.entry(container, level, l.pages, number, c));
  }
  return bytes;
}

/// Decodes a page that is not all void, and those of coarser levels that this takes, which are kept.
Status decode_page_of(const Container& container, const PackedPages& pages, int level, uint64_t number,
                      Ancestors& ancestors, ColorPage& out);

/// A page, kept or decoded.
Result<const ColorPage*> page_of(const Container& container, const PackedPages& pages, int level,
                                 uint64_t number, Ancestors& ancestors) {
  auto& [last_number, last] = ancestors[static_cast<size_t>(level)];
  if (!last || last_number != number) {
    const PageCache::Key key{level, number};
    auto found = pages.cache.find(key);
    if (!found) {
      auto made = std::make_shared<PageCache::Page>(sizeof(ColorPage));
      VOX_CHECK(decode_page_of(container, pages, level, number, ancestors,
                               *reinterpret_cast<ColorPage*>(made->data())));
      found = std::move(made);
      pages.cache.keep(key, found);
    }
    last_number = number;
    last = std::move(found);
  }
  return reinterpret_cast<const ColorPage*>(last->data());
}

Status decode_page_of(const Container& container, const PackedPages& pages, int level, uint64_t number,
                      Ancestors& ancestors, ColorPage& out) {
  const PackedPages::Level& l = pages.levels[static_cast<size_t>(level)];
  VOX_TRY(const ColorBytes bytes, bytes_of(container, pages, level, number));
  ColorParent parent;
  if (l.color->mask.has_parents()) {
    const PageGrid& above = pages.levels[static_cast<size_t>(level + 1)].grid;
    const Index3 child = l.grid.index(number);
    VOX_TRY(parent.page, page_of(container, pages, level + 1, above.number(child / int64_t{2}), ancestors));
    parent.place(child, above);
  }
  const Status status =
      decode_color_page(*l.color, bytes.mask, std::span(bytes.channels).first(l.color->models.size()),
                        l.grid.extent(number), parent, out);
  if (!status) return tl::unexpected<Error>(at_page(container, level, number, l.grid, status.error()));
  ++pages.decoded;
  return {};
}

}  // namespace

Status decode_colors(const Container& container, const PackedPages& pages, const PackedParams& params,
                     const Box& box, int level, VoxelSpan out) {
  const VoxelFormat format = params.channels.count == 4 ? VoxelFormat::rgba32 : VoxelFormat::rgb24;
  const PackedPages::Level& l = pages.levels[static_cast<size_t>(level)];
  const PageGrid& grid = l.grid;
  const Index3 first = box.lo / grid.side, last = (box.hi + (grid.side - 1)) / grid.side;
  const auto room = std::make_unique<ColorPage>();
  Ancestors ancestors;
  const auto place = [&](Index3 at) -> Status {
    const uint64_t number = grid.number(at);
    const Box page = grid.box(number), part = intersect(page, box);
    const Index3 to = part.lo - box.lo;
    const VoxelSpan voxels{out.row(to.y, to.z) + to.x * voxel_bytes(format), out.row_stride,
                           out.slice_stride};
    VOX_TRY(const auto mask, pages.entry(container, level, l.masks, number));
    if (mask.empty()) {
      fill(voxels, part.size(), format, Voxel{});
      return {};
    }
    VOX_CHECK(decode_page_of(container, pages, level, number, ancestors, *room));
    place_colors(*room, params.channels, page.size(), {part.lo - page.lo, part.hi - page.lo}, voxels);
    return {};
  };
  // The up to 8 pages of one parent after each other.
  const Index3 first_parent = first / int64_t{2}, last_parent = (last + int64_t{1}) / int64_t{2};
  for (int64_t z = first_parent.z; z < last_parent.z; ++z)
    for (int64_t y = first_parent.y; y < last_parent.y; ++y)
      for (int64_t x = first_parent.x; x < last_parent.x; ++x)
        for (int i = 0; i < 8; ++i) {
          const Index3 at = Index3(x, y, z) * int64_t{2} + Index3(i & 1, i >> 1 & 1, i >> 2);
          if (glm::all(glm::greaterThanEqual(at, first)) && glm::all(glm::lessThan(at, last)))
            VOX_CHECK(place(at));
        }
  return {};
}

Result<Voxel> sample_color(const Container& container, const PackedPages& pages, const PackedParams& params,
                           Index3 voxel, int level) {
  const PageGrid& grid = pages.levels[static_cast<size_t>(level)].grid;
  const uint64_t number = grid.number(voxel / grid.side);
  Ancestors ancestors;
  VOX_TRY(const ColorPage* const page, page_of(container, pages, level, number, ancestors));
  const Box box = grid.box(number);
  Voxel out{};
  const Index3 at = voxel - box.lo;
  place_colors(*page, params.channels, box.size(), {at, at + int64_t{1}}, {out.bytes.data(), 4, 4});
  return out;
}

}  // namespace voxkit::svmm
