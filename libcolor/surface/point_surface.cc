#include "libcolor/surface/point_surface.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/matrix.hpp>
#include <queue>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/reservation.h"
#include "libcolor/surface/attribute_choice.h"
#include "libcolor/surface/morton.h"
#include "libcolor/surface/point_means.h"
#include "libcolor/surface/voxel_means.h"
#include "libcolor/surface/voxelise.h"

namespace voxkit::color {
namespace {

template <class Point>
bool by_place(const Point& a, const Point& b) {
  return a.place < b.place;
}

/// Sorted parts, one after the other, in an unlinked file. Points are in the grid, a place each.
template <class Point>
class PartFile {
 public:
  using Part = std::span<const Point>;
  Status add(Part part) {
    VOX_CHECK(writer_.write(std::as_bytes(part)));
    sizes_.push_back(part.size());
    return {};
  }
  bool empty() const { return sizes_.empty(); }
  /// All of them, sorted.
  template <class Means>
  Status merge(Means& means) {
    VOX_TRY(const auto file, writer_.map());
    const auto* at = reinterpret_cast<const Point*>(file->bytes().data());
    struct Rest {
      Part part;
      const Point* released;  ///< what is before has left this process
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

/// Where points are in a grid.
struct PointGrid {
  glm::dvec3 corner{0};    ///< of the first voxel
  glm::dmat3 turned{1.0};  ///< to the axes of voxels
  double edge = 1;         ///< of a voxel, along these

  static PointGrid of(const VolumeInfo& info) {
    const Affine& affine = info.affine;
    const Affine::Vector corner = affine.place({-0.5, -0.5, -0.5});
    glm::dmat3 axes;
    for (int i = 0; i < 3; ++i)
      for (int c = 0; c < 3; ++c) axes[i][c] = affine.axes[static_cast<size_t>(i)][static_cast<size_t>(c)];
    return {{corner[0], corner[1], corner[2]}, glm::inverse(axes)};
  }
  /// In voxels from the corner.
  glm::dvec3 index_of(const glm::dvec3& at) const { return turned * (at - corner) / edge; }
};

class PointSurface final : public SurfaceSource {
 public:
  PointSurface(std::unique_ptr<const PointCloud> points, VolumeInfo info, const PointGrid& grid,
               std::vector<std::string> notes, AttributeSet attributes)
      : points_(std::move(points)), grid_(grid) {
    info_ = std::move(info);
    notes_ = std::move(notes);
    attributes_ = attributes;
    info_.format = VoxelFormat::rgba32;
  }

  Status read(Context& ctx, const Sink& sink) override {
    if (attributes_.empty()) {
      VoxelMeans means(sink);
      return read_points<SurfaceVoxel>(
          [](uint64_t place, const CloudPoint& point) -> SurfaceVoxel {
            return {place, {point.color[0], point.color[1], point.color[2]}};
          },
          means, ctx);
    }
    PointMeans means(sink, attributes_);
    const bool opacity = attributes_.has(Attribute::opacity);
    return read_points<AttributedPoint>(
        [&](uint64_t place, const CloudPoint& point) { return AttributedPoint(place, point, opacity); },
        means, ctx);
  }

 private:
  /// `make(place, point)` makes what is sorted.
  template <class Point, class Make, class Means>
  Status read_points(const Make& make, Means& means, Context& ctx) {
    const uint64_t most = std::clamp<uint64_t>(ctx.memory->limit() / 4 / sizeof(Point), 1 << 14,
                                               std::max<uint64_t>(points_->size(), 1 << 14));
    VOX_TRY(const Reservation memory,
            Reservation::take(std::min(most, points_->size()) * sizeof(Point), "points, sorted", ctx));
    std::vector<Point> part;
    part.reserve(std::min(most, points_->size()));
    PartFile<Point> parts;
    uint64_t read = 0;
    VOX_CHECK(points_->read([&](std::span<const CloudPoint> run) -> Status {
      for (const CloudPoint& point : run) {
        if (part.size() == most) {
          std::sort(part.begin(), part.end(), by_place<Point>);
          VOX_CHECK(parts.add(part));
          part.clear();
        }
        part.push_back(make(place_of(point), point));
      }
      read += run.size();
      ctx.progress(static_cast<double>(read) / static_cast<double>(points_->size()));
      return {};
    }));
    std::sort(part.begin(), part.end(), by_place<Point>);
    if (parts.empty()) {
      for (const Point& point : part) VOX_CHECK(means.add(point));
    } else {
      VOX_CHECK(parts.add(part));
      VOX_CHECK(parts.merge(means));
    }
    return means.finish();
  }

  uint64_t place_of(const CloudPoint& point) const {
    uint32_t at[3];
    const glm::dvec3 index = grid_.index_of(point.at);
    for (int a = 0; a < 3; ++a)
      at[a] = static_cast<uint32_t>(
          std::clamp<int64_t>(static_cast<int64_t>(std::floor(index[a])), 0, info_.dims[a] - 1));
    return morton_code(at[0], at[1], at[2]);
  }

  std::unique_ptr<const PointCloud> points_;
  PointGrid grid_;
};

/// Whether all points are in voxels of their own grid.
Result<bool> are_inside(const PointCloud& points, const VolumeInfo& own) {
  const PointGrid grid = PointGrid::of(own);
  bool inside = true;
  VOX_CHECK(points.read([&](std::span<const CloudPoint> run) -> Status {
    for (const CloudPoint& point : run) {
      const glm::dvec3 index = grid.index_of(point.at);
      for (int a = 0; a < 3; ++a)  // written so that what is no number is outside
        inside &= index[a] >= 0 && index[a] < static_cast<double>(own.dims[a]);
    }
    return {};
  }));
  return inside;
}

}  // namespace

Result<std::unique_ptr<SurfaceSource>> surface_of_points(std::unique_ptr<const PointCloud> points,
                                                         std::optional<int64_t> asked, Context&,
                                                         const std::optional<AttributeSet>& wanted) {
  const int64_t resolution = asked.value_or(default_resolution);
  if (resolution < 1 || resolution > int64_t{1} << most_levels)
    return bad_usage(
        fmt::format("a resolution of {}: expected 1 to {}", resolution, int64_t{1} << most_levels));
  glm::dvec3 lo(INFINITY), hi(-INFINITY);
  uint64_t seen = 0, bare = 0;
  bool faint = false, shining = false;
  VOX_CHECK(points->read([&](std::span<const CloudPoint> run) -> Status {
    seen += run.size();
    for (const CloudPoint& point : run) {
      faint |= point.alpha != 255;
      const float length = glm::length(point.normal);
      bare += length > 0 && std::isfinite(length) ? 0 : 1;
      shining |= point.emission != std::array<uint8_t, 3>{};
      for (int a = 0; a < 3; ++a) {
        lo[a] = std::min(lo[a], point.at[a]);
        hi[a] = std::max(hi[a], point.at[a]);
      }
    }
    return {};
  }));
  if (seen == 0) return bad_input({}, "no points that are at finite coordinates and at least half opaque");
  const PointExtras& has = points->has();
  AttributeSet can, by_itself;
  add_if(can, Attribute::emissive, has.emission);
  add_if(can, Attribute::opacity, has.alpha);
  add_if(can, Attribute::normal, has.normals);
  add_if(can, Attribute::rm, has.rm);
  add_if(can, Attribute::id, has.labels);
  add_if(by_itself, Attribute::emissive, shining);
  add_if(by_itself, Attribute::opacity, has.alpha && faint);
  VOX_TRY(const AttributeSet attributes, choose_attributes(wanted, can, by_itself));
  std::vector<std::string> notes = points->notes();
  if (seen < points->size())
    notes.push_back(
        fmt::format("{} of {} points are dropped: they are at coordinates that are not finite, or less "
                    "than half opaque",
                    points->size() - seen, points->size()));
  if (attributes.has(Attribute::normal) && bare > 0)
    notes.push_back(fmt::format(
        "{} of {} points have a normal of 0, or none of numbers: a voxel of such points alone has 0, 0, 1",
        bare, seen));
  if (const auto& own = points->grid()) {
    const std::string sides = fmt::format("{} x {} x {}", own->dims.x, own->dims.y, own->dims.z);
    VOX_TRY(const bool inside, are_inside(*points, *own));
    if (!inside)
      notes.push_back(fmt::format("their grid of {} voxels is not around all of them: dropped", sides));
    if (inside && (!asked || *asked == std::max({own->dims.x, own->dims.y, own->dims.z}))) {
      notes.push_back(fmt::format("points of voxels: their own grid of {} is taken", sides));
      const VolumeInfo info = *own;
      return std::make_unique<PointSurface>(std::move(points), info, PointGrid::of(info), std::move(notes),
                                            attributes);
    }
  }
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
  const PointGrid grid{.corner = lo, .edge = edge};
  return std::make_unique<PointSurface>(std::move(points), std::move(info), grid, std::move(notes),
                                        attributes);
}

}  // namespace voxkit::color
