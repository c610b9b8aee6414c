// How to store colours that have been decoded so that they stay what they are.
#pragma once

#include <span>

#include "libcolor/params.h"

namespace voxkit::color {

/// Options with which the colours and attributes of files with these parameters are stored exactly, as much
/// as can be as the first file has them: its curves, its counts, its geometry, colours of nodes if it has
/// them; its codec if that can be lossless: raw, png, jp2, and palette if all of them are and their palettes
/// have no more than 2^16 colours together. Else blocks of variable weights with a threshold of 0.
Options exact_options(std::span<const Params> files);

}  // namespace voxkit::color
