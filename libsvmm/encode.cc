// The streaming driver: one pass over the source, a few slabs in memory.
//
// Near the base the volume is taken in tiles, cubes of one group (2^3 blocks) of level k, the largest with
// edges of at most 32 voxels (or of level 0). A tile yields its blocks of levels 0..k and one subblock of
// V_{k+1}. Tiles are encoded in parallel and committed in raster order. Above, levels are made slab by slab:
// when the 2 w layers of V_j that a layer of groups needs are there, its blocks are encoded and two layers of
// V_{j+1} passed on. So the bytes of the file depend on neither threads nor batches.
#include <fmt/format.h>

#include <algorithm>
#include <future>
#include <memory>
#include <utility>

#include "formats/parallel.h"
#include "formats/reservation.h"
#include "formats/volume_chunks.h"
#include "libsvmm/encode_level.h"

namespace voxkit::svmm {
namespace {

constexpr int64_t tile_edge = 32;

/// Collects the blocks of a level into chunks.
class LevelWriter {
 public:
  LevelWriter(ContainerWriter& container, uint32_t index, Level& level)
      : container_(&container),
        index_(index),
        level_(&level),
        chunk_bytes_(level.block_bytes << blocks_per_chunk_log2(level.block_bytes)) {}

  Status append(const BlockBuffer& blocks) {
    level_->terminal_voxels += blocks.terminal_voxels;
    level_->blocks += blocks.blocks;
    std::span<const std::byte> rest = blocks.bytes;
    while (!rest.empty()) {
      const size_t take = std::min<size_t>(rest.size(), chunk_bytes_ - chunk_.size());
      chunk_.insert(chunk_.end(), rest.begin(), rest.begin() + static_cast<ptrdiff_t>(take));
      rest = rest.subspan(take);
      if (chunk_.size() == chunk_bytes_) VOX_CHECK(flush());
    }
    return {};
  }
  Status flush() {
    if (chunk_.empty()) return {};
    VOX_CHECK(container_->add(blocks_kind, index_, part_++, chunk_));
    chunk_.clear();
    return {};
  }

 private:
  ContainerWriter* container_;
  uint32_t index_;
  Level* level_;
  uint64_t chunk_bytes_;
  uint64_t part_ = 0;
  std::vector<std::byte> chunk_;
};

/// Slabs of full width and height, in order; for a source that is forward only, the next one is read while
/// this one is encoded.
class SlabReader {
 public:
  SlabReader(VolumeSource& source, int64_t thickness, bool read_ahead)
      : source_(source), thickness_(thickness), read_ahead_(read_ahead) {
    const Index3 dims = source.info().dims;
    for (auto& buffer : buffers_)
      buffer.resize(static_cast<size_t>(dims.x * dims.y * std::min(thickness, dims.z) *
                                        voxel_bytes(source.info().format)));
    if (read_ahead) start(0);
  }
  /// The slab that begins at z0, where the last one ended. Valid until the next call.
  Result<ConstVoxelSpan> next(int64_t z0) {
    if (!read_ahead_) start(z0);
    VOX_CHECK(pending_.get());
    const std::byte* data = buffers_[current_].data();
    current_ ^= 1;
    if (read_ahead_ && z0 + thickness_ < source_.info().dims.z) start(z0 + thickness_);
    return packed(data, source_.info().dims, source_.info().format);
  }

 private:
  void start(int64_t z0) {
    const Index3 dims = source_.info().dims;
    const Box box{{0, 0, z0}, {dims.x, dims.y, std::min(dims.z, z0 + thickness_)}};
    const VoxelSpan out = packed(buffers_[current_].data(), dims, source_.info().format);
    pending_ = std::async(read_ahead_ ? std::launch::async : std::launch::deferred,
                          [this, box, out] { return source_.read(box, out); });
  }

  VolumeSource& source_;
  int64_t thickness_;
  bool read_ahead_;
  std::vector<std::byte> buffers_[2];
  int current_ = 0;
  std::future<Status> pending_;  // last: its destructor waits for the reader, which uses the members above
};

Index3 min3(Index3 a, Index3 b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}

template <VoxelFormat F>
class Encoder {
 public:
  Encoder(VolumeSource& source, const Params& params, const ByteSink& sink, Context& ctx)
      : source_(source),
        info_(source.info()),
        params_(params),
        criterion_(params, F),
        ctx_(ctx),
        container_(sink, Codec::svmm, container_version_for(info_), params.zstd, *ctx.memory),
        levels_(plan_levels(info_, params)),
        reservation_(*ctx.memory) {
    if (levels_.size() == 1) params_.base = Base::raw;
    criterion_.labels = info_.is_labels;
    if (info_.fill && !info_.is_labels && (F == VoxelFormat::density8 || F == VoxelFormat::density16))
      criterion_.fill = static_cast<int64_t>(*info_.fill);
    for (uint32_t k = 0; k < levels_.size(); ++k) writers_.emplace_back(container_, k, levels_[k]);
  }

  Result<std::vector<Level>> run() {
    if (levels_.size() == 1) {
      VOX_CHECK(encode_base_as_root());
    } else {
      tile_level_ = 0;
      while (tile_level_ + 2 < levels_.size() && group_edge(tile_level_ + 1) <= tile_edge) ++tile_level_;
      VOX_CHECK(reserve_memory());
      VOX_CHECK(encode_tiles());
    }
    for (LevelWriter& writer : writers_) VOX_CHECK(writer.flush());
    VOX_CHECK(add_volume_info(container_, info_));
    VOX_CHECK(container_.add(params_kind, 0, 0, pack_params(params_, levels_)));
    VOX_CHECK(container_.finish());
    return std::move(levels_);
  }

 private:
  /// What one tile yields.
  struct Tile {
    std::vector<BlockBuffer> levels;  // 0 .. tile_level_
    NodeGrid<F> nodes;                // one subblock of V_{tile_level_ + 1}

    void clear(size_t level_count) {
      levels.resize(level_count);
      for (BlockBuffer& level : levels) {
        level.bytes.clear();
        level.blocks = level.terminal_voxels = 0;
      }
      nodes.reset(Index3(2));
    }
  };
  /// Base voxels along the edge of one group of level k.
  int64_t group_edge(size_t k) const {
    return 2 * static_cast<int64_t>(levels_[k].mip_factor * levels_[k].blockwidth);
  }

  Status reserve_memory() {
    const uint64_t bytes = voxel_bytes(F), edge = static_cast<uint64_t>(group_edge(tile_level_));
    const uint64_t slice = static_cast<uint64_t>(info_.dims.x) * static_cast<uint64_t>(info_.dims.y);
    if (slice > uint64_t{1} << 50 || edge > uint64_t{1} << 20)
      return ctx_.memory->reserve(~uint64_t{0} >> 1, "encoding");
    if (source_.forward_only())
      VOX_CHECK(
          reservation_.add(2 * slice * std::min<uint64_t>(edge, static_cast<uint64_t>(info_.dims.z)) * bytes,
                           "two slabs of the input"));
    const uint64_t tile = edge * edge * edge * bytes;
    // A batch's blocks take at most about twice the voxels; its nodes are gone by then.
    if (criterion_.labels && has_commonest<F>) {
      uint64_t most = 0;  // values that are counted at once
      for (size_t k = 0; k + 1 < levels_.size(); ++k) {
        const uint64_t w = levels_[k].blockwidth,
                       voxels = checked_voxels(levels_[k].dims).value_or(most_voxels);
        most = std::max(most, std::min(w * w * w, voxels));
      }
      VOX_CHECK(reservation_.add(static_cast<uint64_t>(ctx_.threads) *
                                     Commonest::bytes(most, F == VoxelFormat::float32 ? most : 65536),
                                 "counts of labels"));
    }
    const uint64_t w = levels_[0].blockwidth;
    const uint64_t nodes = edge * edge * edge / (w * w * w) * sizeof(Node<F>);
    VOX_CHECK(reservation_.add(static_cast<uint64_t>(ctx_.threads) * (tile + 2 * nodes) +
                                   static_cast<uint64_t>(batch_size(edge)) * 2 * tile,
                               "encoding tiles"));
    for (size_t j = tile_level_ + 1; j < levels_.size(); ++j) {
      const Index3 dims = levels_[j].dims;
      const uint64_t layers = std::min<uint64_t>(
          static_cast<uint64_t>(dims.z), j + 1 == levels_.size() ? ~0ull : 2ull * levels_[j].blockwidth);
      uint64_t total = 0;
      if (__builtin_mul_overflow(static_cast<uint64_t>(dims.x) * static_cast<uint64_t>(dims.y),
                                 layers * sizeof(Node<F>), &total))
        total = ~uint64_t{0} >> 1;
      VOX_CHECK(reservation_.add(total, "a slab of a mip-map level"));
    }
    return {};
  }

  /// Tiles encoded before they are committed. Large tiles: one for each thread.
  int64_t batch_size(uint64_t edge) const {
    return ctx_.threads * std::max<int64_t>(1, 64 * tile_edge * tile_edge * tile_edge /
                                                   static_cast<int64_t>(edge * edge * edge));
  }

  Status encode_tiles() {
    const int64_t edge = group_edge(tile_level_);
    const Index3 node_dims = levels_[tile_level_ + 1].dims;  // even, so that tiles fill it
    const int64_t tiles_x = node_dims.x / 2, tiles = tiles_x * (node_dims.y / 2);
    const int64_t batch = batch_size(static_cast<uint64_t>(edge));
    std::unique_ptr<SlabReader> reader;
    if (source_.forward_only()) reader = std::make_unique<SlabReader>(source_, edge, ctx_.threads > 1);
    slabs_.resize(levels_.size());
    std::vector<Tile> results(static_cast<size_t>(std::min(batch, tiles)));
    NodeGrid<F> layers;
    for (int64_t z = 0; z < node_dims.z / 2; ++z) {
      std::optional<ConstVoxelSpan> slab;
      if (reader && z * edge < info_.dims.z) {
        VOX_TRY(slab, reader->next(z * edge));
      }
      const int64_t z_end = std::min((z + 1) * edge, info_.dims.z);
      if (z * edge < z_end) source_.expect(z * edge, z_end);
      layers.reset({node_dims.x, node_dims.y, 2});
      for (int64_t begin = 0; begin < tiles; begin += batch) {
        const int64_t count = std::min(batch, tiles - begin);
        VOX_CHECK(parallel_for(ctx_, count, [&](int64_t i) {
          const Index3 tile{(begin + i) % tiles_x, (begin + i) / tiles_x, z};
          return encode_tile(tile * edge, slab, results[static_cast<size_t>(i)]);
        }));
        for (int64_t i = 0; i < count; ++i) {
          const Index3 at{2 * ((begin + i) % tiles_x), 2 * ((begin + i) / tiles_x), 0};
          VOX_CHECK(commit_tile(results[static_cast<size_t>(i)], at, layers));
        }
        ctx_.progress(static_cast<double>(z * tiles + begin + count) /
                      static_cast<double>(tiles * (node_dims.z / 2)));
      }
      if (z * edge < z_end) source_.release(z * edge, z_end);
      VOX_CHECK(push(tile_level_ + 1, std::move(layers)));
    }
    return {};
  }

  /// Encodes the tile at base voxel `lo`; `slab` is the forward-only source's, else the tile is read here.
  Status encode_tile(Index3 lo, const std::optional<ConstVoxelSpan>& slab, Tile& tile) {
    thread_local std::vector<std::byte> voxels, scratch;
    thread_local NodeGrid<F> grids[2];
    const int64_t edge = group_edge(tile_level_);
    const Box box = intersect({lo, lo + Index3(edge)}, info_.box());
    tile.clear(tile_level_ + 1);
    if (box.empty()) return {};
    if (!slab && uniform_tile(box, edge / 2, tile)) return {};

    ConstVoxelSpan in;
    if (slab) {
      in = {slab->data + lo.y * slab->row_stride + lo.x * voxel_bytes(F), slab->row_stride,
            slab->slice_stride};
    } else {
      voxels.resize(static_cast<size_t>(box.voxels() * voxel_bytes(F)));
      const VoxelSpan out = packed(voxels.data(), box.size(), F);
      VOX_CHECK(source_.read(box, out));
      in = {out.data, out.row_stride, out.slice_stride};
    }
    const int w0 = static_cast<int>(levels_[0].blockwidth);
    scratch.resize(static_cast<size_t>(w0) * static_cast<size_t>(w0) * static_cast<size_t>(w0) *
                   voxel_bytes(F));
    NodeGrid<F>* nodes = &(tile_level_ == 0 ? tile.nodes : grids[0]);
    nodes->resize(Index3(edge / w0));
    for_each_block(nodes->size, [&](Index3 b) {
      const Index3 at = b * int64_t{w0}, valid = min3(Index3(w0), box.size() - at);
      if (valid.x <= 0 || valid.y <= 0 || valid.z <= 0) {
        nodes->at(b) = {};
        return;
      }
      const ConstVoxelSpan block{in.row(at.y, at.z) + at.x * voxel_bytes(F), in.row_stride, in.slice_stride};
      encode_base_block<F>(block, valid, w0, params_, criterion_, scratch, tile.levels[0], nodes->at(b));
    });
    for (size_t k = 1; k <= tile_level_; ++k) {
      const int w = static_cast<int>(levels_[k].blockwidth);
      const Index3 level_size =
          min3(nodes->size, levels_[k].dims - lo / Index3(static_cast<int64_t>(levels_[k].mip_factor)));
      NodeGrid<F>* parents = &(k == tile_level_ ? tile.nodes : grids[k % 2]);
      parents->resize(nodes->size / Index3(w));
      for_each_block(parents->size, [&](Index3 b) {
        encode_block(*nodes, b * int64_t{w}, level_size, w, criterion_, tile.levels[k], parents->at(b));
      });
      nodes = parents;
    }
    return {};
  }

  /// A tile that the source knows to hold one value needs no reading.
  bool uniform_tile(const Box& box, int64_t half, Tile& tile) {
    const auto value = source_.uniform(box);
    if (!value) return false;
    // Layout thesis sees void beside a tile that sticks out of the volume.
    if (params_.layout == Layout::thesis && box.size() != Index3(2 * half) && *value != Voxel{}) return false;
    for (int i = 0; i < 8; ++i) {
      const Index3 v{i & 1, i >> 1 & 1, i >> 2};
      const Box part = intersect({box.lo + v * half, box.lo + (v + Index3(1)) * half}, box);
      if (part.empty()) continue;
      Node<F>& node = tile.nodes.at(v);
      node.moments.add_uniform(*value, static_cast<uint64_t>(part.voxels()), criterion_);
      node.value = node.moments.value(criterion_);
      if (!node.moments.within(node.value, criterion_)) {  // 3 bits of alpha cannot say it
        tile.nodes.reset(Index3(2));
        return false;
      }
    }
    return true;
  }

  /// Visits the blocks of a grid in stored order: groups of 2^3 in raster order, i = 4z + 2y + x within.
  template <class Visit>
  static void for_each_block(const Index3& size, Visit visit) {
    for (int64_t z = 0; z < size.z; z += 2)
      for (int64_t y = 0; y < size.y; y += 2)
        for (int64_t x = 0; x < size.x; x += 2)
          for (int i = 0; i < 8; ++i) visit({x + (i & 1), y + (i >> 1 & 1), z + (i >> 2)});
  }

  /// Gives the blocks of a tile their place in the file.
  Status commit_tile(Tile& tile, Index3 at, NodeGrid<F>& layers) {
    uint64_t below = 0;
    for (size_t k = 0; k <= tile_level_; ++k) {
      const uint64_t first = levels_[k].blocks;
      VOX_CHECK(commit(k, tile.levels[k], below));
      below = first;
    }
    for (int i = 0; i < 8; ++i) {
      const Index3 v{i & 1, i >> 1 & 1, i >> 2};
      Node<F>& node = layers.at(at + v) = tile.nodes.at(v);
      node.block += below;
    }
    return {};
  }

  /// `below`: the number in level k - 1 that the blocks' links count from.
  Status commit(size_t k, BlockBuffer& blocks, uint64_t below) {
    if (k > 0)
      relocate_links(blocks.bytes.data(), blocks.blocks, Index3(levels_[k].blockwidth), F, params_.layout,
                     below);
    VOX_CHECK(writers_[k].append(blocks));
    if (params_.layout == Layout::thesis && levels_[k].blocks > uint64_t{1} << 32)
      return fail(ErrorCode::limit, {}, "layout thesis: a level has over 2^32 blocks: use --layout plain");
    return {};
  }

  /// Two more layers of V_j, or at the end of the volume none: encodes what has become complete.
  Status push(size_t j, NodeGrid<F>&& layers) {
    NodeGrid<F>& slab = slabs_[j];
    const Level& level = levels_[j];
    slab.size = {level.dims.x, level.dims.y, slab.size.z + 2};
    slab.nodes.insert(slab.nodes.end(), layers.nodes.begin(), layers.nodes.end());
    slab_end_.resize(levels_.size());
    slab_end_[j] += 2;
    const bool last = slab_end_[j] == level.dims.z;
    if (j + 1 == levels_.size()) return last ? encode_root(slab) : Status{};
    if (slab.size.z < 2 * static_cast<int64_t>(level.blockwidth) && !last) return {};

    const Index3 parent_dims = levels_[j + 1].dims;
    const int64_t rows = parent_dims.y / 2, w = level.blockwidth;
    NodeGrid<F> parents;
    parents.reset({parent_dims.x, parent_dims.y, 2});
    std::vector<BlockBuffer> results(static_cast<size_t>(rows));
    VOX_CHECK(parallel_for(ctx_, rows, [&](int64_t row) {
      for (int64_t x = 0; x < parent_dims.x; x += 2)
        for (int i = 0; i < 8; ++i) {
          const Index3 b{x + (i & 1), 2 * row + (i >> 1 & 1), i >> 2};
          encode_block(slab, b * w, slab.size, static_cast<int>(w), criterion_,
                       results[static_cast<size_t>(row)], parents.at(b));
        }
      return Status{};
    }));
    for (int64_t row = 0; row < rows; ++row) {
      const uint64_t first = level.blocks;
      VOX_CHECK(commit(j, results[static_cast<size_t>(row)], 0));
      for (int64_t z = 0; z < 2; ++z)
        for (int64_t y = 2 * row; y < 2 * row + 2; ++y)
          for (int64_t x = 0; x < parent_dims.x; ++x) parents.at({x, y, z}).block += first;
    }
    slab.nodes.clear();
    slab.size.z = 0;
    return push(j + 1, std::move(parents));
  }

  Status encode_root(const NodeGrid<F>& nodes) {
    BlockBuffer root;
    root.terminal_voxels = write_structural_block(nodes, Index3(0), nodes.size, params_.layout, root.bytes);
    return writers_.back().append(root);  // plan_levels has counted its one block
  }

  /// A volume no larger than the root level is one block of raw voxels, made two slices at a time.
  Status encode_base_as_root() {
    const Index3 dims = levels_[0].dims;
    uint64_t bytes = 0;
    if (__builtin_mul_overflow(levels_[0].block_bytes, 2u, &bytes)) bytes = ~uint64_t{0} >> 1;
    VOX_CHECK(reservation_.add(bytes, "a volume that is all root level"));
    const size_t slab_bytes = static_cast<size_t>(dims.x * dims.y * 2 * voxel_bytes(F));
    std::vector<std::byte> voxels(slab_bytes), ordered(slab_bytes);
    BlockBuffer root;
    for (int64_t z = 0; z < info_.dims.z; z += 2) {
      const Box box{{0, 0, z}, {info_.dims.x, info_.dims.y, std::min(z + 2, info_.dims.z)}};
      const VoxelSpan out = packed(voxels.data(), box.size(), F);
      VOX_CHECK(check_interrupt());
      VOX_CHECK(source_.read(box, out));
      gather_block<voxel_bytes(F)>({out.data, out.row_stride, out.slice_stride}, {dims.x, dims.y, 2},
                                   box.size(), ordered.data());
      svmm::encode_base_block(ordered.data(), {dims.x, dims.y, 2}, F, Base::raw, params_.layout, root.bytes);
      ctx_.progress(static_cast<double>(box.hi.z) / static_cast<double>(info_.dims.z));
    }
    root.terminal_voxels = static_cast<uint64_t>(info_.box().voxels());
    return writers_[0].append(root);
  }

  VolumeSource& source_;
  const VolumeInfo info_;
  Params params_;
  Criterion criterion_;
  Context& ctx_;
  ContainerWriter container_;
  std::vector<Level> levels_;
  Reservation reservation_;
  std::vector<LevelWriter> writers_;
  size_t tile_level_ = 0;
  std::vector<NodeGrid<F>> slabs_;  // of V_j, for the levels above the tiles
  std::vector<int64_t> slab_end_;   // layers of V_j that have been pushed
};

template <VoxelFormat F>
Result<std::vector<Level>> encode_as(VolumeSource& source, const Params& params, const ByteSink& sink,
                                     Context& ctx) {
  return Encoder<F>(source, params, sink, ctx).run();
}

}  // namespace

Result<std::vector<Level>> encode(VolumeSource& source, const Params& params, const ByteSink& sink,
                                  Context& ctx) {
  VOX_CHECK(validate(params, source.info()));
  if (const auto voxels = checked_voxels(source.info().dims); !voxels || *voxels > most_voxels)
    return fail(ErrorCode::limit, {},
                "the volume has more than 2^48 voxels, whose averages would not be exact");
  switch (source.info().format) {
    case VoxelFormat::rgba32:
      return encode_as<VoxelFormat::rgba32>(source, params, sink, ctx);
    case VoxelFormat::rgb24:
      return encode_as<VoxelFormat::rgb24>(source, params, sink, ctx);
    case VoxelFormat::density8:
      return encode_as<VoxelFormat::density8>(source, params, sink, ctx);
    case VoxelFormat::density16:
      return encode_as<VoxelFormat::density16>(source, params, sink, ctx);
    case VoxelFormat::float32:
      return encode_as<VoxelFormat::float32>(source, params, sink, ctx);
    case VoxelFormat::bitmap:
      return encode_as<VoxelFormat::bitmap>(source, params, sink, ctx);
  }
  return fail(ErrorCode::internal, {}, "unknown voxel format");
}

}  // namespace voxkit::svmm
