#include "librender/dvr/draw_bricks.h"

namespace voxkit::render {

template Status draw_bricks<float>(const DvrVolume&, const DvrJob&, Frame&, Context&);

}  // namespace voxkit::render
