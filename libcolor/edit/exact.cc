#include "libcolor/edit/exact.h"

namespace voxkit::color {

Options exact_options(std::span<const Params> files) {
  const Params& first = files.front();
  Options options;
  options.colors = first.colors;
  options.counts = first.counts;
  // An ssvdag stays the choice of the encoder, as the result may be too large for one.
  if (first.geometry != Geometry::ssvdag) options.geometry = first.geometry;
  options.curve = first.curve;
  options.image_curve = first.image_curve;
  options.codec = ColorCodec::vws;
  options.threshold = 0;
  options.attribute_thresholds.fill(0);
  if (first.codec == ColorCodec::raw || first.codec == ColorCodec::png || first.codec == ColorCodec::jp2 ||
      first.codec == ColorCodec::predicted)
    options.codec = first.codec;
  // With as many colours as all palettes have, each is one of the new palette. Those of nodes are new.
  uint64_t colors = 0;
  bool palettes = first.colors == Colors::leaf;
  for (const Params& file : files) {
    palettes = palettes && file.codec == ColorCodec::palette;
    colors += file.palette_colors;
  }
  if (palettes && colors >= 1 && colors <= most_palette_colors) {
    options.codec = ColorCodec::palette;
    options.palette = static_cast<uint32_t>(colors);
  }
  return options;
}

}  // namespace voxkit::color
