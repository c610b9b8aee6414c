#include "libcolor/edit/levels.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "libcolor/edit/sound_walk.h"
#include "libcolor/part_codecs.h"
#include "libcolor/surface/morton.h"
#include "libcolor/surface/voxel_means.h"

namespace voxkit::color {
namespace {

uint64_t code_of(Index3 place) {
  return morton_code(static_cast<uint32_t>(place.x), static_cast<uint32_t>(place.y),
                     static_cast<uint32_t>(place.z));
}

/// The voxels of a level in boxes of it.
class Level {
 public:
  Level(std::shared_ptr<const Volume> volume, int level, CellColors colors)
      : volume_(std::move(volume)),
        level_(level),
        stored_(level > 0 && colors == CellColors::stored && volume_->params().colors == Colors::all) {}

  VolumeInfo info() const { return level_info(volume_->info(), level_); }
  const Volume& volume() const { return *volume_; }
  /// Whether the file has the colours of its cells.
  bool stored() const { return stored_; }

  /// The part of the volume that is in a box of the level.
  Box voxels_of(const Box& box) const {
    const int64_t side = int64_t{1} << level_;
    return intersect({box.lo * side, box.hi * side}, volume_->info().box());
  }

  /// Those in a box, in Morton order.
  Status in_box(const Box& box, const SurfaceSource::Sink& sink) const {
    if (volume_->params().leaf_voxels == 0) return {};
    VOX_TRY(const DagView* const view, volume_->store().dag(volume_->container(), volume_->params()));
    ColorReader reader(volume_->store(), volume_->container(), volume_->params());
    return stored_ ? cells(*view, voxels_of(box), reader, sink) : means(*view, voxels_of(box), reader, sink);
  }

 private:
  Status cells(const DagView& view, const Box& part, ColorReader& reader,
               const SurfaceSource::Sink& sink) const {
    constexpr size_t run_voxels = 1 << 14;
    std::vector<SurfaceVoxel> run;
    run.reserve(run_voxels + 8);
    const auto flush = [&]() -> Status {
      VOX_CHECK(volume_->store().status());
      const Status taken = run.empty() ? Status() : sink(run);
      run.clear();
      return taken;
    };
    VOX_CHECK(sound_walk(*volume_, view, part, level_, [&](const WalkedCell& cell) -> Status {
      const uint64_t place = code_of(cell.corner) >> 3 * level_;
      if (level_ >= leaf_height) {
        run.push_back({place, reader.color(cell.color)});
      } else {
        const uint64_t leaf = view.leaf(cell.pointer);
        const uint32_t octants = leaf_octants(leaf & leaf_within(cell.corner, part));
        for (uint32_t left = octants; left != 0; left &= left - 1) {
          const auto octant = static_cast<uint32_t>(std::countr_zero(left));
          run.push_back({place | octant,
                         reader.color(cell.color + leaf_cell_index(leaf, 8 * octant, level_, cell.state))});
        }
      }
      return run.size() < run_voxels ? Status() : flush();
    }));
    return flush();
  }

  Status means(const DagView& view, const Box& part, ColorReader& reader,
               const SurfaceSource::Sink& sink) const {
    VoxelMeans means(sink);
    VOX_CHECK(sound_walk(*volume_, view, part, leaf_height, [&](const WalkedCell& cell) -> Status {
      const uint64_t leaf = view.leaf(cell.pointer), first = code_of(cell.corner);
      for (uint64_t left = leaf & leaf_within(cell.corner, part); left != 0; left &= left - 1) {
        const auto bit = static_cast<uint32_t>(std::countr_zero(left));
        VOX_CHECK(means.add({(first | bit) >> 3 * level_,
                             reader.color(cell.color + leaf_index(leaf, bit, view.colors, cell.state))}));
      }
      return {};
    }));
    return means.finish();
  }

  std::shared_ptr<const Volume> volume_;
  int level_;
  bool stored_;
};

class LevelSurface final : public SurfaceSource {
 public:
  LevelSurface(std::shared_ptr<const Volume> volume, int level, CellColors colors)
      : level_(std::move(volume), level, colors), shift_(3 * level) {
    info_ = level_.info();
    const Params& params = level_.volume().params();
    if (params.grmse > 0)
      notes_.push_back(
          fmt::format("its colors are lossy already ({}, error {:.4g} a channel): errors are "
                      "counted from what they decode to",
                      part_codec(params.codec).name, params.grmse));
  }
  Status read(Context& ctx, const Sink& sink) override {
    if (level_.stored()) return level_.in_box(info_.box(), sink);
    const double end = std::ldexp(1.0, 3 * level_.volume().params().height);
    VoxelMeans means(sink);
    VOX_CHECK(level_.volume().for_each_voxel(
        [&](std::span<const SurfaceVoxel> run) -> Status {
          ctx.progress(static_cast<double>(run.front().place) / end);
          if (shift_ == 0) return sink(run);
          for (const SurfaceVoxel& voxel : run) VOX_CHECK(means.add({voxel.place >> shift_, voxel.color}));
          return {};
        },
        ctx));
    return means.finish();
  }

 private:
  Level level_;
  int shift_;
};

class LevelSource final : public VolumeSource {
 public:
  LevelSource(std::shared_ptr<const Volume> volume, int level, CellColors colors)
      : level_(std::move(volume), level, colors) {
    info_ = level_.info();
  }
  Status read(const Box& box, VoxelSpan out) override {
    fill(out, box.size(), VoxelFormat::rgba32, {});
    return level_.in_box(box, [&](std::span<const SurfaceVoxel> run) -> Status {
      for (const SurfaceVoxel& voxel : run) {
        const Index3 at = Index3(morton_place(voxel.place)) - box.lo;
        std::byte* const to = out.row(at.y, at.z) + at.x * 4;
        const std::array<uint8_t, 4> bytes = {voxel.color.r, voxel.color.g, voxel.color.b, 255};
        std::memcpy(to, bytes.data(), bytes.size());
      }
      return {};
    });
  }
  std::optional<Voxel> uniform(const Box& box) const override {
    return level_.volume().uniform(level_.voxels_of(box));
  }

 private:
  Level level_;
};

}  // namespace

int level_count(const VolumeInfo& info) {
  const int64_t longest = std::max({info.dims.x, info.dims.y, info.dims.z});
  return 1 + static_cast<int>(std::bit_width(static_cast<uint64_t>(longest - 1)));
}

VolumeInfo level_info(const VolumeInfo& info, int level) {
  VolumeInfo coarse = info;
  const int64_t side = int64_t{1} << level;
  coarse.dims = (info.dims + (side - 1)) / side;
  const auto factor = static_cast<double>(side);
  if (level > 0) coarse.affine = info.affine.coarser({factor, factor, factor});
  return coarse;
}

Result<uint64_t> level_voxels(const Volume& volume, int level) {
  if (level == 0 || volume.params().leaf_voxels == 0) return volume.params().leaf_voxels;
  VOX_TRY(const DagView* const view, volume.store().dag(volume.container(), volume.params()));
  uint64_t count = 0;
  VOX_CHECK(sound_walk(volume, *view, volume.info().box(), level, [&](const WalkedCell& cell) -> Status {
    count += level >= leaf_height ? 1 : count_octants(leaf_octants(view->leaf(cell.pointer)));
    return {};
  }));
  return count;
}

std::unique_ptr<SurfaceSource> surface_of(std::shared_ptr<const Volume> volume, int level,
                                          CellColors colors) {
  return std::make_unique<LevelSurface>(std::move(volume), level, colors);
}

std::unique_ptr<VolumeSource> open_level(std::shared_ptr<const Volume> volume, int level, CellColors colors) {
  if (level == 0) return open_source(std::move(volume));
  return std::make_unique<LevelSource>(std::move(volume), level, colors);
}

}  // namespace voxkit::color
