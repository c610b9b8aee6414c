// Which greatest error makes the smallest file, of those up to the one that is allowed.
#pragma once

#include "libvq/vq.h"

namespace voxkit::vq {

/// RBUC spends whole bits, so a larger step of the quantiser can take more bytes than a smaller one: codes
/// that need one value more than a power of two. Returns the error, at most `most` and above 0, whose steps
/// take the fewest bytes in a sample of bricks, chosen from a fixed scale (whole numbers up to 32, then
/// sixteenths of an octave; of FLOAT32 the latter throughout), so that a looser bound never asks for more
/// bytes. `most` itself where the scale has nothing that is possible. `options`: all but max_error. A
/// forward-only source is used up. Errors: those of the source, ErrorCode::limit.
Result<double> smallest_error_step(VolumeSource& source, double most, const Options& options, Context& ctx);

}  // namespace voxkit::vq
