#include "libcolor/surface/volume_surface.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <vector>

#include "formats/parallel.h"
#include "formats/reservation.h"
#include "libcolor/surface/attribute_choice.h"
#include "libcolor/surface/morton.h"
#include "libcolor/surface/surface_batches.h"

namespace voxkit::color {
namespace {

constexpr int tile_log2 = 7;
constexpr int64_t tile_side = int64_t{1} << tile_log2;

class VolumeSurface final : public SurfaceSource {
 public:
  explicit VolumeSurface(std::unique_ptr<VolumeSource> volume) : volume_(std::move(volume)) {
    info_ = volume_->info();
    format_ = info_.format;
    info_.format = VoxelFormat::rgba32;
    info_.range.reset();
  }
  void deliver(AttributeSet attributes) { attributes_ = attributes; }

  /// Whether some alpha is neither 0 nor 255.
  Result<bool> is_faint(Context& ctx) {
    if (format_ != VoxelFormat::rgba32) return false;
    looks_ = true;
    VOX_CHECK(read(ctx, [](const VoxelRun&) -> Status { return {}; }));
    looks_ = false;
    return found_faint_.load();
  }

  Status read(Context& ctx, const Sink& sink) override {
    Reservation reservation(*ctx.memory);
    batch_ = static_cast<size_t>(2 * ctx.threads);
    constexpr uint64_t tile_bytes = uint64_t{1} << 3 * tile_log2;
    VOX_CHECK(reservation.add(batch_ * tile_bytes * (4 + sizeof(SurfaceVoxel) + attributes_.bytes()),
                              "room for cubes of the volume"));
    int height = tile_log2;
    while (tile_side << (height - tile_log2) < std::max({info_.dims.x, info_.dims.y, info_.dims.z})) ++height;
    VOX_CHECK(visit(height, Index3(0), sink, ctx));
    return flush(sink, ctx);
  }

 private:
  struct Tile {
    Box box;
    Index3 corner;
    VoxelBatch made;
  };

  /// Collects the cubes that may have voxels, in Morton order.
  Status visit(int height, Index3 corner, const Sink& sink, Context& ctx) {
    if (looks_ && found_faint_) return {};  // there is nothing more to find
    const Box box = intersect({corner, corner + (int64_t{1} << height)}, info_.box());
    if (box.empty()) return {};
    if (const auto value = volume_->uniform(box); value && is_void(value->bytes.data())) return {};
    if (height > tile_log2) {
      for (uint32_t octant = 0; octant < 8; ++octant) {
        const Index3 at =
            corner + Index3(octant & 1, octant >> 1 & 1, octant >> 2) * (int64_t{1} << (height - 1));
        VOX_CHECK(visit(height - 1, at, sink, ctx));
      }
      return {};
    }
    tiles_.push_back({box, corner, {}});
    return tiles_.size() == batch_ ? flush(sink, ctx) : Status();
  }

  Status flush(const Sink& sink, Context& ctx) {
    VOX_CHECK(parallel_for(ctx, static_cast<int64_t>(tiles_.size()),
                           [&](int64_t i) -> Status { return read_tile(tiles_[static_cast<size_t>(i)]); }));
    for (const Tile& tile : tiles_)
      if (!tile.made.voxels.empty()) VOX_CHECK(sink({tile.made.voxels, tile.made.attributes}));
    tiles_.clear();
    return {};
  }

  Status read_tile(Tile& tile) {
    const Index3 size = tile.box.size();
    const int bytes = voxel_bytes(format_);
    std::vector<std::byte> memory(static_cast<size_t>(tile.box.voxels() * bytes));
    const VoxelSpan span = packed(memory.data(), size, format_);
    VOX_CHECK(volume_->read(tile.box, span));
    if (looks_) {
      look_at(span, size);
      return {};
    }
    const bool opacity = attributes_.has(Attribute::opacity);
    const uint64_t first =
        morton_code(static_cast<uint32_t>(tile.corner.x), static_cast<uint32_t>(tile.corner.y),
                    static_cast<uint32_t>(tile.corner.z));
    for (uint64_t i = 0; i < uint64_t{1} << 3 * tile_log2; ++i) {
      const auto at = morton_place(i);
      if (at.x >= size.x || at.y >= size.y || at.z >= size.z) {
        // All of an octant that begins outside is outside.
        if ((i & 63) == 0) i += 63;
        continue;
      }
      const std::byte* const voxel = span.row(at.y, at.z) + at.x * bytes;
      if (is_void(voxel)) continue;
      tile.made.voxels.push_back(
          {first + i,
           {static_cast<uint8_t>(voxel[0]), static_cast<uint8_t>(voxel[1]), static_cast<uint8_t>(voxel[2])}});
      if (opacity) tile.made.attributes.push_back(voxel[3]);
    }
    return {};
  }

  void look_at(const VoxelSpan& span, const Index3& size) {
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y) {
        const auto* const row = reinterpret_cast<const uint8_t*>(span.row(y, z));
        bool faint = false;
        for (int64_t x = 0; x < size.x; ++x) faint |= static_cast<uint8_t>(row[4 * x + 3] + 1) > 1;
        if (faint) found_faint_ = true;
      }
  }

  bool is_void(const std::byte* voxel) const {
    if (format_ == VoxelFormat::rgba32) return voxel[3] == std::byte{0};
    return (voxel[0] | voxel[1] | voxel[2]) == std::byte{0};
  }

  std::unique_ptr<VolumeSource> volume_;
  VoxelFormat format_;
  std::vector<Tile> tiles_;
  size_t batch_ = 0;
  bool looks_ = false;  ///< for alpha only
  std::atomic<bool> found_faint_ = false;
};

}  // namespace

Result<std::unique_ptr<SurfaceSource>> surface_of(std::unique_ptr<VolumeSource> volume,
                                                  const std::optional<AttributeSet>& wanted, Context& ctx) {
  const VolumeInfo& info = volume->info();
  if (!is_color(info.format))
    return bad_input({}, fmt::format("{} voxels: expected colors (RGBA32 or RGB24)", type_name(info)));
  if (std::max({info.dims.x, info.dims.y, info.dims.z}) > int64_t{1} << most_levels)
    return bad_input({}, fmt::format("{} x {} x {} voxels: expected at most {} a side", info.dims.x,
                                     info.dims.y, info.dims.z, 1 << most_levels));
  if (volume->forward_only())
    return bad_input({}, "can only be read front to back: expected a file that is not compressed as a whole");
  AttributeSet can, by_itself;
  add_if(can, Attribute::opacity, info.format == VoxelFormat::rgba32);
  auto surface = std::make_unique<VolumeSurface>(std::move(volume));
  if (!wanted) {
    VOX_TRY(const bool faint, surface->is_faint(ctx));
    add_if(by_itself, Attribute::opacity, faint);
  }
  VOX_TRY(const AttributeSet attributes, choose_attributes(wanted, can, by_itself));
  surface->deliver(attributes);
  return surface;
}

Result<std::unique_ptr<SurfaceSource>> surface_of(std::unique_ptr<VolumeSource> volume) {
  Context ctx;
  return surface_of(std::move(volume), AttributeSet(), ctx);
}

}  // namespace voxkit::color
