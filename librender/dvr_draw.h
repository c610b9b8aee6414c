// Drawing with one kind of sampler: tiles of pixels over threads.
#pragma once

#include "librender/dvr.h"
#include "librender/dvr_samplers.h"

namespace voxkit::render {

/// How a picture is drawn, but for where voxels come from.
struct DvrJob {
  DvrParams params;
  DvrGradient gradient;
  bool native, details;
  const TransferFunction* shown;  ///< null: values that cannot be seen are needed, too
};

/// Fills the pixels and counts of a frame whose size is set. `Sampler` is one of dvr_packet.h. Errors: those
/// of interrupts and memory.
Status draw_dense(const DenseGrid& grid, const DvrJob& job, DvrFrame& frame, Context& ctx);
template <class T>
Status draw_bricks(const DvrVolume& volume, const DvrJob& job, DvrFrame& frame, Context& ctx);

}  // namespace voxkit::render
