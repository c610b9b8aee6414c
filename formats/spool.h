// Random access to what can only be read front to back.
#pragma once

#include <memory>

#include "formats/context.h"
#include "formats/mapped_file.h"
#include "formats/source.h"

namespace voxkit {

/// A volume that is written slice by slice, from the first to the last, into an unlinked temporary file
/// ($TMPDIR, default /tmp), and then read in any order.
class VolumeSpool {
 public:
  explicit VolumeSpool(const VolumeInfo& info) : info_(info), file_("the decoded volume") {}
  /// Voxels of whole slices, packed. Errors: ErrorCode::output where there is no room.
  Status write(std::span<const std::byte> slices) { return file_.write(slices); }
  /// After the last slice.
  Result<std::unique_ptr<VolumeSource>> finish();

 private:
  VolumeInfo info_;
  TemporaryFile file_;
};

/// The voxels of a source, read once, slab by slab, into an unlinked temporary file ($TMPDIR, default /tmp).
/// A source that is not forward-only is returned as it is. Errors: those of the source; ErrorCode::output
/// where there is no room.
Result<std::unique_ptr<VolumeSource>> spooled(std::unique_ptr<VolumeSource> source, Context& ctx);

}  // namespace voxkit
