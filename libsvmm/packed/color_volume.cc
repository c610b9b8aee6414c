// An opened file of colours.
#include <bit>
#include <cstring>

#include "formats/parallel.h"
#include "formats/reservation.h"
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

namespace {

/// The solid voxels of a page, one after another: most pages of surfaces are small without the void.
struct SolidPage {
  page::Mask mask;
  std::array<uint16_t, page::max_side * page::max_side> before;  ///< solid voxels in earlier rows

  /// Behind it: the colours.
  const std::byte* colors() const { return reinterpret_cast<const std::byte*>(this + 1); }
};

std::shared_ptr<const PageCache::Page> solid_page(const ColorPage& page, Channels channels, Index3 size) {
  const auto solid = static_cast<size_t>(page.mask.count());
  auto made = std::make_shared<PageCache::Page>(sizeof(SolidPage) + solid * channels.count);
  auto& out = *reinterpret_cast<SolidPage*>(made->data());
  out.mask = page.mask;
  std::byte* to = made->data() + sizeof(SolidPage);
  std::array<std::byte, page::max_side * most_channels> row;
  size_t count = 0;
  for (int64_t z = 0; z < size.z; ++z)
    for (int64_t y = 0; y < size.y; ++y) {
      out.before[static_cast<size_t>(z * page::max_side + y)] = static_cast<uint16_t>(count);
      place_colors(page, channels, size, {{0, y, z}, {size.x, y + 1, z + 1}}, {row.data(), 0, 0});
      for (uint32_t left = page.mask.row(static_cast<int>(y), static_cast<int>(z)); left != 0;
           left &= left - 1) {
        const auto x = static_cast<size_t>(std::countr_zero(left));
        std::memcpy(to + count++ * channels.count, &row[x * channels.count], channels.count);
      }
    }
  return made;
}

}  // namespace

Result<Voxel> sample_color(const Container& container, const PackedPages& pages, const PackedParams& params,
                           Index3 voxel, int level, Ancestors& last) {
  const PageGrid& grid = pages.levels[static_cast<size_t>(level)].grid;
  // Without a division: voxels are asked for one by one.
  const int log2_side = std::countr_zero(static_cast<uint64_t>(grid.side));
  const uint64_t number = grid.number({voxel.x >> log2_side, voxel.y >> log2_side, voxel.z >> log2_side});
  const PageCache::Key key = Ancestors::solid_key(level, number);
  auto& [last_key, kept] = last.solid;
  if (!kept || last_key != key) {
    auto found = pages.cache.find(key);
    if (!found) {
      const auto room = std::make_unique<ColorPage>();
      VOX_CHECK(decode_page_of(container, pages, level, number, last, *room));
      found = solid_page(*room, params.channels, grid.box(number).size());
      pages.cache.keep(key, found);
    }
    last_key = key;
    kept = std::move(found);
  }
  const auto& page = *reinterpret_cast<const SolidPage*>(kept->data());
  const int64_t within = grid.side - 1;
  const Index3 at(voxel.x & within, voxel.y & within, voxel.z & within);
  const uint32_t row = page.mask.row(static_cast<int>(at.y), static_cast<int>(at.z));
  Voxel out{};
  if ((row >> at.x & 1) == 0) return out;
  const size_t place = page.before[static_cast<size_t>(at.z * page::max_side + at.y)] +
                       static_cast<size_t>(std::popcount(row & ((1u << at.x) - 1)));
  std::memcpy(out.bytes.data(), page.colors() + place * params.channels.count, params.channels.count);
  return out;
}

namespace {

/// The mask of a page; `above`: those of the next coarser level, where it has parents.
Result<page::Mask> mask_of(const Container& container, const PackedPages& pages, int level, uint64_t number,
                           const std::vector<page::Mask>& above) {
  const PackedPages::Level& l = pages.levels[static_cast<size_t>(level)];
  VOX_TRY(const auto bytes, pages.entry(container, level, l.masks, number));
  page::MaskParent parent;
  if (l.color->mask.has_parents()) {
    const PageGrid& grid = pages.levels[static_cast<size_t>(level + 1)].grid;
    const Index3 child = l.grid.index(number);
    ColorParent place;
    place.place(child, grid);
    parent = place.mask();
    parent.mask = &above[grid.number(child / int64_t{2})];
  }
  auto mask = l.color->mask.decode(bytes, l.grid.extent(number), parent);
  if (!mask) return tl::unexpected<Error>(at_page(container, level, number, l.grid, mask.error()));
  return mask;
}

}  // namespace

Status visit_masks(const Container& container, const PackedPages& pages,
                   const std::function<Status(Index3 lo, const page::Mask& mask)>& take, Context& ctx) {
  int level = 0;
  while (pages.levels[static_cast<size_t>(level)].color->mask.has_parents()) ++level;
  std::vector<page::Mask> above;
  for (; level > 0; --level) {
    const uint64_t count = pages.levels[static_cast<size_t>(level)].grid.pages();
    VOX_TRY(const Reservation memory, Reservation::take(count * sizeof(page::Mask), "masks of a level", ctx));
    std::vector<page::Mask> masks(count);
    VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(count), [&](int64_t i) -> Status {
      const auto number = static_cast<uint64_t>(i);
      VOX_TRY(masks[number], mask_of(container, pages, level, number, above));
      return {};
    }));
    above = std::move(masks);
  }
  // One page, or the eight of half that side.
  const PageGrid& grid = pages.levels[0].grid;
  const int64_t side = page::max_side / grid.side;
  const Index3 bricks = (grid.count + (side - 1)) / side;
  return parallel_for(ctx, bricks.x * bricks.y * bricks.z, [&](int64_t i) -> Status {
    const Index3 brick(i % bricks.x, i / bricks.x % bricks.y, i / (bricks.x * bricks.y));
    page::Mask whole;
    for (int64_t n = 0; n < side * side * side; ++n) {
      const Index3 in_brick = n == 0 ? Index3(0) : Index3(n & 1, n >> 1 & 1, n >> 2);
      const Index3 at = brick * side + in_brick;
      if (glm::any(glm::greaterThanEqual(at, grid.count))) continue;
      VOX_TRY(const page::Mask mask, mask_of(container, pages, 0, grid.number(at), above));
      const Index3 corner = in_brick * grid.side;
      for (int64_t z = 0; z < grid.side; ++z)
        for (int64_t y = 0; y < grid.side; ++y) {
          uint16_t& row = whole.row(static_cast<int>(y + corner.y), static_cast<int>(z + corner.z));
          row = static_cast<uint16_t>(row | mask.row(static_cast<int>(y), static_cast<int>(z)) << corner.x);
        }
    }
    return whole.empty() ? Status() : take(brick * int64_t{page::max_side}, whole);
  });
}

}  // namespace voxkit::svmm
