#include "tools/common/surface_input.h"

#include "libcolor/volume_surface.h"

namespace voxkit::cli {

Result<std::unique_ptr<color::SurfaceSource>> open_surface(const std::string& name,
                                                           const SurfaceOptions& options, Context& ctx) {
  VOX_TRY(Input input, open_input(name, options.open, ctx));
  auto surface = color::surface_of(std::move(input.source));
  if (!surface) return fail(surface.error().code, name, surface.error().what);
  return surface;
}

}  // namespace voxkit::cli
