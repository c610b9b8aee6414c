// Voxels of an opened file for one thread, which asks for what lies together.
#include <array>
#include <bit>
#include <cstring>
#include <glm/common.hpp>

#include "formats/parallel.h"
#include "libpage/page.h"
#include "libsvmm/packed/packed_pages.h"

namespace voxkit::svmm {

/// What a thread has seen lately: pages that lie together, and what they are predicted from.
struct PackedVolume::Reader::Recent {
  struct Page {
    uint64_t number = ~uint64_t{0};
    Box box;
    std::shared_ptr<const PageCache::Page> codes;  ///< null: all are the model's background
  };
  Ancestors ancestors;
  std::array<Page, reader_pages> pages;
};

PackedVolume::Reader::Reader(const PackedVolume& volume, int level)
    : volume_(volume), level_(level), recent_(std::make_unique<Recent>()) {}
PackedVolume::Reader::~Reader() = default;

/// A page of scalars. Valid until another is asked for.
static Result<const PackedVolume::Reader::Recent::Page*> recent_page(const PackedVolume& volume, int level,
                                                                     PackedVolume::Reader::Recent& recent,
                                                                     Index3 page) {
  const PackedPages::Level& l = volume.pages().levels[static_cast<size_t>(level)];
  const uint64_t number = l.grid.number(page);
  auto& found = recent.pages[static_cast<size_t>((page.z & 3) << 4 | (page.y & 3) << 2 | (page.x & 3))];
  if (found.number == number) return &found;
  found.number = ~uint64_t{0};
  found.codes = nullptr;
  found.box = l.grid.box(number);
  VOX_TRY(const auto bytes, volume.pages().page(volume.container(), level, number));
  if (!bytes.empty()) {
    VOX_TRY(found.codes, with_codes(volume.info().format, [&]<class T>(T) {
              return codes_of<T>(volume.container(), volume.pages(), level, number, recent.ancestors);
            }));
  }
  found.number = number;
  return &found;
}

Result<Voxel> PackedVolume::Reader::at(Index3 voxel) {
  const VoxelFormat format = volume_.info().format;
  if (volume_.params().has_channels())
    return sample_color(volume_.container(), volume_.pages(), volume_.params(), voxel, level_,
                        recent_->ancestors);
  const PackedPages::Level& l = volume_.pages().levels[static_cast<size_t>(level_)];
  const int log2_side = std::countr_zero(static_cast<uint64_t>(l.grid.side));
  VOX_TRY(const Recent::Page* const page,
          recent_page(volume_, level_, *recent_,
                      {voxel.x >> log2_side, voxel.y >> log2_side, voxel.z >> log2_side}));
  const ValueMap& map = volume_.params().map;
  if (!page->codes) return voxel_of(l.model->background(), map, format);
  return with_codes(format, [&]<class T>(T) {
    return voxel_at<T>(*page->codes, voxel - page->box.lo, page->box.size(), map, format);
  });
}

Result<PackedPage> PackedVolume::Reader::page(Index3 voxel) {
  const PackedPages::Level& l = volume_.pages().levels[static_cast<size_t>(level_)];
  const int log2_side = std::countr_zero(static_cast<uint64_t>(l.grid.side));
  const Index3 at(voxel.x >> log2_side, voxel.y >> log2_side, voxel.z >> log2_side);
  PackedPage page;
  page.lo = at * l.grid.side;
  if (volume_.params().has_channels()) {
    const uint64_t number = l.grid.number(at);
    VOX_TRY(const auto mask, volume_.pages().entry(volume_.container(), level_, l.masks, number));
    page.uniform = mask.empty();
    return page;
  }
  VOX_TRY(const Recent::Page* const recent, recent_page(volume_, level_, *recent_, at));
  page.size = recent->box.size();
  if (recent->codes)
    page.codes = recent->codes->data();
  else
    page.value = voxel_of(l.model->background(), volume_.params().map, volume_.info().format);
  page.uniform = !recent->codes;
  return page;
}

Status PackedVolume::Reader::read(const Box& box, VoxelSpan out) {
  const PackedPages::Level& l = volume_.pages().levels[static_cast<size_t>(level_)];
  const VoxelFormat format = volume_.info().format;
  const Index3 first = box.lo / l.grid.side, last = (box.hi + (l.grid.side - 1)) / l.grid.side;
  for (int64_t z = first.z; z < last.z; ++z)
    for (int64_t y = first.y; y < last.y; ++y)
      for (int64_t x = first.x; x < last.x; ++x) {
        VOX_TRY(const Recent::Page* const page, recent_page(volume_, level_, *recent_, {x, y, z}));
        with_codes(format, [&]<class T>(T) {
          if (page->codes) {
            place(reinterpret_cast<const T*>(page->codes->data()), page->box, box, volume_.params().map,
                  format, out);
            return;
          }
          const auto constant = static_cast<T>(l.model->background());
          const Box part = intersect(page->box, box);
          const std::array<T, page::max_side> row = [&] {
            std::array<T, page::max_side> values;
            values.fill(constant);
            return values;
          }();
          for (int64_t k = part.lo.z; k < part.hi.z; ++k)
            for (int64_t j = part.lo.y; j < part.hi.y; ++j)
              place(row.data(), {{part.lo.x, j, k}, {part.hi.x, j + 1, k + 1}}, box, volume_.params().map,
                    format, out);
        });
      }
  return {};
}

Status visit_solid(const PackedVolume& volume,
                   const std::function<Status(Index3 lo, const page::Mask& mask)>& take, Context& ctx) {
  const Index3 dims = volume.info().dims,
               bricks = (dims + int64_t{page::max_side - 1}) / int64_t{page::max_side};
  return parallel_for(ctx, bricks.y * bricks.z, [&](int64_t row) -> Status {
    PackedVolume::Reader reader(volume, 0);
    std::array<std::byte, page::max_voxels * sizeof(uint32_t)> bytes;
    const auto each = static_cast<size_t>(voxel_bytes(volume.info().format));
    for (int64_t i = 0; i < bricks.x; ++i) {
      const Index3 lo = Index3(i, row % bricks.y, row / bricks.y) * int64_t{page::max_side};
      const Box box{lo, glm::min(lo + int64_t{page::max_side}, dims)};
      const auto one = volume.uniform(box, 0);
      if (one && *one == Voxel{}) continue;
      const VoxelSpan out = packed(bytes.data(), box.size(), volume.info().format);
      VOX_CHECK(reader.read(box, out));
      page::Mask mask;
      for (int z = 0; z < box.size().z; ++z)
        for (int y = 0; y < box.size().y; ++y)
          for (int x = 0; x < box.size().x; ++x) {
            uint32_t bits = 0;
            std::memcpy(&bits, out.row(y, z) + static_cast<size_t>(x) * each, each);
            if (bits != 0) mask.set(x, y, z);
          }
      if (!mask.empty()) VOX_CHECK(take(lo, mask));
    }
    return {};
  });
}

}  // namespace voxkit::svmm
