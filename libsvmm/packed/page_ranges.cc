#include "libsvmm/packed/page_ranges.h"

#include <algorithm>
#include <limits>

#include "formats/little_endian.h"
#include "libsvmm/packed/packed_pages.h"

namespace voxkit::svmm {
namespace {

constexpr size_t head_bytes = 8;
constexpr uint32_t steps = 16;  // of all codes
constexpr uint32_t none_least = 1, none_greatest = 0;

/// The codes that stand for finite numbers.
CodeRange finite_codes(const ValueMap& map) {
  constexpr float most = std::numeric_limits<float>::max();
  switch (map.kind) {
    case CodeKind::ordered:
      return {ValueMap::ordered(-most), ValueMap::ordered(most)};
    case CodeKind::steps:
      return {3, std::numeric_limits<uint32_t>::max()};
    default:
      return {0, std::numeric_limits<uint32_t>::max()};
  }
}

/// From the least code of all.
constexpr uint32_t step_of(const CodeRange& all) {
  return (all.greatest - all.least) / steps + 1;
}

}  // namespace

void CodeRange::add(const CodeRange& other) {
  if (other.empty()) return;
  *this = empty() ? other : CodeRange{std::min(least, other.least), std::max(greatest, other.greatest)};
}

template <class T>
CodeRange finite_range(std::span<const T> codes, const ValueMap& map) {
  const CodeRange finite = finite_codes(map);
  CodeRange range{std::numeric_limits<uint32_t>::max(), 0};
  for (const uint32_t code : codes) {
    if (code < finite.least || code > finite.greatest) continue;
    range.least = std::min(range.least, code);
    range.greatest = std::max(range.greatest, code);
  }
  return range.empty() ? CodeRange{} : range;
}
template CodeRange finite_range(std::span<const uint8_t>, const ValueMap&);
template CodeRange finite_range(std::span<const uint16_t>, const ValueMap&);
template CodeRange finite_range(std::span<const uint32_t>, const ValueMap&);

std::vector<std::byte> pack_ranges(std::span<const CodeRange> coded) {
  CodeRange all;
  for (const CodeRange& range : coded) all.add(range);
  std::vector<std::byte> bytes(head_bytes + coded.size());
  store_le(bytes.data(), all.least);
  store_le(bytes.data() + 4, all.greatest);
  std::byte* at = bytes.data() + head_bytes;
  for (const CodeRange& range : coded) {
    const uint32_t step = step_of(all), first = range.empty() ? none_least : (range.least - all.least) / step,
                   last = range.empty() ? none_greatest : (range.greatest - all.least) / step;
    *at++ = static_cast<std::byte>(first | last << 4);
  }
  return bytes;
}

PageRanges::Range merged(const PageRanges::Range& a, const PageRanges::Range& b) {
  if (a.lo > a.hi) return b;
  if (b.lo > b.hi) return a;
  return {std::min(a.lo, b.lo), std::max(a.hi, b.hi)};
}

namespace {

template <class T>
PageRanges::Range range_of_rows(ConstVoxelSpan voxels, Index3 size) {
  constexpr T most = std::numeric_limits<T>::max(), least = std::numeric_limits<T>::lowest();
  T lo = most, hi = least;
  bool any = false;
  for (int64_t z = 0; z < size.z; ++z)
    for (int64_t y = 0; y < size.y; ++y) {
      const auto* const row = reinterpret_cast<const T*>(voxels.row(y, z));
      for (int64_t x = 0; x < size.x; ++x) {
        const bool finite = row[x] >= least && row[x] <= most;
        any |= finite;
        lo = finite && row[x] < lo ? row[x] : lo;
        hi = finite && row[x] > hi ? row[x] : hi;
      }
    }
  return any ? PageRanges::Range{static_cast<float>(lo), static_cast<float>(hi)} : PageRanges::Range{1, 0};
}

}  // namespace

PageRanges::Range range_of(ConstVoxelSpan voxels, Index3 size, VoxelFormat format) {
  switch (code_bytes(format)) {
    case 4:
      return range_of_rows<float>(voxels, size);
    case 2:
      return range_of_rows<uint16_t>(voxels, size);
    default:
      return range_of_rows<uint8_t>(voxels, size);
  }
}

Result<std::optional<PageRanges>> page_ranges(const PackedVolume& volume) {
  const Container& container = volume.container();
  const VoxelFormat format = volume.info().format;
  const auto& table = container.table();
  const auto chunk = std::ranges::find_if(table, [](const ChunkEntry& entry) {
    return entry.kind == ranges_kind && entry.index == 0 && entry.part == 0;
  });
  if (chunk == table.end() || volume.finest() != 0 || is_color(format)) return std::nullopt;
  VOX_TRY(const auto bytes, container.chunk(static_cast<size_t>(chunk - table.begin())));
  const auto bad = [&] {
    return bad_input(container.name(), "chunk RNGE 0.0: expected a byte for each page that is coded");
  };
  if (bytes.size() < head_bytes) return bad();
  const CodeRange all{load_le<uint32_t>(bytes.data()), load_le<uint32_t>(bytes.data() + 4)};
  const PackedPages::Level& level = volume.pages().levels[0];
  const ValueMap& map = volume.params().map;
  const CodeRange finite = finite_codes(map);
  const auto value = [&](uint32_t code) {
    const Voxel voxel = voxel_of(code, map, format);
    return code_bytes(format) == 4   ? voxel.as<float>()
           : code_bytes(format) == 2 ? static_cast<float>(voxel.as<uint16_t>())
                                     : static_cast<float>(voxel.as<uint8_t>());
  };
  const auto values = [&](uint64_t least, uint64_t greatest) -> PageRanges::Range {
    least = std::max<uint64_t>(least, finite.least);
    greatest = std::min<uint64_t>({greatest, finite.greatest, level.model->max_sample()});
    if (least > greatest) return {1, 0};
    return {value(static_cast<uint32_t>(least)), value(static_cast<uint32_t>(greatest))};
  };
  PageRanges ranges;
  ranges.pages.reserve(level.grid.pages());
  PageRanges::Range whole = values(all.least, all.greatest);
  size_t at = head_bytes;
  for (uint64_t part = 0; part < level.grid.parts(); ++part) {
    VOX_TRY(const PartView view, volume.pages().part(container, 0, level.pages, part));
    for (uint64_t i = 0; i < level.grid.pages_of(part); ++i) {
      VOX_TRY(const auto sample, page::uniform_sample(*level.model, view.page(i)));
      if (sample) {
        ranges.pages.push_back(values(*sample, *sample));
        whole = merged(whole, ranges.pages.back());
        continue;
      }
      if (at == bytes.size()) return bad();
      const auto range = std::to_integer<uint64_t>(bytes[at++]), first = range & 15, last = range >> 4;
      const uint64_t step = all.empty() ? 1 : step_of(all);
      ranges.pages.push_back(
          first > last || all.empty()
              ? PageRanges::Range{1, 0}
              : values(all.least + first * step,
                       std::min<uint64_t>(all.least + (last + 1) * step - 1, all.greatest)));
    }
  }
  if (at != bytes.size()) return bad();
  if (whole.lo <= whole.hi) ranges.all = {static_cast<double>(whole.lo), static_cast<double>(whole.hi)};
  return ranges;
}

}  // namespace voxkit::svmm
