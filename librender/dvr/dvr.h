// Direct volume rendering, from uncompressed and from compressed volumes (Guthe and Goesele 2016, section 5).
#pragma once

#include <memory>

#include "librender/camera.h"
#include "librender/cast/ray_cast.h"
#include "librender/dvr/brick_ranges.h"
#include "librender/dvr/transfer.h"

namespace voxkit::render {

/// A scalar volume that is ready to be drawn: the voxels, or the file, and the ranges of its bricks.
class DvrVolume {
 public:
  /// Errors: ErrorCode::input where voxels are colours or a file is damaged; ErrorCode::limit.
  static Result<DvrVolume> open(std::shared_ptr<const DenseGrid> grid, Context& ctx);
  static Result<DvrVolume> open(std::shared_ptr<const svmm::Volume> volume, Context& ctx);
  static Result<DvrVolume> open(std::shared_ptr<const vq::Volume> volume, Context& ctx);
  /// The finest level that is there. Where the file does not say which values its pages have, decodes all of
  /// them.
  static Result<DvrVolume> open(std::shared_ptr<const svmm::PackedVolume> volume, Context& ctx);

  const VolumeInfo& info() const { return info_; }
  const BrickRanges& ranges() const { return ranges_; }

  // One of them.
  const std::shared_ptr<const DenseGrid>& dense() const { return dense_; }
  const std::shared_ptr<const svmm::Volume>& svmm() const { return svmm_; }
  const std::shared_ptr<const vq::Volume>& vq() const { return vq_; }
  const std::shared_ptr<const svmm::PackedVolume>& packed() const { return packed_; }

 private:
  DvrVolume(const VolumeInfo& info, BrickRanges ranges) : info_(info), ranges_(std::move(ranges)) {}
  VolumeInfo info_;
  BrickRanges ranges_;
  std::shared_ptr<const DenseGrid> dense_;
  std::shared_ptr<const svmm::Volume> svmm_;
  std::shared_ptr<const vq::Volume> vq_;
  std::shared_ptr<const svmm::PackedVolume> packed_;
};

/// Where gradients come from. analytic: the trilinear cell of a sample. neighbour: the samples of
/// neighbouring rays and of the next depth, as published; where these determine none, the cell.
enum class Gradient { analytic, neighbour };

inline constexpr double least_step = 0.001, greatest_step = 1000;

struct DvrOptions {
  int width = 1024, height = 768;
  double step = 0.25;  ///< depth from sample to sample, in smallest voxel edges; least_step .. greatest_step
  Gradient gradient = Gradient::analytic;
  bool lit = true;  ///< Blinn-Phong, the light over the viewer's left shoulder
  /// Opacity is multiplied by this times the length of the gradient (in widths of the transfer function, by
  /// smallest voxel edge), up to 1. 0: it is not.
  double modulate = 0;
  bool skip = true;      ///< do not sample where nothing can be seen. The picture is the same
  bool native = true;    ///< AVX2 where there is. The picture is the same
  bool details = false;  ///< fill Frame::details: where the first sample that was seen is, samples as cells
};

/// A volume seen through a transfer function, for any number of pictures.
class DvrScene {
 public:
  /// Of a packed volume, decodes the pages that the transfer function may show.
  static Result<DvrScene> create(std::shared_ptr<const DvrVolume> volume, TransferFunction transfer,
                                 Context& ctx);
  /// Samples on planes that are equally far apart, trilinear between voxel centres and clamped at the
  /// volume's edges, classified, lit, and blended front to back, the opacity being that of the true way from
  /// sample to sample; a ray ends at an opacity of 0.995. The pixels do not depend on ctx.threads,
  /// options.skip and options.native, nor on how the volume is held; the counts not on ctx.threads. `frame`
  /// is overwritten; its memory is used again. Errors: ErrorCode::usage where a ray would need more than 2^23
  /// samples; ErrorCode::input of a damaged file; ErrorCode::limit.
  Status draw(const Camera& camera, const DvrOptions& options, Frame& frame, Context& ctx) const;

  const DvrVolume& volume() const { return *volume_; }
  const TransferFunction& transfer() const { return transfer_; }
  const BrickSkips& skips() const { return skips_; }
  /// Bricks that samples may show.
  int64_t visible_bricks() const { return skips_.visible(); }
  /// Of a packed volume, those decoded for this, before any picture.
  uint64_t pages_decoded() const { return pages_decoded_; }

 private:
  DvrScene(std::shared_ptr<const DvrVolume> volume, TransferFunction transfer, BrickSkips skips,
           uint64_t pages)
      : volume_(std::move(volume)),
        transfer_(std::move(transfer)),
        skips_(std::move(skips)),
        pages_decoded_(pages) {}
  std::shared_ptr<const DvrVolume> volume_;
  TransferFunction transfer_;
  BrickSkips skips_;
  uint64_t pages_decoded_;
};

}  // namespace voxkit::render
