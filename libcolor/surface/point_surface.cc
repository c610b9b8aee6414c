#include "libcolor/surface/point_surface.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <queue>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/reservation.h"
#include "libcolor/surface/morton.h"
#include "libcolor/surface/voxel_means.h"

namespace voxkit::color {
namespace {

/// Points in the grid, a voxel each.
using Part = std::span<const SurfaceVoxel>;

bool by_place(const SurfaceVoxel& a, const SurfaceVoxel& b) {
  return a.place < b.place;
}

/// Sorted parts, one after the other, in an unlinked file.
class PartFile {
 public:
  Status add(Part part) {
    VOX_CHECK(writer_.write(std::as_bytes(part)));
    sizes_.push_back(part.size());
    return {};
  }
  bool empty() const { return sizes_.empty(); }
  /// All of them, sorted.
  Status merge(VoxelMeans& means) {
    VOX_TRY(const auto file, writer_.map());
    const auto* at = reinterpret_cast<const SurfaceVoxel*>(file->bytes().data());
    struct Rest {
      Part part;
      const SurfaceVoxel* released;  ///< what is before has left this process
    };
    const auto later = [](const Rest& a, const Rest& b) {
      return a.part.front().place > b.part.front().place;
    };
    std::priority_queue<Rest, std::vector<Rest>, decltype(later)> rests(later);
    for (const uint64_t size : sizes_) {
      rests.push({{at, size}, at});
      at += size;
    }
    while (!rests.empty()) {
      auto [part, released] = rests.top();
      rests.pop();
      // As long as it is that of the least places.
      const uint64_t end = rests.empty() ? ~uint64_t{0} : rests.top().part.front().place;
      do {
        VOX_CHECK(means.add(part.front()));
        part = part.subspan(1);
      } while (!part.empty() && part.front().place <= end);
      if (part.empty() || part.data() - released >= release_step) {
        release_bytes(std::as_bytes(std::span(released, part.data())));
        released = part.data();
      }
      if (!part.empty()) rests.push({part, released});
    }
    return {};
  }

 private:
  static constexpr ptrdiff_t release_step = 1 << 16;
  TemporaryFile writer_{"points"};
  std::vector<uint64_t> sizes_;
};

class PointSurface final : public SurfaceSource {
 public:
  PointSurface(std::unique_ptr<const PointCloud> points, VolumeInfo info, const glm::dvec3& lo,
               std::vector<std::string> notes)
      : points_(std::move(points)), lo_(lo), edge_(info.affine.axes[0][0]) {
    info_ = std::move(info);
    notes_ = std::move(notes);
    info_.format = VoxelFormat::rgba32;
  }

  Status read(Context& ctx, const Sink& sink) override {
    const uint64_t most = std::clamp<uint64_t>(ctx.memory->limit() / 4 / sizeof(SurfaceVoxel), 1 << 14,
                                               std::max<uint64_t>(points_->size(), 1 << 14));
    VOX_TRY(const Reservation memory,
            Reservation::take(std::min(most, points_->size()) * sizeof(SurfaceVoxel), "points, sorted", ctx));
    std::vector<SurfaceVoxel> part;
    part.reserve(std::min(most, points_->size()));
    PartFile parts;
    uint64_t read = 0;
    VOX_CHECK(points_->read([&](std::span<const CloudPoint> run) -> Status {
      for (const CloudPoint& point : run) {
        if (part.size() == most) {
          std::sort(part.begin(), part.end(), by_place);
          VOX_CHECK(parts.add(part));
          part.clear();
        }
        part.push_back({place_of(point), {point.color[0], point.color[1], point.color[2]}});
      }
      read += run.size();
      ctx.progress(static_cast<double>(read) / static_cast<double>(points_->size()));
      return {};
    }));
    std::sort(part.begin(), part.end(), by_place);
    VoxelMeans means(sink);
    if (parts.empty()) {
      for (const SurfaceVoxel& point : part) VOX_CHECK(means.add(point));
    } else {
      VOX_CHECK(parts.add(part));
      VOX_CHECK(parts.merge(means));
    }
    return means.finish();
  }

 private:
  uint64_t place_of(const CloudPoint& point) const {
    uint32_t at[3];
    for (int a = 0; a < 3; ++a)
      at[a] = static_cast<uint32_t>(std::clamp<int64_t>(
          static_cast<int64_t>(std::floor((point.at[a] - lo_[a]) / edge_)), 0, info_.dims[a] - 1));
    return morton_code(at[0], at[1], at[2]);
  }

  std::unique_ptr<const PointCloud> points_;
  glm::dvec3 lo_;
  double edge_;  ///< of a voxel
};

}  // namespace

Result<std::unique_ptr<SurfaceSource>> surface_of_points(std::unique_ptr<const PointCloud> points,
                                                         int64_t resolution, Context&) {
  if (resolution < 1 || resolution > int64_t{1} << most_levels)
    return bad_usage(
        fmt::format("a resolution of {}: expected 1 to {}", resolution, int64_t{1} << most_levels));
  glm::dvec3 lo(INFINITY), hi(-INFINITY);
  uint64_t seen = 0;
  VOX_CHECK(points->read([&](std::span<const CloudPoint> run) -> Status {
    seen += run.size();
    for (const CloudPoint& point : run)
      for (int a = 0; a < 3; ++a) {
        lo[a] = std::min(lo[a], point.at[a]);
        hi[a] = std::max(hi[a], point.at[a]);
      }
    return {};
  }));
  if (seen == 0) return bad_input({}, "no points that are at finite coordinates and at least half opaque");
  std::vector<std::string> notes = points->notes();
  if (seen < points->size())
    notes.push_back(
        fmt::format("{} of {} points are dropped: they are at coordinates that are not finite, or less "
                    "than half opaque",
                    points->size() - seen, points->size()));
  const double longest = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z});
  const double edge = longest > 0 ? longest / static_cast<double>(resolution) : 1;
  VolumeInfo info;
  for (int a = 0; a < 3; ++a) {
    const auto axis = static_cast<size_t>(a);
    info.dims[a] =
        std::clamp<int64_t>(static_cast<int64_t>(std::floor((hi[a] - lo[a]) / edge)) + 1, 1, resolution);
    info.affine.axes[axis][axis] = edge;
    info.affine.origin[axis] = lo[a] + edge / 2;
  }
  return std::make_unique<PointSurface>(std::move(points), std::move(info), lo, std::move(notes));
}

}  // namespace voxkit::color
