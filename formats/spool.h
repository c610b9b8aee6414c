// Random access to what can only be read front to back.
#pragma once

#include <memory>

#include "formats/context.h"
#include "formats/source.h"

namespace voxkit {

/// The voxels of a source, read once, slab by slab, into an unlinked temporary file ($TMPDIR, default /tmp).
/// A source that is not forward-only is returned as it is. Errors: those of the source; ErrorCode::output
/// where there is no room.
Result<std::unique_ptr<VolumeSource>> spooled(std::unique_ptr<VolumeSource> source, Context& ctx);

}  // namespace voxkit
