#include "libcolor/edit/levels.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "libcolor/attributes/attribute_means.h"
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

/// Makes voxels of the volume, as they come, voxels of a level, above 0.
template <class Read>
Status means_of(int level, AttributeSet set, const SurfaceSource::Sink& sink, const Read& read) {
  AttributeCells cells(set, level);
  std::vector<std::byte> values;
  const SurfaceSource::Sink with_values = [&](const VoxelRun& run) {
    const Status taken = sink({run.voxels, values});
    values.clear();
    return taken;
  };
  VoxelMeans means(with_values);
  const size_t bytes = set.bytes();
  VOX_CHECK(read([&](const VoxelRun& run) -> Status {
    for (size_t i = 0; i < run.voxels.size(); ++i) {
      const SurfaceVoxel& voxel = run.voxels[i];
      if (bytes > 0) cells.add(voxel.place, run.attributes.subspan(i * bytes, bytes), values);
      VOX_CHECK(means.add({voxel.place >> 3 * level, voxel.color}));
    }
    return {};
  }));
  cells.finish(values);
  return means.finish();
}

class LevelSurface final : public SurfaceSource {
 public:
  explicit LevelSurface(Level level) : level_(std::move(level)) {
    info_ = level_.info();
    attributes_ = level_.attributes();
    const Params& params = level_.volume().params();
    if (params.grmse > 0)
      notes_.push_back(
          fmt::format("its colors are lossy already ({}, error {:.4g} a channel): errors are "
                      "counted from what they decode to",
                      part_codec(params.codec).name, params.grmse));
    if (params.simplify > 0)
      notes_.push_back(
          fmt::format("its voxels are simplified already ({:.4g} off): distances are counted from them",
                      params.hausdorff));
  }
  Status read(Context& ctx, const Sink& sink) override { return level_.for_each_voxel(sink, ctx); }

 private:
  Level level_;
};

class LevelSource final : public VolumeSource {
 public:
  explicit LevelSource(Level level) : level_(std::move(level)) { info_ = level_.info(); }
  Status read(const Box& box, VoxelSpan out) override {
    fill(out, box.size(), VoxelFormat::rgba32, {});
    const AttributeSet set = level_.attributes();
    return level_.for_each_voxel(box, [&](const VoxelRun& run) -> Status {
      for (size_t i = 0; i < run.voxels.size(); ++i) {
        const SurfaceVoxel& voxel = run.voxels[i];
        const Index3 at = Index3(morton_place(voxel.place)) - box.lo;
        std::byte* const to = out.row(at.y, at.z) + at.x * 4;
        const std::array<uint8_t, 4> bytes = {voxel.color.r, voxel.color.g, voxel.color.b,
                                              alpha_of(run, i, set)};
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

Level::Level(std::shared_ptr<const Volume> volume, int level, CellColors colors)
    : volume_(std::move(volume)),
      level_(level),
      stored_(level > 0 && colors == CellColors::stored && volume_->params().colors == Colors::all),
      info_(level_info(volume_->info(), level)) {}

Box Level::touched(const Box& box) const {
  const int64_t side = int64_t{1} << level_;
  return {box.lo / side, (box.hi + (side - 1)) / side};
}

Box Level::voxels_of(const Box& box) const {
  const int64_t side = int64_t{1} << level_;
  return intersect({box.lo * side, box.hi * side}, volume_->info().box());
}

Result<uint64_t> Level::count(const Box& box) const {
  const Params& params = volume_->params();
  if (params.leaf_voxels == 0 || (level_ == 0 && box == info_.box())) return params.leaf_voxels;
  uint64_t count = 0;
  if (level_ == 0) {
    VOX_CHECK(volume_->for_each_voxel(box, [&](std::span<const SurfaceVoxel> run) -> Status {
      count += run.size();
      return {};
    }));
    return count;
  }
  const Box part = voxels_of(box);
  VOX_TRY(const DagView* const view, volume_->store().dag(volume_->container(), params));
  VOX_CHECK(sound_walk(*volume_, *view, part, level_, [&](const WalkedCell& cell) -> Status {
    count += level_ >= leaf_height
                 ? 1
                 : count_octants(leaf_octants(view->leaf(cell.pointer) & leaf_within(cell.corner, part)));
    return {};
  }));
  return count;
}

Status Level::for_each_voxel(const SurfaceSource::Sink& sink, Context& ctx) const {
  if (stored_) return cells(info_.box(), sink);
  const double end = std::ldexp(1.0, 3 * volume_->params().height);
  const auto all = [&](const SurfaceSource::Sink& to) {
    return volume_->for_each_voxel(
        [&](const VoxelRun& run) {
          ctx.progress(static_cast<double>(run.voxels.front().place) / end);
          return to(run);
        },
        ctx);
  };
  return level_ == 0 ? all(sink) : means_of(level_, attributes(), sink, all);
}

Status Level::for_each_voxel(const Box& box, const SurfaceSource::Sink& sink) const {
  if (stored_) return cells(box, sink);
  const auto inside = [&](const SurfaceSource::Sink& to) {
    return volume_->for_each_voxel(voxels_of(box), to);
  };
  return level_ == 0 ? inside(sink) : means_of(level_, attributes(), sink, inside);
}

/// Those whose colours the file has.
Status Level::cells(const Box& box, const SurfaceSource::Sink& sink) const {
  if (volume_->params().leaf_voxels == 0) return {};
  const Box part = voxels_of(box);
  VOX_TRY(const DagView* const view, volume_->store().dag(volume_->container(), volume_->params()));
  ColorReader reader(volume_->store(), volume_->container(), volume_->params());
  AttributesReader attributes(volume_->store(), volume_->container(), volume_->params());
  constexpr size_t run_voxels = 1 << 14;
  std::vector<SurfaceVoxel> run;
  run.reserve(run_voxels + 8);
  std::vector<std::byte> values;
  const auto flush = [&]() -> Status {
    VOX_CHECK(volume_->store().status());
    const Status taken = run.empty() ? Status() : sink({run, values});
    run.clear();
    values.clear();
    return taken;
  };
  const auto add = [&](uint64_t place, uint64_t index) {
    run.push_back({place, reader.color(index)});
    attributes.append(index, values);
  };
  VOX_CHECK(sound_walk(*volume_, *view, part, level_, [&](const WalkedCell& cell) -> Status {
    const uint64_t place = code_of(cell.corner) >> 3 * level_;
    if (level_ >= leaf_height) {
      add(place, cell.color);
    } else {
      const uint64_t leaf = view->leaf(cell.pointer);
      const uint32_t octants = leaf_octants(leaf & leaf_within(cell.corner, part));
      for (uint32_t left = octants; left != 0; left &= left - 1) {
        const auto octant = static_cast<uint32_t>(std::countr_zero(left));
        add(place | octant, cell.color + leaf_cell_index(leaf, 8 * octant, level_, cell.state));
      }
    }
    return run.size() < run_voxels ? Status() : flush();
  }));
  return flush();
}

std::unique_ptr<SurfaceSource> surface_of(std::shared_ptr<const Volume> volume, int level,
                                          CellColors colors) {
  return std::make_unique<LevelSurface>(Level(std::move(volume), level, colors));
}

std::unique_ptr<VolumeSource> open_level(std::shared_ptr<const Volume> volume, int level, CellColors colors) {
  if (level == 0) return open_source(std::move(volume));
  return std::make_unique<LevelSource>(Level(std::move(volume), level, colors));
}

}  // namespace voxkit::color
