#include "formats/fill.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <mutex>

#include "formats/copy.h"

namespace voxkit {
namespace {

constexpr double far_away = 1000;  // extents of all other values

/// A FLOAT32 source in which voxels of one kind become another value.
class ReplacingSource final : public VolumeSource {
 public:
  /// `lost_nan` is called once, when NaN are first met that are no more than `from` then.
  ReplacingSource(std::unique_ptr<VolumeSource> source, float from, float to, double fill,
                  std::function<void()> lost_nan = {})
      : source_(std::move(source)), from_(from), to_(to), lost_nan_(std::move(lost_nan)) {
    info_ = source_->info();
    info_.fill = fill;
  }
  bool forward_only() const override { return source_->forward_only(); }
  void expect(int64_t z0, int64_t z1) const override { source_->expect(z0, z1); }
  void release(int64_t z0, int64_t z1) const override { source_->release(z0, z1); }
  std::optional<Voxel> uniform(const Box& box) const override {
    const auto value = source_->uniform(box);
    return value ? std::optional(Voxel::of(replaced(value->as<float>()))) : std::nullopt;
  }
  Status read(const Box& box, VoxelSpan out) override {
    VOX_CHECK(source_->read(box, out));
    const Index3 size = box.size();
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y) {
        std::byte* const row = out.row(y, z);
        for (int64_t x = 0; x < size.x; ++x) {
          float value;
          std::memcpy(&value, row + 4 * x, 4);
          value = replaced(value);
          std::memcpy(row + 4 * x, &value, 4);
        }
      }
    return {};
  }

 private:
  /// NaN stands for any NaN.
  float replaced(float value) const {
    if (lost_nan_ && std::isnan(value)) std::call_once(said_, lost_nan_);
    return value == from_ || (std::isnan(value) && (std::isnan(from_) || std::isnan(to_))) ? to_ : value;
  }
  std::unique_ptr<VolumeSource> source_;
  float from_, to_;
  std::function<void()> lost_nan_;
  mutable std::once_flag said_;
};

/// Of an integer volume, whose voxels stay.
class NamedFillSource final : public VolumeSource {
 public:
  NamedFillSource(std::unique_ptr<VolumeSource> source, double fill) : source_(std::move(source)) {
    info_ = source_->info();
    info_.fill = fill;
  }
  bool forward_only() const override { return source_->forward_only(); }
  void expect(int64_t z0, int64_t z1) const override { source_->expect(z0, z1); }
  void release(int64_t z0, int64_t z1) const override { source_->release(z0, z1); }
  std::optional<Voxel> uniform(const Box& box) const override { return source_->uniform(box); }
  Status read(const Box& box, VoxelSpan out) override { return source_->read(box, out); }

 private:
  std::unique_ptr<VolumeSource> source_;
};

/// The two least and the two greatest different finite values.
struct Ends {
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  double least = infinity, second_least = infinity, greatest = -infinity, second_greatest = -infinity;
  bool has_nan = false;

  void add(double v) {
    if (v < second_least && v != least) {
      if (v < least)
        second_least = least, least = v;
      else
        second_least = v;
    }
    if (v > second_greatest && v != greatest) {
      if (v > greatest)
        second_greatest = greatest, greatest = v;
      else
        second_greatest = v;
    }
  }
  void merge(const Ends& e) {
    for (const double v : {e.least, e.second_least, e.greatest, e.second_greatest})
      if (std::isfinite(v)) add(v);
    has_nan |= e.has_nan;
  }
};

}  // namespace

std::unique_ptr<VolumeSource> with_fill(std::unique_ptr<VolumeSource> source, double fill,
                                        const std::function<void(const std::string&)>& note) {
  if (is_color(source->info().format)) return source;
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  if (source->info().format == VoxelFormat::float32) {
    std::function<void()> lost_nan;
    if (note && !std::isnan(fill))
      lost_nan = [note, fill] {
        note(fmt::format("voxels that are no number become the fill value, {:.9g}", fill));
      };
    return std::make_unique<ReplacingSource>(std::move(source), static_cast<float>(fill), nan, fill,
                                             std::move(lost_nan));
  }
  return std::make_unique<NamedFillSource>(std::move(source), fill);
}

std::unique_ptr<VolumeSource> fill_restored(std::unique_ptr<VolumeSource> source) {
  const VolumeInfo& info = source->info();
  if (info.format != VoxelFormat::float32 || !info.fill || std::isnan(*info.fill)) return source;
  const double fill = *info.fill;
  return std::make_unique<ReplacingSource>(std::move(source), std::numeric_limits<float>::quiet_NaN(),
                                           static_cast<float>(fill), fill);
}

Result<Census> take_census(VolumeSource& source, Context& ctx) {
  Ends all;
  std::mutex mutex;
  VOX_CHECK(visit_voxels(
      source,
      [&](ConstVoxelSpan voxels, Index3 size, int64_t) {
        Ends ends;
        for (int64_t z = 0; z < size.z; ++z)
          for (int64_t y = 0; y < size.y; ++y) {
            const std::byte* const row = voxels.row(y, z);
            for (int64_t x = 0; x < size.x; ++x) {
              float value;
              std::memcpy(&value, row + 4 * x, 4);
              if (std::isfinite(value))
                ends.add(static_cast<double>(value));
              else
                ends.has_nan |= std::isnan(value);
            }
          }
        std::lock_guard lock(mutex);
        all.merge(ends);
      },
      ctx));
  Census census;
  census.has_nan = all.has_nan;
  if (all.least > all.greatest) return census;
  census.range = census.rest = {all.least, all.greatest};
  const double low = all.second_greatest - all.least, high = all.greatest - all.second_least;
  if (low > 0 && all.greatest - all.second_greatest > far_away * low) {
    census.outlier = all.greatest;
    census.rest.hi = all.second_greatest;
  } else if (high > 0 && all.second_least - all.least > far_away * high) {
    census.outlier = all.least;
    census.rest.lo = all.second_least;
  }
  return census;
}

}  // namespace voxkit
