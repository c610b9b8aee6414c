#include "libcolor/terrain/terrain.h"

#include <fmt/format.h>

#include <charconv>
#include <mutex>
#include <string_view>

#include "libcolor/surface/morton.h"
#include "libcolor/surface/surface_batches.h"
#include "libcolor/terrain/tile.h"

namespace voxkit::color {
namespace {

using terrain::Extent;
using terrain::Sampling;
using terrain::Scene;
using terrain::Tile;

constexpr std::string_view prefix = "terrain:";
constexpr int job_bits = 6;

/// A cube of voxels at a multiple of its side, 2^bits.
struct Job {
  std::array<int64_t, 3> corner{};
  int bits = 0;
};

/// The extent of the samples of a cube.
Extent extent_of(const Sampling& sampling, const Job& job) {
  Extent extent{};
  for (size_t a = 0; a < 3; ++a) {
    const int64_t lo = job.corner[a], hi = std::min(lo + (int64_t{1} << job.bits), sampling.n()) - 1;
    extent.lo[a] = a == 1 ? sampling.y(lo) : sampling.x(lo);
    extent.hi[a] = a == 1 ? sampling.y(hi) : sampling.x(hi);
  }
  return extent;
}

Job child_of(const Job& job, int64_t octant) {
  const int64_t half = int64_t{1} << (job.bits - 1);
  return {{job.corner[0] + (octant & 1) * half, job.corner[1] + (octant >> 1 & 1) * half,
           job.corner[2] + (octant >> 2) * half},
          job.bits - 1};
}

class Terrain final : public SurfaceSource {
 public:
  Terrain(int64_t n, bool box) : sampling_(n), box_(box) {
    info_.dims = Index3(n, std::min(sampling_.height(), n), n);
    info_.format = VoxelFormat::rgba32;
    const double edge = 128 / static_cast<double>(n);
    info_.affine = Affine::plain({edge, edge, edge}, {edge / 2, 0, edge / 2});
    while (int64_t{1} << all_bits_ < n) ++all_bits_;
  }

  Status read(Context& ctx, const Sink& sink) override {
    VOX_TRY(const Reservation memory, Reservation::take(Scene::bytes(), "the terrain", ctx));
    VOX_TRY(scene_, Scene::make(box_, ctx));
    std::vector<Job> waiting{{{0, 0, 0}, all_bits_}};
    const auto next = [&](Job& job) -> Result<bool> {
      while (!waiting.empty()) {
        job = waiting.back();
        waiting.pop_back();
        if (!may_have_voxels(job)) continue;
        if (job.bits <= job_bits) return true;
        for (int64_t octant = 8; octant-- > 0;) waiting.push_back(child_of(job, octant));
      }
      return false;
    };
    return read_in_batches<Job>({job_bits, all_bits_, sizeof(Tile) + (uint64_t{1} << 17)}, sink, ctx, next,
                                [&](const Job& job, VoxelBatch& out) { return make(job, out.voxels); });
  }

 private:
  bool may_have_voxels(const Job& job) const {
    for (size_t a = 0; a < 3; ++a)
      if (job.corner[a] >= info_.dims[static_cast<Index3::length_type>(a)]) return false;
    return scene_->may_meet(extent_of(sampling_, job), 2 * sampling_.edge());
  }

  Status make(const Job& job, std::vector<SurfaceVoxel>& out) {
    std::unique_ptr<Tile> tile;
    {
      std::lock_guard lock(mutex_);
      if (!idle_.empty()) tile = std::move(idle_.back()), idle_.pop_back();
    }
    if (!tile) tile = std::make_unique<Tile>();
    visit(*tile, job, out);
    std::lock_guard lock(mutex_);
    idle_.push_back(std::move(tile));
    return {};
  }

  void visit(Tile& tile, const Job& job, std::vector<SurfaceVoxel>& out) const {
    if (!may_have_voxels(job)) return;
    if (job.bits > Tile::bits) {
      for (int64_t octant = 0; octant < 8; ++octant) visit(tile, child_of(job, octant), out);
      return;
    }
    const auto [x, y, z] = job.corner;
    tile.run(*scene_, sampling_, job.corner,
             morton_code(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z)), out);
  }

  Sampling sampling_;
  bool box_;
  int all_bits_ = 0;
  std::unique_ptr<const Scene> scene_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<Tile>> idle_;
};

}  // namespace

bool is_terrain(const std::string& name) {
  return name.starts_with(prefix);
}

Result<std::unique_ptr<SurfaceSource>> open_terrain(const std::string& name) {
  int64_t n = 0;
  const char* const end = name.data() + name.size();
  const auto [next, error] = std::from_chars(name.data() + prefix.size(), end, n);
  const std::string_view rest(next, static_cast<size_t>(end - next));
  if (error != std::errc{} || n < 1 || n > int64_t{1} << most_levels || (!rest.empty() && rest != ":box"))
    return bad_usage(fmt::format("not a built-in surface: expected terrain:N or terrain:N:box with N 1 to {}",
                                 int64_t{1} << most_levels));
  return std::make_unique<Terrain>(n, !rest.empty());
}

}  // namespace voxkit::color
