#include "formats/mesh/joined_points.h"

#include <utility>

namespace voxkit {
namespace {

class JoinedPoints final : public PointCloud {
 public:
  explicit JoinedPoints(std::vector<PlacedPoints> clouds) : clouds_(std::move(clouds)) {
    for (const PlacedPoints& cloud : clouds_) {
      size_ += cloud.points->size();
      const PointExtras& has = cloud.points->has();
      has_.alpha |= has.alpha;
      has_.normals |= has.normals;
      has_.rm |= has.rm;
      has_.labels |= has.labels;
      has_.emission |= has.emission;
      for (const std::string& note : cloud.points->notes()) notes_.push_back(cloud.prefix + note);
      if (clouds_.size() > 1 && cloud.points->grid())
        notes_.push_back(cloud.prefix + "its own grid of voxels is dropped: there is one around all inputs");
    }
    if (clouds_.size() > 1) return;
    grid_ = clouds_.front().points->grid();
    for (size_t c = 0; grid_ && c < 3; ++c)
      grid_->affine.origin[c] += clouds_.front().by[static_cast<glm::length_t>(c)];
  }
  Status read(const Sink& sink) const override {
    std::vector<CloudPoint> moved;
    for (const PlacedPoints& cloud : clouds_)
      VOX_CHECK(cloud.points->read([&](std::span<const CloudPoint> run) -> Status {
        moved.assign(run.begin(), run.end());
        for (CloudPoint& point : moved) point.at += cloud.by;
        return sink(moved);
      }));
    return {};
  }

 private:
  std::vector<PlacedPoints> clouds_;
};

}  // namespace

std::unique_ptr<const PointCloud> join_points(std::vector<PlacedPoints> clouds) {
  return std::make_unique<JoinedPoints>(std::move(clouds));
}

}  // namespace voxkit
