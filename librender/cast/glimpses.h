// Levels of detail of surfaces: where the cells that pixels see of them are kept.
#pragma once

#include "formats/copy.h"
#include "libcolor/color.h"
#include "librender/cast/cast_params.h"

namespace voxkit::render {

/// A camera before a surface: with levels of detail only where inner nodes have colours.
Result<CastParams> surface_params(const color::Volume& volume, const Camera& camera,
                                  const CastOptions& options);

/// How many a picture has.
constexpr uint64_t glimpse_count(const CastParams& params) {
  return static_cast<uint64_t>(params.width) * static_cast<uint64_t>(params.height) * Beam::most_cells;
}
/// Memory for them, if the picture has levels of detail; else null. It counts against ctx.memory.
Result<std::unique_ptr<Buffer>> hold_glimpses(const CastParams& params, Context& ctx);
/// What is in it.
inline Glimpse* glimpses_in(const std::unique_ptr<Buffer>& buffer) {
  return buffer ? reinterpret_cast<Glimpse*>(buffer->data()) : nullptr;
}

}  // namespace voxkit::render
