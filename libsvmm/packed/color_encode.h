// The encoder of colours, which encode_packed takes for them.
#pragma once

#include "libsvmm/packed/packed.h"

namespace voxkit::svmm {

/// As encode_packed, of RGBA32 or RGB24, with options that it has checked. The bound is on the Euclidean
/// distance of two colours; alpha is lossless.
Result<PackedParams> encode_packed_colors(VolumeSource& source, const PackedOptions& options,
                                          const ByteSink& sink, Context& ctx);

}  // namespace voxkit::svmm
