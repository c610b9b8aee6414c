#include "librender/cast/cast_translucent.h"

#include "librender/cast/cast_tile.h"
#include "librender/cast/surface_traits.h"
#include "librender/cast/translucent_view.h"

namespace voxkit::render {

Status cast_translucent(const color::Volume& volume, const color::DagView& dag, const CastParams& params,
                        const CastOptions& options, Frame& frame, Context& ctx) {
  const auto draw = [&](bool light, const CastOptions& how, Frame& to) -> Status {
    if (options.traversal == Traversal::restart)
      return cast_with(TranslucentView<Search::restart>{&volume, &dag, light}, params, how, to, ctx);
    return cast_with(TranslucentView<Search::path>{&volume, &dag, light}, params, how, to, ctx);
  };
  VOX_CHECK(draw(false, options, frame));
  VOX_CHECK(look_up_traits(volume, options.traits, false, frame, ctx));
  if (!frame.has.has(color::Attribute::emissive)) return volume.store().status();
  // Of light as of colours: what is behind shines through.
  CastOptions plain = options;
  plain.details = false;
  Frame lights;
  VOX_CHECK(draw(true, plain, lights));
  frame.seconds += lights.seconds;
  for (size_t i = 0; i < frame.traits.size(); ++i)
    for (int k = 0; k < 3; ++k) frame.traits[i].emissive[k] = lights.pixels[i].color[k];
  return volume.store().status();
}

}  // namespace voxkit::render
