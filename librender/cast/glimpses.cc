#include "librender/cast/glimpses.h"

namespace voxkit::render {

Result<CastParams> surface_params(const color::Volume& volume, const Camera& camera,
                                  const CastOptions& options) {
  CastOptions possible = options;
  possible.level_of_detail &= volume.params().colors == color::Colors::all;
  return cast_params(volume.info(), camera, possible);
}

Result<std::unique_ptr<Buffer>> hold_glimpses(const CastParams& params, Context& ctx) {
  if (params.cone == 0) return nullptr;
  return Buffer::allocate(glimpse_count(params) * sizeof(Glimpse), "what pixels see of coarse cells", ctx);
}

}  // namespace voxkit::render
