#include "libvq/collect.h"

#include <algorithm>
#include <limits>

#include "formats/copy.h"
#include "formats/parallel.h"

namespace voxkit::vq {
namespace {

constexpr int64_t block_voxels = brick_edge * block_edge;  // along an edge
constexpr int64_t run_blocks = 8;

/// Up to eight blocks along x: what a thread does at a time.
struct Run {
  Index3 first{0};  ///< block
  int64_t blocks = 0;
  std::optional<uint16_t> uniform;  ///< the code of all its voxels; then `bricks` is empty
  struct Found {
    CodedBrick coded;
    uint64_t hash;
  };
  std::vector<Found> bricks;  ///< block after block, in each in order
  Loss loss;
};

class Collector {
 public:
  Collector(VolumeSource& source, const Quantiser& quantiser, Collected& out, Context& ctx)
      : source_(source),
        info_(source.info()),
        bricks_(bricks_of(info_.dims)),
        blocks_(blocks_of(info_.dims)),
        quantiser_(quantiser),
        out_(out),
        ctx_(ctx) {}

  Status run() {
    // Numbers of places, and with them the file, may not go beyond memory in any case.
    uint64_t bytes = 0;
    if (__builtin_mul_overflow(product(blocks_), block_bricks * sizeof(uint32_t), &bytes))
      bytes = std::numeric_limits<uint64_t>::max() / 2;
    VOX_CHECK(out_.reservation.add(bytes, "the offset volume"));
    const int64_t runs_x = (blocks_.x + run_blocks - 1) / run_blocks, runs = runs_x * blocks_.y;
    const int64_t batch = std::min<int64_t>(int64_t{16} * ctx_.threads, runs);
    const uint64_t run_bytes =
        run_blocks * block_bricks * (sizeof(Run::Found) + brick_voxels * (sizeof(uint16_t) + sizeof(float)));
    Reservation working(*ctx_.memory);
    VOX_CHECK(working.add(static_cast<uint64_t>(batch) * run_bytes, "encoding bricks"));
    std::unique_ptr<Buffer> slab;
    if (source_.forward_only()) {
      uint64_t slab_bytes = 0;
      const auto slice = static_cast<uint64_t>(info_.dims.x) * static_cast<uint64_t>(info_.dims.y);
      if (__builtin_mul_overflow(slice, static_cast<uint64_t>(block_voxels * voxel_bytes(info_.format)),
                                 &slab_bytes))
        slab_bytes = std::numeric_limits<uint64_t>::max() / 2;
      VOX_TRY(slab, Buffer::allocate(slab_bytes, "a slab of the input", ctx_));
    }
    out_.numbers.assign(product(blocks_) * block_bricks, no_number);

    std::vector<Run> results(static_cast<size_t>(batch));
    for (int64_t z = 0; z < blocks_.z; ++z) {
      const int64_t z0 = z * block_voxels, z1 = std::min(z0 + block_voxels, info_.dims.z);
      source_.expect(z0, z1);
      if (slab) {
        const Index3 size{info_.dims.x, info_.dims.y, z1 - z0};
        slab_ = packed(slab->data(), size, info_.format);
        VOX_CHECK(source_.read({{0, 0, z0}, {info_.dims.x, info_.dims.y, z1}}, slab_));
      }
      for (int64_t begin = 0; begin < runs; begin += batch) {
        const int64_t count = std::min(batch, runs - begin);
        VOX_CHECK(parallel_for(ctx_, count, [&](int64_t i) {
          const int64_t run = begin + i;
          return code_run({run % runs_x * run_blocks, run / runs_x, z}, results[static_cast<size_t>(i)]);
        }));
        for (int64_t i = 0; i < count; ++i) VOX_CHECK(number_run(results[static_cast<size_t>(i)]));
        ctx_.progress(static_cast<double>(z * runs + begin + count) / static_cast<double>(runs * blocks_.z));
      }
      source_.release(z0, z1);
    }
    return {};
  }

 private:
  Box voxels_of(Index3 block, int64_t count) const {
    const Index3 lo = block * block_voxels;
    return intersect({lo, lo + Index3(count * block_voxels, block_voxels, block_voxels)}, info_.box());
  }
  /// The bricks of a block that are inside the volume, in order: visit(index in the block, brick).
  template <class Visit>
  Status for_each_brick(Index3 block, Visit visit) const {
    for (int64_t i = 0; i < block_bricks; ++i) {
      const Index3 brick = block * int64_t{block_edge} + Index3(i % 4, i / 4 % 4, i / 16);
      if (brick.x < bricks_.x && brick.y < bricks_.y && brick.z < bricks_.z) VOX_CHECK(visit(i, brick));
    }
    return {};
  }

  Status code_run(Index3 first, Run& run) {
    run.first = first;
    run.blocks = std::min(run_blocks, blocks_.x - first.x);
    run.bricks.clear();
    run.uniform.reset();
    run.loss = {};
    const Box box = voxels_of(first, run.blocks);
    if (!source_.forward_only()) {
      if (const auto value = source_.uniform(box)) {
        quantiser_.codes(value->bytes.data(), 1, &run.uniform.emplace(), run.loss);
        return {};
      }
    }
    thread_local std::vector<std::byte> voxels;
    ConstVoxelSpan in;
    if (slab_.data != nullptr) {
      const Index3 at{box.lo.x, box.lo.y, 0};
      in = {slab_.row(at.y, 0) + at.x * voxel_bytes(info_.format), slab_.row_stride, slab_.slice_stride};
    } else {
      voxels.resize(static_cast<size_t>(box.voxels() * voxel_bytes(info_.format)));
      const VoxelSpan out = packed(voxels.data(), box.size(), info_.format);
      VOX_CHECK(read_blocks(run, box, out));
      in = {out.data, out.row_stride, out.slice_stride};
    }

    // Codes of whole bricks: the volume's last voxels are repeated where it ends.
    thread_local std::vector<uint16_t> codes;
    const Index3 size = box.size(), whole = bricks_of(size) * int64_t{brick_edge};
    codes.resize(product(whole));
    for (int64_t z = 0; z < whole.z; ++z)
      for (int64_t y = 0; y < whole.y; ++y) {
        uint16_t* const row = &codes[static_cast<size_t>((z * whole.y + y) * whole.x)];
        quantiser_.codes(in.row(std::min(y, size.y - 1), std::min(z, size.z - 1)), size.x, row, run.loss);
        std::fill(row + size.x, row + whole.x, row[size.x - 1]);
      }
    for (int64_t b = 0; b < run.blocks; ++b) {
      const Index3 block = first + Index3(b, 0, 0);
      VOX_CHECK(for_each_brick(block, [&](int64_t, Index3 at) -> Status {
        const Index3 lo = at * int64_t{brick_edge} - box.lo;
        Brick brick;
        for (int64_t z = 0; z < brick_edge; ++z)
          for (int64_t y = 0; y < brick_edge; ++y)
            std::copy_n(&codes[static_cast<size_t>(((lo.z + z) * whole.y + lo.y + y) * whole.x + lo.x)],
                        brick_edge, &brick[static_cast<size_t>(4 * y + 16 * z)]);
        Run::Found& found = run.bricks.emplace_back();
        code_brick(brick, found.coded);
        found.hash = hash_of(found.coded.range, found.coded.code());
        return {};
      }));
    }
    return {};
  }

  /// Reads a run, but for its blocks that the source knows to be uniform.
  Status read_blocks(const Run& run, const Box& box, VoxelSpan out) {
    const auto at = [&](const Box& part) {
      const int64_t x = part.lo.x - box.lo.x;
      return VoxelSpan{out.data + x * voxel_bytes(info_.format), out.row_stride, out.slice_stride};
    };
    std::optional<Box> unread;
    for (int64_t b = 0; b <= run.blocks; ++b) {
      std::optional<Voxel> value;
      Box part;
      if (b < run.blocks) {
        part = voxels_of(run.first + Index3(b, 0, 0), 1);
        value = source_.uniform(part);
        if (!value) {
          if (!unread) unread = part;
          unread->hi = part.hi;
          continue;
        }
        fill(at(part), part.size(), info_.format, *value);
      }
      if (unread) VOX_CHECK(source_.read(*unread, at(*unread)));
      unread.reset();
    }
    return {};
  }

  Status number_run(const Run& run) {
    out_.loss.greatest_error = std::max(out_.loss.greatest_error, run.loss.greatest_error);
    out_.loss.replaced |= run.loss.replaced;
    std::optional<uint32_t> uniform;
    if (run.uniform) {
      const BrickRange range{*run.uniform, *run.uniform};
      VOX_TRY(uniform, out_.codes.add(range, {}, hash_of(range, {})));
    }
    size_t next = 0;
    for (int64_t b = 0; b < run.blocks; ++b) {
      const Index3 block = run.first + Index3(b, 0, 0);
      uint32_t* const numbers =
          &out_.numbers[static_cast<size_t>((block.z * blocks_.y + block.y) * blocks_.x + block.x) *
                        block_bricks];
      VOX_CHECK(for_each_brick(block, [&](int64_t i, Index3) -> Status {
        if (uniform) {
          numbers[i] = *uniform;
          return {};
        }
        const Run::Found& found = run.bricks[next++];
        VOX_TRY(numbers[i], out_.codes.add(found.coded.range, found.coded.code(), found.hash));
        return {};
      }));
    }
    return {};
  }

  VolumeSource& source_;
  const VolumeInfo info_;
  const Index3 bricks_, blocks_;
  const Quantiser& quantiser_;
  Collected& out_;
  Context& ctx_;
  VoxelSpan slab_;  ///< of a source that is forward only
};

}  // namespace

Status collect(VolumeSource& source, const Quantiser& quantiser, Collected& out, Context& ctx) {
  return Collector(source, quantiser, out, ctx).run();
}

}  // namespace voxkit::vq
