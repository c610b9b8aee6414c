#include "libvq/quantise.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "libvq/layout.h"

namespace voxkit::vq {
namespace {

bool holds_integers(SampleType type) {
  return type != SampleType::f32 && type != SampleType::f64 && type != SampleType::f16;
}

/// Values of the volume, in an integer format.
int stored_values(VoxelFormat format) {
  return format == VoxelFormat::density16 ? 65536 : format == VoxelFormat::bitmap ? 2 : 256;
}

}  // namespace

Result<Quantiser> Quantiser::make(const Options& options, const VolumeInfo& info) {
  Quantiser q;
  q.format_ = info.format;
  if (info.format != VoxelFormat::float32) {
    const auto error = static_cast<int64_t>(std::min(std::floor(options.max_error.value_or(0)), 65535.0));
    if (error == 0) return q;
    // Aligned so that the sample 0 is exact: it is often void.
    const int64_t step = 2 * error + 1, shift = (step - info.bias() % step) % step;
    q.step_ = static_cast<double>(step);
    q.origin_ = static_cast<double>(-shift);
    q.bound_ = static_cast<double>(error);
    const int64_t values = stored_values(info.format);
    for (int64_t v = 0; v < values; ++v)
      q.code_of_.push_back(static_cast<uint16_t>((v + shift + error) / step));
    if (info.fill && *info.fill >= 0 && *info.fill < static_cast<double>(values)) {
      q.special_ = static_cast<uint16_t>(q.code_of_.back() + 1);  // error is at least 1: there is room
      q.code_of_[static_cast<size_t>(*info.fill)] = *q.special_;
      q.fill_ = *info.fill;
    }
    return q;
  }
  const double lo = options.range.lo, hi = options.range.hi;
  q.lo_ = q.origin_ = lo;
  q.hi_ = hi;
  const double most_code = options.keep_nan ? 65534 : 65535;
  const auto set_special = [&] {
    if (options.keep_nan) q.special_ = static_cast<uint16_t>(std::floor((hi - lo) / q.step_ + 0.5) + 1);
  };
  const bool whole = holds_integers(info.sample_type) && hi - lo <= most_code;
  if (hi == lo || (whole && !options.max_error)) {  // codes that are exact
    q.bound_ = options.max_error.value_or(0);
    set_special();
    return q;
  }
  // Decoding rounds to a float: by so much at most.
  const double rounding = std::ldexp(std::max({std::abs(lo), std::abs(hi), 0x1p-126}), -24);
  if (options.max_error) {
    q.bound_ = *options.max_error;
    q.step_ = 2 * (q.bound_ - rounding) * (1 - 1e-12);
    if (!(q.step_ > 0) || (hi - lo) / q.step_ > most_code - 0.5)
      return bad_usage(
          fmt::format("--max-error {:.6g}: too small for 65536 levels of the values {:.6g} to {:.6g}: "
                      "expected {:.6g} or more",
                      *options.max_error, lo, hi, ((hi - lo) / (most_code - 1) / 2 + rounding) * (1 + 1e-9)));
    // The code nearest to the greatest value may stand for more than that, which floats hold less exactly, or
    // not at all: then steps are a little smaller, and the last one ends there.
    const double levels = (hi - lo) / q.step_, top = lo + q.step_ * std::floor(levels + 0.5);
    if (top > hi &&
        (top > std::numeric_limits<float>::max() || std::ldexp(1.0, std::ilogb(top) - 24) > rounding))
      q.step_ = (hi - lo) / std::ceil(levels);
  } else {
    q.step_ = (hi - lo) / most_code;
    q.bound_ = q.step_ / 2 * (1 + 1e-12) + rounding;
  }
  set_special();
  return q;
}

void Quantiser::codes(const std::byte* voxels, int64_t count, uint16_t* out, Loss& loss) const {
  if (format_ == VoxelFormat::float32) {
    const double levels = 1 / step_;
    for (int64_t i = 0; i < count; ++i) {
      float value;
      std::memcpy(&value, voxels + 4 * i, sizeof value);
      if (special_ && std::isnan(value)) {
        out[i] = *special_;
        continue;
      }
      // Not a number compares as false: it becomes the least value, like minus infinity.
      const double inside = value > lo_ ? std::min<double>(value, hi_) : lo_;
      out[i] = static_cast<uint16_t>(std::clamp(std::floor((inside - origin_) * levels + 0.5), 0.0, 65535.0));
      if (std::isfinite(value)) {
        const auto decoded = voxel_of(out[i], format_, origin_, step_).as<float>();
        loss.greatest_error = std::max(loss.greatest_error, std::abs(static_cast<double>(decoded) - value));
      } else {
        loss.replaced = true;
      }
    }
    return;
  }
  if (format_ == VoxelFormat::density16) {
    std::memcpy(out, voxels, static_cast<size_t>(count) * 2);
  } else {
    for (int64_t i = 0; i < count; ++i) out[i] = std::to_integer<uint16_t>(voxels[i]);
  }
  if (code_of_.empty()) return;
  const double most = stored_values(format_) - 1;
  for (int64_t i = 0; i < count; ++i) {
    const auto value = static_cast<double>(out[i]);
    out[i] = code_of_[out[i]];
    if (special_ && value == fill_) continue;
    const double decoded = std::clamp(origin_ + step_ * out[i], 0.0, most);
    loss.greatest_error = std::max(loss.greatest_error, std::abs(decoded - value));
  }
}

}  // namespace voxkit::vq
