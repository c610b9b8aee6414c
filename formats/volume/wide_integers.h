// Integers of 32 and 64 bits in voxels of 8 and 16: exactly, by a base or a table of the values that there
// are.
#pragma once

#include <span>

#include "formats/context.h"
#include "formats/volume.h"
#include "formats/volume/open_volume.h"

namespace voxkit {

/// Reads the samples (of info.sample_type, which is wide; in the byte order given) once or twice, and decides
/// how `info`, which says FLOAT32, is to hold them:
/// - values that are at most 65535 apart: DENSITY8 or DENSITY16 and `wide_base`, the least;
/// - at most 65536 different ones: these formats and `labels`;
/// - all between -2^24 and 2^24, which FLOAT32 holds exactly: as it is.
/// Errors: ErrorCode::input, naming `file` and the values, for all others, unless `round` allows FLOAT32 to
/// round them (which it then says by ctx.note and info.rounded). Memory: some megabytes a thread.
Status fit_wide_integers(std::span<const std::byte> samples, bool big_endian, bool round,
                         const std::string& file, VolumeInfo& info, Context& ctx);

/// Converts `count` wide samples to voxels of a volume that was fitted, and back to little-endian samples.
/// The latter is for any volume whose sample_type is wide: FLOAT32 is rounded to the nearest integer of the
/// type (NaN becomes 0), stored values beyond the table of labels become its last one.
void from_wide(const std::byte* in, bool big_endian, int64_t count, const VolumeInfo& info, std::byte* out);
void to_wide(const std::byte* in, int64_t count, const VolumeInfo& info, std::byte* out);

}  // namespace voxkit
