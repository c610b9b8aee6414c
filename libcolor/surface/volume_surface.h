// A volume as a coloured surface: every voxel of it that is not void.
#pragma once

#include <memory>
#include <optional>

#include "formats/source.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// The voxels of an rgba32 volume with an alpha above 0, or of an rgb24 volume that are not black. Reads the
/// volume in cubes, those that are known to be void not at all. ErrorCode::input: it has no colours, a side
/// above 2^21, or can only be read front to back. Memory: a cube for each thread.
Result<std::unique_ptr<SurfaceSource>> surface_of(std::unique_ptr<VolumeSource> volume);

/// The same with what `wanted` says beside colours, which is opacity or nothing: the alpha of an rgba32
/// volume. Not said: opacity where some alpha is neither 0 nor 255; the volume is read once to know, up to
/// there. ErrorCode::usage for what a volume does not have.
Result<std::unique_ptr<SurfaceSource>> surface_of(std::unique_ptr<VolumeSource> volume,
                                                  const std::optional<AttributeSet>& wanted, Context& ctx);

}  // namespace voxkit::color
