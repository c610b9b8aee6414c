// Random access to a compressed volume: opening, single voxels, regions (thesis section 3.1).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/volume_chunks.h"
#include "libsvmm/base_block.h"
#include "libsvmm/base_voxel.h"
#include "libsvmm/store.h"

namespace voxkit::svmm {
namespace {

Index3 ceil_divide(Index3 v, int64_t by) {
  return (v + Index3(by - 1)) / Index3(by);
}

View make_view(const VolumeInfo& info, const Params& params, std::span<const Level> levels) {
  View view;
  view.root = static_cast<int>(levels.size()) - 1;
  view.format = info.format;
  view.layout = params.layout;
  view.base = params.base;
  view.value_bytes = value_bytes(info.format);
  while (int64_t{1} << view.log2_side < std::max({info.dims.x, info.dims.y, info.dims.z})) ++view.log2_side;
  for (size_t k = 0; k < levels.size(); ++k) {
    const Level& level = levels[k];
    const Index3 size = level.blockwidth ? Index3(level.blockwidth) : level.dims;
    // In the layout of the thesis a link is spread over the eight words of a subblock.
    const int lookup = params.layout == Layout::thesis ? (k > 0 ? 8 : 1) * word_bytes(info.format)
                                                       : value_bytes(info.format) + (k > 0 ? 8 : 0);
    view.levels[k] = {std::countr_zero(level.mip_factor),
                      level.blockwidth ? level.blockwidth - 1 : ~0u,
                      size.x / 2,
                      size.x / 2 * (size.y / 2),
                      size,
                      static_cast<uint32_t>(lookup)};
  }
  for (size_t b = 0; b < std::size(view.level_of_bits); ++b) {
    size_t k = 0;
    while (k + 1 < levels.size() && static_cast<size_t>(view.levels[k + 1].shift) < b) ++k;
    view.level_of_bits[b] = static_cast<uint8_t>(k);
  }
  return view;
}

}  // namespace

Volume::Volume() = default;
Volume::~Volume() = default;

Result<std::shared_ptr<const Volume>> Volume::open(std::shared_ptr<const Container> container) {
  const std::string& file = container->name();
  if (container->codec() != Codec::svmm) return bad_input(file, "header, byte 10: not an SVMM volume");
  std::shared_ptr<Volume> volume(new Volume);
  VOX_TRY(volume->info_, read_volume_info(*container));
  VOX_TRY(const auto params_bytes, container->only_chunk(params_kind));
  VOX_TRY(auto unpacked, unpack_params(params_bytes, volume->info_, file));
  volume->params_ = std::move(unpacked.params);
  volume->levels_ = std::move(unpacked.levels);
  volume->store_ = std::make_unique<Store>();

  // Every level's blocks must be there, in whole chunks.
  auto& stores = volume->store_->levels;
  stores.resize(volume->levels_.size());
  const auto& table = container->table();
  for (size_t i = 0; i < table.size(); ++i) {
    if (table[i].kind != blocks_kind) continue;
    if (table[i].index >= stores.size())
      return bad_input(file, fmt::format("table: chunk BLKS {}.{}: expected a level below {}", table[i].index,
                                         table[i].part, stores.size()));
    stores[table[i].index].chunks.push_back(i);
  }
  for (size_t k = 0; k < stores.size(); ++k) {
    const Level& level = volume->levels_[k];
    stores[k].chunk_log2 = blocks_per_chunk_log2(level.block_bytes);
    stores[k].size = level.blockwidth ? Index3(level.blockwidth) : level.dims;
    stores[k].blocks = level.blocks;
    stores[k].block_bytes = level.block_bytes;
    std::vector<size_t>& chunks = stores[k].chunks;
    std::stable_sort(chunks.begin(), chunks.end(),
                     [&](size_t a, size_t b) { return table[a].part < table[b].part; });
    uint64_t rest = level.blocks;
    for (size_t part = 0; part < chunks.size(); ++part) {
      const size_t chunk = chunks[part];
      if (table[chunk].part != part)
        return bad_input(file, fmt::format("table: chunk BLKS {}.{} follows {} others of its level: expected "
                                           "parts 0, 1, 2 ... once each",
                                           k, table[chunk].part, part));
      const uint64_t blocks = std::min(rest, uint64_t{1} << stores[k].chunk_log2);
      uint64_t bytes = 0;
      if (blocks == 0 || __builtin_mul_overflow(blocks, level.block_bytes, &bytes) ||
          bytes != table[chunk].length)
        return bad_input(file,
                         fmt::format("table: chunk BLKS {}.{} has {} bytes: expected {} blocks of {}", k,
                                     table[chunk].part, table[chunk].length, blocks, level.block_bytes));
      rest -= blocks;
    }
    if (rest != 0)
      return bad_input(file, fmt::format("table: level {} lacks {} of its {} blocks", k, rest, level.blocks));
  }
  for (auto& level : stores)
    level.found = std::make_unique<std::atomic<const std::byte*>[]>(level.chunks.size());
  volume->store_->view = make_view(volume->info_, volume->params_, volume->levels_);
  volume->container_ = std::move(container);
  return volume;
}

Index3 Volume::dims_at(int level) const {
  return ceil_divide(info_.dims, static_cast<int64_t>(levels_[static_cast<size_t>(level)].mip_factor));
}

/// Walks down from the root to one voxel or a box.
struct Decoder {
  const Volume& volume;
  const size_t stop;  ///< level whose voxels are wanted
  const VoxelFormat format = volume.info_.format;
  const Layout layout = volume.params_.layout;
  /// Whether base blocks hold the voxels themselves.
  const bool stored_as_is =
      volume.params_.base == Base::raw && layout == Layout::plain && format != VoxelFormat::bitmap;

  size_t root() const { return volume.levels_.size() - 1; }
  /// Whether blocks of level k have links. The base has none (in a volume of one level, the root is the
  /// base).
  static bool structural(size_t k) { return k > 0; }
  StructuralBlock structural_block(size_t k, const std::byte* bytes) const {
    return {bytes, volume.store_->levels[k].size, format, layout};
  }
  Result<const std::byte*> block(size_t k, uint64_t number) const {
    return volume.store_->block(volume, k, number);
  }
  /// The same, if its chunk has been verified; else null, and `block` tells.
  const std::byte* known_block(size_t k, uint64_t number) const {
    const Store::LevelStore& level = volume.store_->levels[k];
    if (number >= level.blocks) return nullptr;
    const uint64_t chunk = number >> level.chunk_log2;
    const std::byte* const bytes = level.found[chunk].load(std::memory_order_acquire);
    return bytes == nullptr ? nullptr : bytes + (number - (chunk << level.chunk_log2)) * level.block_bytes;
  }
  /// Base voxels, in voxels of the stop level, along the edge of one voxel of level k.
  int64_t scale(size_t k) const {
    return static_cast<int64_t>(volume.levels_[k].mip_factor / volume.levels_[stop].mip_factor);
  }

  struct Found {
    Voxel value;   ///< undecoded (coverage of a BITMAP)
    size_t level;  ///< of the voxel found
    bool terminal;
    const std::byte* base_block =
        nullptr;  ///< if level == 0: its block, not yet decoded; `value` is the parent's
    Index3 in_block{0};
  };
  /// The voxel that covers `v` (of the stop level): terminal, or of the stop level.
  Result<Found> descend(Index3 v) const {
    size_t k = root();
    VOX_TRY(const std::byte* bytes, block(k, 0));
    Found found{{}, k, false, nullptr, {}};
    for (;; --k) {
      const Index3 at = v / Index3(scale(k));
      const Index3 size = volume.store_->levels[k].size;
      const Index3 in_block = k == root() ? at : at % size;
      found.level = k;
      if (!structural(k)) {
        found.base_block = bytes;
        found.in_block = in_block;
        found.terminal = true;
        return found;
      }
      const StructuralBlock here = structural_block(k, bytes);
      const int64_t index = voxel_index(in_block, size);
      const Link link = here.link(index / 8);
      found.value = here.value(index);
      found.terminal = !(link.mask >> (index % 8) & 1u);
      if (found.terminal || k == stop) return found;
      VOX_TRY(bytes, block(k - 1, link.child(static_cast<int>(index % 8))));
    }
  }

  /// Writes the part of `box` (of the stop level) that a block of level k at `origin` (in voxels of level k)
  /// covers. `parent` is its equivalent voxel's value, undecoded.
  Status decode_block(size_t k, const std::byte* bytes, Index3 origin, const Voxel& parent, const Box& box,
                      VoxelSpan out) const {
    const Index3 size = volume.store_->levels[k].size;
    if (!structural(k)) return decode_base(bytes, origin, size, parent, box, out);
    const int64_t edge = scale(k);
    const StructuralBlock here = structural_block(k, bytes);
    const bool whole = box.contains({origin * edge, (origin + size) * edge});
    const bool copies = k == 1 && whole && stored_as_is;  // base blocks, as a whole
    // Voxels of the block that the box touches, widened to subblocks.
    const Box touched =
        intersect({box.lo / Index3(edge) - origin, ceil_divide(box.hi, edge) - origin}, {Index3(0), size});
    for (int64_t z = touched.lo.z & ~1; z < touched.hi.z; z += 2)
      for (int64_t y = touched.lo.y & ~1; y < touched.hi.y; y += 2)
        for (int64_t x = touched.lo.x & ~1; x < touched.hi.x; x += 2) {
          const int64_t s = subblock_index({x, y, z}, size);
          const Link link = here.link(s);
          uint64_t next = link.first;  // as link.child, one after the other
          for (int i = 0; i < 8; ++i) {
            const bool has_block = (link.mask >> i & 1u) != 0;
            const uint64_t number = next;
            next += has_block ? 1 : 0;
            const Index3 v = origin + Index3(x + (i & 1), y + (i >> 1 & 1), z + (i >> 2));
            Box part{v * edge, (v + Index3(1)) * edge};
            if (!whole) part = intersect(part, box);
            if (part.empty()) continue;
            const Index3 at = part.lo - box.lo;
            const VoxelSpan there{out.row(at.y, at.z) + at.x * voxel_bytes(format), out.row_stride,
                                  out.slice_stride};
            const Voxel value = here.value(s * 8 + i);
            if (k > stop && has_block) {
              const std::byte* child = known_block(k - 1, number);
              if (child == nullptr) {
                VOX_TRY(child, block(k - 1, number));
              }
              if (copies) {
                copy_in_block(child, Index3(edge), {Index3(0), Index3(edge)}, there);
              } else {
                VOX_CHECK(decode_block(k - 1, child, v * int64_t{volume.levels_[k - 1].blockwidth}, value,
                                       box, out));
              }
            } else if (whole && edge == 2) {
              fill_eight(decoded_value(value, format), there);
            } else {
              fill(there, part.size(), format, decoded_value(value, format));
            }
          }
        }
    return {};
  }

  /// The one value of the voxels of `box`, where the terminal voxels of a single block tell it.
  std::optional<Voxel> uniform(const Box& box) const {
    auto bytes = block(root(), 0);
    for (size_t k = root(); bytes && structural(k); --k) {
      const Index3 size = volume.store_->levels[k].size, edge(scale(k));
      const Index3 first = box.lo / edge, last = (box.hi - Index3(1)) / edge;
      const Index3 origin = k == root() ? Index3(0) : first / size * size;
      const StructuralBlock here = structural_block(k, *bytes);
      const auto link_of = [&](Index3 v) { return here.link(subblock_index(v - origin, size)); };
      const auto is_terminal = [&](Index3 v) {
        return k == stop || !(link_of(v).mask >> voxel_in_subblock(v - origin) & 1u);
      };
      if (first == last && !is_terminal(first)) {  // the box lies within one block of the level below
        bytes = block(k - 1, link_of(first).child(voxel_in_subblock(first - origin)));
        continue;
      }
      const Voxel value = here.value(voxel_index(first - origin, size));
      for (int64_t z = first.z; z <= last.z; ++z)
        for (int64_t y = first.y; y <= last.y; ++y)
          for (int64_t x = first.x; x <= last.x; ++x) {
            const Index3 v{x, y, z};
            if (!is_terminal(v) || here.value(voxel_index(v - origin, size)) != value) return std::nullopt;
          }
      return decoded_value(value, format);
    }
    return std::nullopt;
  }

  Status decode_base(const std::byte* bytes, Index3 origin, Index3 size, const Voxel& parent, const Box& box,
                     VoxelSpan out) const {
    const Box part = intersect({origin, origin + size}, box);
    thread_local std::vector<std::byte> decoded;
    if (!stored_as_is) {
      decoded.resize(static_cast<size_t>(size.x * size.y * size.z * voxel_bytes(format)));
      decode_base_block(bytes, size, format, volume.params_.base, layout, parent, decoded.data());
      bytes = decoded.data();
    }
    const Box within{part.lo - origin, part.hi - origin};
    const Index3 to = part.lo - box.lo;
    copy_in_block(bytes, size, within,
                  {out.row(to.y, to.z) + to.x * voxel_bytes(format), out.row_stride, out.slice_stride});
    return {};
  }

  /// Copies the voxels of a part of a block, which are in block order, to rows.
  void copy_in_block(const std::byte* bytes, Index3 size, const Box& part, VoxelSpan out) const {
    switch (voxel_bytes(format)) {
      case 1:
        return copy_voxels<1>(bytes, size, part, out);
      case 2:
        return copy_voxels<2>(bytes, size, part, out);
      case 3:
        return copy_voxels<3>(bytes, size, part, out);
      default:
        return copy_voxels<4>(bytes, size, part, out);
    }
  }
  /// Sets 2^3 voxels to one value.
  void fill_eight(const Voxel& value, VoxelSpan out) const {
    switch (voxel_bytes(format)) {
      case 1:
        return fill_rows<1>(value, out);
      case 2:
        return fill_rows<2>(value, out);
      case 3:
        return fill_rows<3>(value, out);
      default:
        return fill_rows<4>(value, out);
    }
  }
  template <size_t stride>
  static void fill_rows(const Voxel& value, VoxelSpan out) {
    std::array<std::byte, 2 * stride> pair;
    std::memcpy(pair.data(), value.bytes.data(), stride);
    std::memcpy(pair.data() + stride, value.bytes.data(), stride);
    for (int row = 0; row < 4; ++row) std::memcpy(out.row(row & 1, row >> 1), pair.data(), pair.size());
  }
  template <size_t stride>
  static void copy_voxels(const std::byte* bytes, Index3 size, const Box& part, VoxelSpan out) {
    if (size == Index3(2) && part == Box{Index3(0), size}) {  // nearly all there are where blocks are small
      for (int row = 0; row < 4; ++row)
        std::memcpy(out.row(row & 1, row >> 1), bytes + 2 * stride * static_cast<size_t>(row), 2 * stride);
      return;
    }
    const Index3 lo = part.lo, hi = part.hi;
    for (int64_t z = lo.z; z < hi.z; ++z)
      for (int64_t y = lo.y; y < hi.y; ++y) {
        std::byte* row = out.row(y - lo.y, z - lo.z);
        const std::byte* in = bytes + static_cast<size_t>(voxel_index({lo.x & ~1, y, z}, size)) * stride;
        int64_t x = lo.x;
        if (x & 1) std::memcpy(row, in + stride, stride), row += stride, in += 8 * stride, ++x;
        for (; x + 2 <= hi.x; x += 2, row += 2 * stride, in += 8 * stride) std::memcpy(row, in, 2 * stride);
        if (x < hi.x) std::memcpy(row, in, stride);
      }
  }
};

Result<Voxel> Volume::sample(Index3 voxel, int level) const {
  const Decoder decoder{*this, static_cast<size_t>(level)};
  if (!Box{Index3(0), dims_at(level)}.contains(voxel))
    return fail(ErrorCode::internal, container_->name(), "sample outside the volume");
  VOX_TRY(const auto found, decoder.descend(voxel));
  if (!found.base_block) return decoded_value(found.value, info_.format);
  return decode_base_voxel(found.base_block, store_->levels[0].size, found.in_block, info_.format,
                           params_.base, params_.layout, found.value);
}

Status Volume::decode(const Box& box, int level, VoxelSpan out) const {
  if (box.empty()) return {};
  if (!Box{Index3(0), dims_at(level)}.contains(box))
    return fail(ErrorCode::internal, container_->name(), "box outside the volume");
  const Decoder decoder{*this, static_cast<size_t>(level)};
  VOX_TRY(const std::byte* root, decoder.block(decoder.root(), 0));
  return decoder.decode_block(decoder.root(), root, Index3(0), {}, box, out);
}

std::optional<Voxel> Volume::uniform(const Box& box, int level) const {
  if (box.empty()) return std::nullopt;
  return Decoder{*this, static_cast<size_t>(level)}.uniform(box);
}

namespace {

class SvmmSource final : public VolumeSource {
 public:
  SvmmSource(std::shared_ptr<const Volume> volume, int level) : volume_(std::move(volume)), level_(level) {
    info_ = volume_->info();
    info_.dims = volume_->dims_at(level);
    const double factor = static_cast<double>(volume_->levels()[static_cast<size_t>(level)].mip_factor);
    info_.affine = info_.affine.coarser({factor, factor, factor});
  }
  Status read(const Box& box, VoxelSpan out) override { return volume_->decode(box, level_, out); }
  std::optional<Voxel> uniform(const Box& box) const override { return volume_->uniform(box, level_); }

 private:
  std::shared_ptr<const Volume> volume_;
  int level_;
};

}  // namespace

Result<std::unique_ptr<VolumeSource>> open_source(std::shared_ptr<const Volume> volume, int level) {
  const int levels = static_cast<int>(volume->levels().size());
  if (level < 0 || level >= levels)
    return bad_usage(fmt::format("--level {}: the file has levels 0 to {}", level, levels - 1));
  return std::make_unique<SvmmSource>(std::move(volume), level);
}

}  // namespace voxkit::svmm
