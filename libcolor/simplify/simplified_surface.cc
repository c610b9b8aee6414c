#include "libcolor/simplify/simplified_surface.h"

#include <algorithm>
#include <atomic>

#include "formats/parallel.h"
#include "formats/reservation.h"
#include "libcolor/simplify/cube_cover.h"

namespace voxkit::color {
namespace {

/// Gathers cubes, until there is work for all threads, and simplifies them.
class Cubes {
 public:
  Cubes(const VolumeInfo& info, size_t attribute_bytes, int squared, const SurfaceSource::Sink& sink,
        Context& ctx)
      : dims_(info.dims), attribute_bytes_(attribute_bytes), sink_(sink), ctx_(ctx) {
    covers_.reserve(static_cast<size_t>(ctx.threads));
    for (int i = 0; i < ctx.threads; ++i) covers_.emplace_back(squared);
  }
  static uint64_t bytes(size_t attribute_bytes, int squared, int threads) {
    const auto count = static_cast<uint64_t>(threads);
    // As they come, and what is made of them.
    return count * CubeCover::bytes(squared) +
           2 * (count * batch_voxels + cube_voxels) * (sizeof(SurfaceVoxel) + attribute_bytes);
  }

  Status add(const VoxelRun& run) {
    for (size_t i = 0; i < run.voxels.size(); ++i) {
      const SurfaceVoxel& voxel = run.voxels[i];
      if (voxels_.empty() || (voxel.place ^ voxels_.back().place) >= cube_voxels) {
        if (voxels_.size() >= batch_voxels * covers_.size()) VOX_CHECK(flush());
        starts_.push_back(voxels_.size());
      }
      voxels_.push_back(voxel);
      const auto own = run.attributes.subspan(i * attribute_bytes_, attribute_bytes_);
      attributes_.insert(attributes_.end(), own.begin(), own.end());
    }
    return {};
  }
  Status flush() {
    const size_t count = starts_.size();
    starts_.push_back(voxels_.size());
    if (made_.size() < count) made_.resize(count);
    std::atomic<size_t> next = 0;
    VOX_CHECK(parallel_for(ctx_, static_cast<int64_t>(covers_.size()), [&](int64_t thread) -> Status {
      for (size_t cube; (cube = next++) < count;) {
        VOX_CHECK(check_interrupt());
        const size_t from = starts_[cube], size = starts_[cube + 1] - from;
        const std::span<const SurfaceVoxel> voxels(&voxels_[from], size);
        const std::span<const std::byte> attributes(attributes_.data() + from * attribute_bytes_,
                                                    size * attribute_bytes_);
        covers_[static_cast<size_t>(thread)].cover({voxels, attributes}, attribute_bytes_, dims_,
                                                   made_[cube]);
      }
      return {};
    }));
    for (size_t cube = 0; cube < count; ++cube)
      VOX_CHECK(sink_(VoxelRun(made_[cube].voxels, made_[cube].attributes)));
    starts_.clear();
    voxels_.clear();
    attributes_.clear();
    return {};
  }

 private:
  static constexpr uint64_t cube_voxels = uint64_t{1} << 3 * cover_bits, batch_voxels = 1 << 16;

  Index3 dims_;
  size_t attribute_bytes_;
  const SurfaceSource::Sink& sink_;
  Context& ctx_;
  std::vector<CubeCover> covers_;  ///< one a thread
  std::vector<SurfaceVoxel> voxels_;
  std::vector<std::byte> attributes_;
  std::vector<size_t> starts_;  ///< of cubes
  std::vector<CubeCover::Voxels> made_;
};

}  // namespace

SimplifiedSurface::SimplifiedSurface(SurfaceSource& source, double distance, Sink exact)
    : source_(source), squared_(squared_of(distance)), exact_(std::move(exact)) {
  info_ = source.info();
  notes_ = source.notes();
  emits_ = source.emits();
  attributes_ = source.attributes();
}

Status SimplifiedSurface::read(Context& ctx, const Sink& sink) {
  const auto exact = [&](const VoxelRun& run) { return exact_ ? exact_(run) : Status(); };
  if (squared_ == 0)  // no voxel is nearer to another one
    return source_.read(ctx, [&](const VoxelRun& run) -> Status {
      VOX_CHECK(exact(run));
      return sink(run);
    });
  const size_t attribute_bytes = attributes_.bytes();
  VOX_TRY(const Reservation memory,
          Reservation::take(Cubes::bytes(attribute_bytes, squared_, ctx.threads), "simplifying", ctx));
  Cubes cubes(info_, attribute_bytes, squared_, sink, ctx);
  VOX_CHECK(source_.read(ctx, [&](const VoxelRun& run) -> Status {
    VOX_CHECK(exact(run));
    return cubes.add(run);
  }));
  return cubes.flush();
}

}  // namespace voxkit::color
