// From voxels to codes of up to 16 bits, and what is lost on the way.
#pragma once

#include <vector>

#include "libvq/vq.h"

namespace voxkit::vq {

/// What is lost on the way.
struct Loss {
  double greatest_error = 0;  ///< of finite samples
  bool replaced = false;      ///< there were samples that are no numbers, or infinite
};

/// How voxels of a volume become codes: the nearest multiple of a step from an origin.
class Quantiser {
 public:
  /// Codes are those of `Options::max_error`. ErrorCode::usage where 16 bits do not suffice for it.
  static Result<Quantiser> make(const Options& options, const VolumeInfo& info);

  /// Codes of a row of `count` voxels; `loss` becomes at least theirs.
  void codes(const std::byte* voxels, int64_t count, uint16_t* out, Loss& loss) const;

  /// A code stands for origin + step * code.
  double origin() const { return origin_; }
  double step() const { return step_; }
  /// The code of NaN, or of the fill value of integers; none where no code is set apart.
  std::optional<uint16_t> special() const { return special_; }
  /// The greatest error that a finite voxel may have.
  double bound() const { return bound_; }

 private:
  VoxelFormat format_{};
  double origin_ = 0, step_ = 1, bound_ = 0;
  std::optional<uint16_t> special_;
  double fill_ = 0;         ///< of integers with a special code: its stored value
  double lo_ = 0, hi_ = 0;  ///< FLOAT32: what is outside is brought to these
  std::vector<uint16_t>
      code_of_;  ///< of every stored value of an integer format; empty where nothing changes
};

}  // namespace voxkit::vq
