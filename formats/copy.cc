#include "formats/copy.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <mutex>
#include <new>
#include <thread>
#include <vector>

#include "formats/parallel.h"

namespace voxkit {
namespace {

constexpr Index3 tile_size{512, 64, 32};
constexpr int64_t cube = 32;

int64_t divide_up(int64_t a, int64_t b) {
  return (a + b - 1) / b;
}

/// a * b, or the largest number where that does not fit: such sizes are refused by the memory budget.
uint64_t saturating_product(uint64_t a, uint64_t b) {
  uint64_t product;
  return __builtin_mul_overflow(a, b, &product) ? std::numeric_limits<uint64_t>::max() : product;
}

/// Least and greatest value of the finite samples seen.
struct Extremes {
  double lo = std::numeric_limits<double>::infinity();
  double hi = -std::numeric_limits<double>::infinity();

  void merge(const Extremes& e) {
    lo = std::min(lo, e.lo);
    hi = std::max(hi, e.hi);
  }

  /// Without voxels of the value `fill`.
  template <class T>
  void add(ConstVoxelSpan voxels, Index3 size, const std::optional<double>& fill) {
    if (!fill) return add<T>(voxels, size);
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y)
        for (int64_t x = 0; x < size.x; ++x) {
          T value;
          std::memcpy(&value, voxels.row(y, z) + x * static_cast<int64_t>(sizeof(T)), sizeof(T));
          if constexpr (std::is_floating_point_v<T>)
            if (!std::isfinite(value)) continue;
          if (const auto v = static_cast<double>(value); v != *fill) merge({v, v});
        }
  }
  template <class T>
  void add(ConstVoxelSpan voxels, Index3 size) {
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y) {
        const std::byte* row = voxels.row(y, z);
        T least = std::numeric_limits<T>::max(), greatest = std::numeric_limits<T>::lowest();
        for (int64_t x = 0; x < size.x; ++x) {
          T value;
          std::memcpy(&value, row + x * static_cast<int64_t>(sizeof(T)), sizeof(T));
          if constexpr (std::is_floating_point_v<T>)
            if (!std::isfinite(value)) continue;
          least = std::min(least, value);
          greatest = std::max(greatest, value);
        }
        if (least <= greatest) merge({static_cast<double>(least), static_cast<double>(greatest)});
      }
  }

  void add(ConstVoxelSpan voxels, Index3 size, VoxelFormat format, const std::optional<double>& fill) {
    switch (format) {
      case VoxelFormat::density16:
        return add<uint16_t>(voxels, size, fill);
      case VoxelFormat::float32:
        return add<float>(voxels, size, fill);
      default:
        return add<uint8_t>(voxels, size, fill);
    }
  }
};

}  // namespace

Slabs::Slabs(const Box& box, int bytes_per_voxel, uint64_t target) : box_(box) {
  if (box.empty()) return;
  const Index3 size = box.size();
  const uint64_t slice =
      saturating_product(saturating_product(static_cast<uint64_t>(size.x), static_cast<uint64_t>(size.y)),
                         static_cast<uint64_t>(bytes_per_voxel));
  const uint64_t slices = std::clamp<uint64_t>(target / slice, 1, static_cast<uint64_t>(max_side));
  thickness_ = static_cast<int64_t>(slices >= cube ? slices / cube * cube : std::bit_floor(slices));
  bytes_ = saturating_product(slice, static_cast<uint64_t>(std::min(thickness_, size.z)));
}

int64_t Slabs::count() const {
  return box_.empty() ? 0 : divide_up(box_.hi.z, thickness_) - box_.lo.z / thickness_;
}

Box Slabs::slab(int64_t index) const {
  const int64_t z = (box_.lo.z / thickness_ + index) * thickness_;
  Box slab = box_;
  slab.lo.z = std::max(box_.lo.z, z);
  slab.hi.z = std::min(box_.hi.z, z + thickness_);
  return slab;
}

int64_t Slabs::tiles(const Box& slab) {
  const Index3 size = slab.size();
  return divide_up(size.x, tile_size.x) * divide_up(size.y, tile_size.y) * divide_up(size.z, tile_size.z);
}

Box Slabs::tile(const Box& slab, int64_t index) {
  const Index3 size = slab.size();
  const int64_t across = divide_up(size.x, tile_size.x), up = divide_up(size.y, tile_size.y);
  const Index3 lo = slab.lo + Index3(index % across, index / across % up, index / across / up) * tile_size;
  return intersect({lo, lo + tile_size}, slab);
}

uint64_t slab_target(const Context& ctx) {
  return std::min<uint64_t>(uint64_t{8} << 20, ctx.memory->limit() / 8);
}

Result<std::unique_ptr<Buffer>> Buffer::allocate(uint64_t bytes, const std::string& what, Context& ctx) {
  VOX_TRY(Reservation reservation, Reservation::take(bytes, what, ctx));
  std::unique_ptr<Buffer> buffer(new Buffer(std::move(reservation)));
  buffer->data_.reset(new (std::nothrow) std::byte[bytes]);
  if (!buffer->data_)
    return fail(ErrorCode::limit, {}, what + ": the system has no memory left: lower --max-memory");
  return buffer;
}

Status walk_tile(const Box& tile, const std::function<bool(const Box&)>& known,
                 const std::function<Status(const Box&)>& read) {
  if (known(tile)) return {};
  const Index3 cubes{divide_up(tile.size().x, cube), divide_up(tile.size().y, cube),
                     divide_up(tile.size().z, cube)};
  const auto cube_box = [&](Index3 c) {
    const Index3 lo = tile.lo + c * cube;
    return intersect({lo, lo + cube}, tile);
  };
  std::vector<bool> done(static_cast<size_t>(cubes.x * cubes.y * cubes.z));
  bool any = false;
  if (done.size() > 1) {
    for (size_t i = 0; i < done.size(); ++i) {
      const auto n = static_cast<int64_t>(i);
      done[i] = known(cube_box({n % cubes.x, n / cubes.x % cubes.y, n / cubes.x / cubes.y}));
      any = any || done[i];
    }
  }
  if (!any) return read(tile);
  for (int64_t z = 0; z < cubes.z; ++z)
    for (int64_t y = 0; y < cubes.y; ++y)
      for (int64_t x = 0; x < cubes.x; ++x) {
        const size_t row = static_cast<size_t>((z * cubes.y + y) * cubes.x);
        if (done[row + static_cast<size_t>(x)]) continue;
        Box run = cube_box({x, y, z});
        while (x + 1 < cubes.x && !done[row + static_cast<size_t>(x + 1)]) ++x;
        run.hi.x = cube_box({x, y, z}).hi.x;
        VOX_CHECK(read(run));
      }
  return {};
}

Status read_slab(VolumeSource& source, const Box& slab, VoxelSpan out, Context& ctx) {
  const VoxelFormat format = source.info().format;
  if (const auto value = source.uniform(slab)) {
    // A forward-only source need not be asked for these slices: gaps are skipped.
    fill(out, slab.size(), format, *value);
    return {};
  }
  if (source.forward_only()) return source.read(slab, out);
  const auto at = [&](const Box& box) {
    const Index3 offset = box.lo - slab.lo;
    return VoxelSpan{out.row(offset.y, offset.z) + offset.x * voxel_bytes(format), out.row_stride,
                     out.slice_stride};
  };
  return parallel_for(ctx, Slabs::tiles(slab), [&](int64_t i) -> Status {
    return walk_tile(
        Slabs::tile(slab, i),
        [&](const Box& box) {
          const auto value = source.uniform(box);
          if (value) fill(at(box), box.size(), format, *value);
          return value.has_value();
        },
        [&](const Box& box) { return source.read(box, at(box)); });
  });
}

Status copy_volume(VolumeSource& source, const Box& box, VolumeSink& sink, Context& ctx) {
  const VoxelFormat format = source.info().format;
  const Slabs slabs(box, voxel_bytes(format), slab_target(ctx));
  const int64_t count = slabs.count();
  // With one thread, or one slab, there is nothing to overlap.
  const bool overlap = ctx.threads > 1 && count > 1;
  std::unique_ptr<Buffer> buffers[2];
  for (int i = 0; i < (overlap ? 2 : 1); ++i) {
    VOX_TRY(buffers[i], Buffer::allocate(slabs.bytes(), "a slab of voxels", ctx));
  }

  Status written;
  std::jthread writer;
  for (int64_t i = 0; i < count; ++i) {
    VOX_CHECK(check_interrupt());
    const Box slab = slabs.slab(i);
    std::byte* data = buffers[overlap ? i % 2 : 0]->data();
    source.expect(slab.lo.z, slab.hi.z);
    const Status status = read_slab(source, slab, packed(data, slab.size(), format), ctx);
    source.release(slab.lo.z, slab.hi.z);
    if (writer.joinable()) writer.join();
    VOX_CHECK(written);
    VOX_CHECK(status);
    ctx.progress(static_cast<double>(slab.lo.z - box.lo.z) / static_cast<double>(box.size().z));
    const auto write = [&written, &sink, &box, slab, data, format] {
      try {
        written = sink.write(slab.lo.z - box.lo.z, slab.hi.z - box.lo.z,
                             packed(static_cast<const std::byte*>(data), slab.size(), format));
      } catch (const std::bad_alloc&) {
        written = fail(ErrorCode::limit, {}, "out of memory while writing: lower --threads or free memory");
      }
    };
    if (overlap)
      writer = std::jthread(write);
    else
      write();
  }
  if (writer.joinable()) writer.join();
  VOX_CHECK(written);
  VOX_CHECK(check_interrupt());
  ctx.progress(1);
  return {};
}

Status visit_voxels(VolumeSource& source, const VisitVoxels& visit, Context& ctx) {
  const VoxelFormat format = source.info().format;
  const Box box = source.info().box();
  const Slabs slabs(box, voxel_bytes(format), slab_target(ctx));
  std::unique_ptr<Buffer> buffer;
  if (source.forward_only()) {
    VOX_TRY(buffer, Buffer::allocate(slabs.bytes(), "a slab of voxels", ctx));
  }
  const auto visit_one = [&](const Voxel& value, const Box& of) {
    visit(packed(value.bytes.data(), Index3(1), format), Index3(1), of.voxels());
  };
  for (int64_t i = 0; i < slabs.count(); ++i) {
    VOX_CHECK(check_interrupt());
    const Box slab = slabs.slab(i);
    VoxelSpan whole;
    if (buffer) {
      whole = packed(buffer->data(), slab.size(), format);
      VOX_CHECK(source.read(slab, whole));
    } else if (const auto value = source.uniform(slab)) {
      visit_one(*value, slab);
      continue;
    }
    source.expect(slab.lo.z, slab.hi.z);
    VOX_CHECK(parallel_for(ctx, Slabs::tiles(slab), [&](int64_t t) -> Status {
      const Box tile = Slabs::tile(slab, t);
      if (buffer) {
        const Index3 at = tile.lo - slab.lo;
        visit({whole.row(at.y, at.z) + at.x * voxel_bytes(format), whole.row_stride, whole.slice_stride},
              tile.size(), 1);
        return {};
      }
      const auto known = [&](const Box& b) {
        const auto value = source.uniform(b);
        if (value) visit_one(*value, b);
        return value.has_value();
      };
      std::unique_ptr<std::byte[]> voxels;
      const auto read = [&](const Box& b) -> Status {
        if (!voxels) voxels.reset(new std::byte[static_cast<size_t>(tile.voxels() * voxel_bytes(format))]);
        VOX_CHECK(source.read(b, packed(voxels.get(), b.size(), format)));
        visit(packed(static_cast<const std::byte*>(voxels.get()), b.size(), format), b.size(), 1);
        return {};
      };
      return walk_tile(tile, known, read);
    }));
    source.release(slab.lo.z, slab.hi.z);
    ctx.progress(static_cast<double>(slab.hi.z) / static_cast<double>(box.hi.z));
  }
  return {};
}

Result<ValueRange> measure_range(VolumeSource& source, Context& ctx) {
  const VolumeInfo& info = source.info();
  const VoxelFormat format = info.format;
  if (is_color(format)) return bad_usage("a colour volume has no range of values: expected a scalar volume");
  Extremes total;
  std::mutex mutex;
  VOX_CHECK(visit_voxels(
      source,
      [&](ConstVoxelSpan voxels, Index3 size, int64_t) {
        Extremes part;
        part.add(voxels, size, format, info.fill);
        std::lock_guard lock(mutex);
        total.merge(part);
      },
      ctx));
  if (total.lo > total.hi) return ValueRange{0, 0};
  return ValueRange{total.lo, total.hi};
}

}  // namespace voxkit
