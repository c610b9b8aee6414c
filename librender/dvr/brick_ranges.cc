#include "librender/dvr/brick_ranges.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <limits>
#include <mutex>
#include <vector>

#include "formats/parallel.h"
#include "libvq/store.h"

namespace voxkit::render {
namespace {

using Range = BrickRanges::Range;
constexpr float infinite = std::numeric_limits<float>::infinity();
constexpr Range nothing{infinite, -infinite};

Range merged(const Range& a, const Range& b) {
  return {std::min(a.lo, b.lo), std::max(a.hi, b.hi)};
}

/// The ranges of a row of bricks, from rows of voxels in turn.
template <class T>
class RowRanges {
 public:
  explicit RowRanges(int64_t width) : lo_(static_cast<size_t>(width)), hi_(lo_.size()) {}
  void clear() {
    std::fill(lo_.begin(), lo_.end(),
              std::numeric_limits<T>::has_infinity ? std::numeric_limits<T>::infinity()
                                                   : std::numeric_limits<T>::max());
    std::fill(hi_.begin(), hi_.end(),
              std::numeric_limits<T>::has_infinity ? -std::numeric_limits<T>::infinity()
                                                   : std::numeric_limits<T>::lowest());
  }
  void add(const std::byte* row) {
    const T* const values = reinterpret_cast<const T*>(row);  // aligned: rows of one type, from its start
    constexpr T least = std::numeric_limits<T>::lowest(), most = std::numeric_limits<T>::max();
    for (size_t x = 0; x < lo_.size(); ++x) {
      lo_[x] = values[x] < lo_[x] && values[x] >= least ? values[x] : lo_[x];
      hi_[x] = values[x] > hi_[x] && values[x] <= most ? values[x] : hi_[x];
    }
  }
  Range of(int64_t brick) const {
    Range range = nothing;
    const size_t begin = static_cast<size_t>(brick) * dvr_brick,
                 end = std::min(begin + dvr_brick + 1, lo_.size());
    for (size_t x = begin; x < end; ++x)
      range = merged(range, {static_cast<float>(lo_[x]), static_cast<float>(hi_[x])});
    return range;
  }

 private:
  std::vector<T> lo_, hi_;
};

/// The ranges of a slice of bricks. `voxels`: from its first slice of voxels on, `depth` of them.
template <class T>
void measure_slice(const VolumeInfo& info, const ConstVoxelSpan& voxels, int64_t depth, Index3 bricks,
                   Range* out) {
  RowRanges<T> row(info.dims.x);
  for (int64_t y = 0; y < bricks.y; ++y) {
    row.clear();
    const int64_t end = std::min((y + 1) * dvr_brick + 1, info.dims.y);
    for (int64_t k = 0; k < depth; ++k)
      for (int64_t j = y * dvr_brick; j < end; ++j) row.add(voxels.row(j, k));
    for (int64_t x = 0; x < bricks.x; ++x) out[y * bricks.x + x] = row.of(x);
  }
}

}  // namespace

Result<BrickRanges> BrickRanges::create(const VolumeInfo& info, Context& ctx) {
  BrickRanges ranges;
  ranges.bricks_ = (info.dims + Index3(dvr_brick - 1)) / Index3(dvr_brick);
  const Index3 around = ranges.bricks_ + Index3(2);
  const auto count = checked_voxels(around);
  if (!count || *count > uint64_t{1} << 30)
    return fail(ErrorCode::limit, {}, "the volume is too large for direct volume rendering");
  VOX_TRY(ranges.memory_, Buffer::allocate(*count * sizeof(Range), "the ranges of the volume's bricks", ctx));
  ranges.ranges_ = reinterpret_cast<Range*>(ranges.memory_->data());
  return ranges;
}

/// `read(z0, z1, buffer)` has the slices z0 .. z1 - 1 of the volume, of `layers` bricks and one more; what it
/// had to make is in the buffer.
template <class Read>
Status BrickRanges::measure(const VolumeInfo& info, int64_t layers, const Read& read, Context& ctx) {
  std::mutex mutex;
  int64_t done = 0;
  return parallel_for(ctx, (bricks_.z + layers - 1) / layers, [&](int64_t i) -> Status {
    const int64_t first = i * layers, end = std::min(first + layers, bricks_.z), z0 = first * dvr_brick;
    std::unique_ptr<Buffer> buffer;
    VOX_TRY(const ConstVoxelSpan voxels, read(z0, std::min(end * dvr_brick + 1, info.dims.z), buffer));
    for (int64_t z = first; z < end; ++z) {
      const int64_t from = z * dvr_brick, depth = std::min(from + dvr_brick + 1, info.dims.z) - from;
      const ConstVoxelSpan slices{voxels.row(0, from - z0), voxels.row_stride, voxels.slice_stride};
      Range* const out = ranges_ + z * bricks_.y * bricks_.x;
      switch (voxel_bytes(info.format)) {
        case 1:
          measure_slice<uint8_t>(info, slices, depth, bricks_, out);
          break;
        case 2:
          measure_slice<uint16_t>(info, slices, depth, bricks_, out);
          break;
        default:
          measure_slice<float>(info, slices, depth, bricks_, out);
      }
    }
    const std::lock_guard lock(mutex);
    ctx.progress(static_cast<double>(done += end - first) / static_cast<double>(bricks_.z));
    return {};
  });
}

namespace {

/// Slabs for `measure`, decoded with decode(box, out).
template <class Decode>
auto decoded_slabs(const VolumeInfo& info, const Decode& decode, Context& ctx) {
  return [&info, decode, &ctx](int64_t z0, int64_t z1,
                               std::unique_ptr<Buffer>& buffer) -> Result<ConstVoxelSpan> {
    const Box box{{0, 0, z0}, {info.dims.x, info.dims.y, z1}};
    VOX_TRY(buffer, Buffer::allocate(static_cast<uint64_t>(box.voxels() * voxel_bytes(info.format)),
                                     "a slab of the volume", ctx));
    const VoxelSpan out = packed(buffer->data(), box.size(), info.format);
    VOX_CHECK(decode(box, out));
    return ConstVoxelSpan{out.data, out.row_stride, out.slice_stride};
  };
}

}  // namespace

Result<BrickRanges> BrickRanges::of(const DenseGrid& grid, Context& ctx) {
  VOX_TRY(BrickRanges ranges, create(grid.info(), ctx));
  const ConstVoxelSpan all = packed(grid.view().voxels, grid.info().dims, grid.info().format);
  const auto read = [&](int64_t z0, int64_t, std::unique_ptr<Buffer>&) -> Result<ConstVoxelSpan> {
    return ConstVoxelSpan{all.row(0, z0), all.row_stride, all.slice_stride};
  };
  VOX_CHECK(ranges.measure(grid.info(), 1, read, ctx));
  return ranges;
}

Result<BrickRanges> BrickRanges::of(const svmm::Volume& volume, Context& ctx) {
  const VolumeInfo& info = volume.info();
  VOX_TRY(BrickRanges ranges, create(info, ctx));
  const auto decode = [&](const Box& box, VoxelSpan out) { return volume.decode(box, 0, out); };
  VOX_CHECK(ranges.measure(info, 1, decoded_slabs(info, decode, ctx), ctx));
  return ranges;
}

Result<BrickRanges> BrickRanges::of(const svmm::PackedVolume& volume, Context& ctx) {
  const VolumeInfo info = volume.info_of(volume.finest());
  VOX_TRY(BrickRanges ranges, create(info, ctx));
  VOX_TRY(const auto pages, svmm::page_ranges(volume));
  if (pages) {
    ranges.all_ = pages->all.lo <= pages->all.hi ? pages->all : ValueRange{0, 0};
    ranges.spread_pages(pages->pages, volume.params().page_side, info.dims);
    return ranges;
  }
  const auto decode = [&](const Box& box, VoxelSpan out) -> Status {
    svmm::PackedVolume::Reader reader(volume,
                                      volume.finest());  // what the slabs beside it need, too, is kept
    return reader.read(box, out);
  };
  // Layers of whole pages.
  VOX_CHECK(
      ranges.measure(info, volume.params().page_side / dvr_brick, decoded_slabs(info, decode, ctx), ctx));
  return ranges;
}

void BrickRanges::spread_pages(std::span<const svmm::PageRanges::Range> pages, int64_t side, Index3 dims) {
  const Index3 count = (dims + (side - 1)) / side;
  Range* out = ranges_;
  for (int64_t z = 0; z < bricks_.z; ++z)
    for (int64_t y = 0; y < bricks_.y; ++y)
      for (int64_t x = 0; x < bricks_.x; ++x) {
        const Index3 lo = Index3(x, y, z) * int64_t{dvr_brick}, first = lo / side,
                     last = glm::min(lo + int64_t{dvr_brick}, dims - int64_t{1}) / side;
        Range range = nothing;
        for (int64_t k = first.z; k <= last.z; ++k)
          for (int64_t j = first.y; j <= last.y; ++j)
            for (int64_t i = first.x; i <= last.x; ++i) {
              const auto& page = pages[static_cast<size_t>((k * count.y + j) * count.x + i)];
              if (page.lo <= page.hi) range = merged(range, {page.lo, page.hi});
            }
        *out++ = range;
      }
}

Result<BrickRanges> BrickRanges::finer(const svmm::PackedVolume& volume, const TransferFunction& transfer,
                                       Context& ctx) const {
  if (!all_) return *this;
  const VolumeInfo info = volume.info_of(volume.finest());
  VOX_TRY(BrickRanges ranges, create(info, ctx));
  std::copy_n(ranges_, bricks_.x * bricks_.y * bricks_.z, ranges.ranges_);
  ranges.all_ = all_;
  const int64_t side = volume.params().page_side, bricks = side / dvr_brick;
  const Index3 pages = (info.dims + (side - 1)) / side;
  VOX_CHECK(parallel_for(ctx, pages.y * pages.z, [&](int64_t row) -> Status {
    svmm::PackedVolume::Reader reader(volume, volume.finest());
    std::vector<std::byte> voxels(static_cast<size_t>((side + 1) * (side + 1) * (side + 1)) * sizeof(float));
    for (int64_t x = 0; x < pages.x; ++x) {
      const Index3 lo = Index3(x, row % pages.y, row / pages.y) * side;
      const Box page{lo, glm::min(lo + (side + 1), info.dims)};
      const Box inside{lo / int64_t{dvr_brick}, glm::min(lo / int64_t{dvr_brick} + bricks, bricks_)};
      const auto each = [&](const auto& brick) {
        for (int64_t k = inside.lo.z; k < inside.hi.z; ++k)
          for (int64_t j = inside.lo.y; j < inside.hi.y; ++j)
            for (int64_t i = inside.lo.x; i < inside.hi.x; ++i)
              brick(Index3(i, j, k), ranges.ranges_[(k * bricks_.y + j) * bricks_.x + i]);
      };
      bool seen = false;
      each([&](Index3, const Range& range) {
        seen = seen || (range.lo < range.hi && transfer.shows(range.lo, range.hi));
      });
      if (!seen) continue;
      const VoxelSpan out = packed(voxels.data(), page.size(), info.format);
      VOX_CHECK(reader.read(page, out));
      each([&](Index3 brick, Range& range) {
        const Index3 first = brick * int64_t{dvr_brick} - lo,
                     last = glm::min(first + int64_t{dvr_brick + 1}, page.size());
        const ConstVoxelSpan at{out.row(first.y, first.z) + first.x * voxel_bytes(info.format),
                                out.row_stride, out.slice_stride};
        const auto found = svmm::range_of(at, last - first, info.format);
        range = found.lo <= found.hi ? Range{found.lo, found.hi} : nothing;
      });
    }
    return {};
  }));
  return ranges;
}

Result<BrickRanges> BrickRanges::of(const vq::Volume& volume, Context& ctx) {
  static_assert(dvr_brick == vq::brick_edge);
  VOX_TRY(BrickRanges ranges, create(volume.info(), ctx));
  const Index3 bricks = ranges.bricks_;
  const vq::MappedPools pools(volume);
  const vq::Reader<vq::MappedPools> reader(volume.view(), pools);
  const auto value = [&](uint16_t code) -> float {
    // Ranges are of values; the code for none is above those of all others.
    if (volume.info().format == VoxelFormat::float32 && volume.params().special == code && code > 0) --code;
    const Voxel voxel = volume.voxel_of(code);
    return volume.info().format == VoxelFormat::float32 ? voxel.as<float>()
                                                        : static_cast<float>(voxel.as<uint32_t>());
  };
  VOX_CHECK(parallel_for(ctx, bricks.z, [&](int64_t z) -> Status {
    Range* out = ranges.ranges_ + z * bricks.y * bricks.x;
    uint64_t known = reader.no_brick;
    Range range = nothing;
    for (int64_t y = 0; y < bricks.y; ++y)
      for (int64_t x = 0; x < bricks.x; ++x) {
        const uint64_t id =
            reader.brick_id(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z));
        if (id != known) {
          vq::Record record;
          if (id == reader.no_brick || !reader.find(id, record)) {
            VOX_CHECK(volume.brick_id({x, y, z}));
            VOX_CHECK(volume.brick_range(id));
            return fail(ErrorCode::internal, volume.container().name(), "a brick that is and is not valid");
          }
          range = {value(record.range.min), value(record.range.max)};
          known = id;
        }
        *out++ = range;
      }
    return {};
  }));
  VOX_CHECK(ranges.spread(ctx));
  return ranges;
}

Status BrickRanges::spread(Context& ctx) {
  const Index3 n = bricks_;
  VOX_CHECK(parallel_for(ctx, n.z, [&](int64_t z) -> Status {
    Range* const slice = ranges_ + z * n.y * n.x;
    for (int64_t y = 0; y < n.y; ++y)
      for (int64_t x = 0; x + 1 < n.x; ++x)
        slice[y * n.x + x] = merged(slice[y * n.x + x], slice[y * n.x + x + 1]);
    for (int64_t i = 0; i < (n.y - 1) * n.x; ++i) slice[i] = merged(slice[i], slice[i + n.x]);
    return {};
  }));
  const int64_t area = n.x * n.y;
  for (int64_t i = 0; i < (n.z - 1) * area; ++i) ranges_[i] = merged(ranges_[i], ranges_[i + area]);
  return {};
}

ValueRange BrickRanges::all() const {
  if (all_) return *all_;
  Range range = nothing;
  for (int64_t i = 0; i < bricks_.x * bricks_.y * bricks_.z; ++i) range = merged(range, ranges_[i]);
  if (!(range.lo <= range.hi)) return {0, 0};
  return {static_cast<double>(range.lo), static_cast<double>(range.hi)};
}

Result<BrickSkips> BrickSkips::create(const BrickRanges& ranges, const TransferFunction& transfer,
                                      Context& ctx) {
  constexpr uint64_t slack = 3;
  const Index3 n = ranges.bricks();
  BrickSkips skips;
  skips.row_ = n.x + 2;
  skips.slice_ = skips.row_ * (n.y + 2);
  skips.first_ = skips.slice_ + skips.row_ + 1;
  const uint64_t bytes = static_cast<uint64_t>(skips.slice_ * (n.z + 2)) + slack;
  VOX_TRY(skips.memory_, Buffer::allocate(bytes, "the map of what can be seen", ctx));
  skips.size_ = static_cast<int64_t>(bytes);
  auto* const first = reinterpret_cast<uint8_t*>(skips.memory_->data());
  std::fill_n(first, bytes, uint8_t{255});
  uint8_t* const map = first + skips.first_;
  std::vector<int64_t> seen(static_cast<size_t>(n.z));
  VOX_CHECK(parallel_for(ctx, n.z, [&](int64_t z) -> Status {
    for (int64_t y = 0; y < n.y; ++y)
      for (int64_t x = 0; x < n.x; ++x) {
        const BrickRanges::Range& range = ranges(x, y, z);
        if (!transfer.shows(range.lo, range.hi)) continue;
        map[z * skips.slice_ + y * skips.row_ + x] = 0;
        ++seen[static_cast<size_t>(z)];
      }
    return {};
  }));
  for (const int64_t count : seen) skips.visible_ += count;
  // The distance is one more than the least around: forwards from all neighbours before, then backwards.
  int64_t before[13];
  for (int i = 0; i < 13; ++i)
    before[i] = (i / 9 - 1) * skips.slice_ + (i / 3 % 3 - 1) * skips.row_ + (i % 3 - 1);
  const auto relax = [&](uint8_t* at, int64_t sign) {
    if (*at == 0) return;
    int least = *at - 1;
    for (const int64_t step : before) least = std::min<int>(least, at[sign * step]);
    *at = static_cast<uint8_t>(least + 1);
  };
  for (int64_t z = 0; z < n.z; ++z)
    for (int64_t y = 0; y < n.y; ++y)
      for (int64_t x = 0; x < n.x; ++x) relax(map + z * skips.slice_ + y * skips.row_ + x, 1);
  for (int64_t z = n.z - 1; z >= 0; --z)
    for (int64_t y = n.y - 1; y >= 0; --y)
      for (int64_t x = n.x - 1; x >= 0; --x) relax(map + z * skips.slice_ + y * skips.row_ + x, -1);
  return skips;
}

}  // namespace voxkit::render
