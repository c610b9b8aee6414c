// A picture that is to be drawn by direct volume rendering, but for where voxels come from.
#pragma once

#include "librender/dvr/dvr.h"
#include "librender/dvr/dvr_packet.h"

namespace voxkit::render {

struct DvrJob {
  DvrParams params;
  DvrGradient gradient;
  bool native, details;
  const TransferFunction* shown;  ///< null: values that cannot be seen are needed, too
};

/// Its pointers are those of the scene. Errors: those of DvrScene::draw before it draws.
Result<DvrJob> dvr_job(const DvrScene& scene, const Camera& camera, const DvrOptions& options);
/// Sets the pixels of a frame that cannot see the volume.
Status blank_around(const DvrJob& job, Frame& frame, Context& ctx);
/// Whether rays may look into a volume in memory with 32-bit numbers of voxels.
bool is_direct(const VolumeInfo& info);

}  // namespace voxkit::render
