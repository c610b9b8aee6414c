// A volume as numbers of bricks and the bricks that they mean.
#pragma once

#include "libvq/codebook.h"
#include "libvq/offsets.h"
#include "libvq/quantise.h"

namespace voxkit::vq {

struct Collected {
  explicit Collected(Context& ctx) : codes(ctx), reservation(*ctx.memory) {}
  UniqueCodes codes;
  BrickNumbers numbers;  ///< into `codes`
  Loss loss;
  Reservation reservation;  ///< for the numbers
};

/// Cuts a volume into bricks, in one pass; those that reach over its end repeat its last voxels. Bricks are
/// numbered as they first come, block by block, so that places near to each other have numbers near to each
/// other. What the source knows to be uniform is not read. The result does not depend on ctx.threads.
Status collect(VolumeSource& source, const Quantiser& quantiser, Collected& out, Context& ctx);

}  // namespace voxkit::vq
