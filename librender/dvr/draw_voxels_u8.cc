#include "librender/dvr/draw_voxels.h"

namespace voxkit::render {

template Status draw_voxels<uint8_t>(const DenseGrid&, const DvrJob&, Frame&, Context&);

}  // namespace voxkit::render
