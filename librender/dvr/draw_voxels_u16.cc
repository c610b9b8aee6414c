#include "librender/dvr/draw_voxels.h"

namespace voxkit::render {

template Status draw_voxels<uint16_t>(const DenseGrid&, const DvrJob&, Frame&, Context&);

}  // namespace voxkit::render
