// Drawing with one kind of sampler: tiles of pixels over threads.
#pragma once

#include "librender/dvr/dvr_job.h"

namespace voxkit::render {

/// Fills the pixels and counts of a frame that was begun. Errors: those of interrupts and memory.
Status draw_dense(const DenseGrid& grid, const DvrJob& job, Frame& frame, Context& ctx);
template <class T>
Status draw_voxels(const DenseGrid& grid, const DvrJob& job, Frame& frame, Context& ctx);
template <class T>
Status draw_bricks(const DvrVolume& volume, const DvrJob& job, Frame& frame, Context& ctx);

}  // namespace voxkit::render
