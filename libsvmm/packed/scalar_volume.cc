// Scalars of an opened file: their pages decoded, kept, and looked up.
#include <array>
#include <bit>
#include <cstring>
#include <glm/common.hpp>

#include "libpage/page.h"
#include "libsvmm/packed/packed_pages.h"

namespace voxkit::svmm {
namespace {

/// Pages that are decoded side by side.
constexpr size_t most_jobs = 8;

/// The parents of a page whose model has them; what holds their samples is kept in `ancestors`.
template <class T>
Result<page::Parent<T>> parent_of(const Container& container, const PackedPages& pages, int level,
                                  uint64_t number, Ancestors& ancestors) {
  const PageGrid& above = pages.levels[static_cast<size_t>(level + 1)].grid;
  const Index3 child = pages.levels[static_cast<size_t>(level)].grid.index(number);
  VOX_TRY(const auto codes,
          codes_of<T>(container, pages, level + 1, above.number(child / int64_t{2}), ancestors));
  page::Parent<T> parent = placed<T>(child, above);
  parent.samples = {reinterpret_cast<const T*>(codes->data()), codes->size() / sizeof(T)};
  return parent;
}

}  // namespace

template <class T>
Result<std::shared_ptr<const PageCache::Page>> codes_of(const Container& container, const PackedPages& pages,
                                                        int level, uint64_t number, Ancestors& ancestors) {
  auto& [last_number, last] = ancestors[static_cast<size_t>(level)];
  if (last && last_number == number) return last;
  const PageCache::Key key{level, number};
  auto found = pages.cache.find(key);
  if (!found) {
    const auto& l = pages.levels[static_cast<size_t>(level)];
    page::Parent<T> parent;
    if (l.model->has_parents()) {
      VOX_TRY(parent, parent_of<T>(container, pages, level, number, ancestors));
    }
    VOX_TRY(const auto bytes, pages.page(container, level, number));
    const page::Extent extent = l.grid.extent(number);
    const auto count = static_cast<size_t>(extent.voxels());
    auto made = std::make_shared<PageCache::Page>(count * sizeof(T));
    const Status status = page::decode_page(*l.model, bytes, extent,
                                            std::span<T>(reinterpret_cast<T*>(made->data()), count), parent);
    if (!status) return tl::unexpected<Error>(at_page(container, level, number, l.grid, status.error()));
    ++pages.decoded;
    found = std::move(made);
    pages.cache.keep(key, found);
  }
  last_number = number;
  last = found;
  return found;
}

namespace {

template <class T>
Status decode_box(const Container& container, const PackedPages& pages, const ValueMap& map,
                  VoxelFormat format, const Box& box, int level, VoxelSpan out) {
  const auto& l = pages.levels[static_cast<size_t>(level)];
  const PageGrid& grid = l.grid;
  const Index3 first = box.lo / grid.side, last = (box.hi + (grid.side - 1)) / grid.side;
  std::vector<T> buffer(most_jobs * page::max_voxels);
  std::array<page::PageJob<T>, most_jobs> jobs;
  std::array<uint64_t, most_jobs> numbers;
  size_t waiting = 0;
  Ancestors ancestors;
  const auto flush = [&]() -> Status {
    size_t failed = 0;
    const auto batch = std::span<const page::PageJob<T>>(jobs).first(waiting);
    if (const Status status = page::decode_pages(*l.model, batch, &failed); !status)
      return tl::unexpected<Error>(at_page(container, level, numbers[failed], grid, status.error()));
    for (size_t i = 0; i < waiting; ++i)
      place(jobs[i].out.data(), grid.box(numbers[i]), box, map, format, out);
    pages.decoded += waiting;
    waiting = 0;
    return {};
  };
  const auto add = [&](Index3 at) -> Status {
    const uint64_t number = grid.number(at);
    VOX_TRY(const auto bytes, pages.page(container, level, number));
    const page::Extent extent = grid.extent(number);
    numbers[waiting] = number;
    jobs[waiting] = {
        bytes,
        extent,
        std::span(buffer).subspan(waiting * page::max_voxels, static_cast<size_t>(extent.voxels())),
        {}};
    if (l.model->has_parents()) {
      VOX_TRY(jobs[waiting].parent, parent_of<T>(container, pages, level, number, ancestors));
    }
    return ++waiting == most_jobs ? flush() : Status();
  };
  // The up to 8 pages of one parent after each other. What a job's parents lie in must be there until it is
  // done.
  const Index3 first_parent = first / int64_t{2}, last_parent = (last + int64_t{1}) / int64_t{2};
  for (int64_t z = first_parent.z; z < last_parent.z; ++z)
    for (int64_t y = first_parent.y; y < last_parent.y; ++y)
      for (int64_t x = first_parent.x; x < last_parent.x; ++x) {
        for (int i = 0; i < 8; ++i) {
          const Index3 at = Index3(x, y, z) * int64_t{2} + Index3(i & 1, i >> 1 & 1, i >> 2);
          if (glm::all(glm::greaterThanEqual(at, first)) && glm::all(glm::lessThan(at, last)))
            VOX_CHECK(add(at));
        }
        if (waiting > 0 && l.model->has_parents()) VOX_CHECK(flush());
      }
  return waiting > 0 ? flush() : Status();
}

}  // namespace

Voxel voxel_of(uint32_t code, const ValueMap& map, VoxelFormat format) {
  if (map.kind == CodeKind::indexed) return code == 0 ? Voxel{} : (*map.colors)[code - 1];
  switch (code_bytes(format)) {
    case 4:
      return Voxel::of(map.value(code));
    case 2:
      return Voxel::of(static_cast<uint16_t>(code));
    default:
      return Voxel::of(static_cast<uint8_t>(code));
  }
}

Status decode_scalars(const Container& container, const PackedPages& pages, const PackedParams& params,
                      VoxelFormat format, const Box& box, int level, VoxelSpan out) {
  return with_codes(format, [&]<class T>(T) {
    return decode_box<T>(container, pages, params.map, format, box, level, out);
  });
}

Result<Voxel> sample_scalar(const Container& container, const PackedPages& pages, const PackedParams& params,
                            VoxelFormat format, Index3 voxel, int level) {
  const PageGrid& grid = pages.levels[static_cast<size_t>(level)].grid;
  const int log2_side = std::countr_zero(static_cast<uint64_t>(grid.side));
  const Index3 page(voxel.x >> log2_side, voxel.y >> log2_side, voxel.z >> log2_side);
  const uint64_t number = grid.number(page);
  const Index3 lo = page << int64_t{log2_side}, size = glm::min(grid.dims - lo, Index3(grid.side));
  return with_codes(format, [&]<class T>(T) -> Result<Voxel> {
    auto codes = pages.cache.find({level, number});
    if (!codes) {
      Ancestors ancestors;
      VOX_TRY(codes, codes_of<T>(container, pages, level, number, ancestors));
    }
    return voxel_at<T>(*codes, voxel - lo, size, params.map, format);
  });
}

template Result<std::shared_ptr<const PageCache::Page>> codes_of<uint8_t>(const Container&,
                                                                          const PackedPages&, int, uint64_t,
                                                                          Ancestors&);
template Result<std::shared_ptr<const PageCache::Page>> codes_of<uint16_t>(const Container&,
                                                                           const PackedPages&, int, uint64_t,
                                                                           Ancestors&);
template Result<std::shared_ptr<const PageCache::Page>> codes_of<uint32_t>(const Container&,
                                                                           const PackedPages&, int, uint64_t,
                                                                           Ancestors&);

}  // namespace voxkit::svmm
