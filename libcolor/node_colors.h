// Colours of nodes: the means of what is below them.
#pragma once

#include <span>
#include <vector>

#include "formats/context.h"
#include "formats/reservation.h"
#include "libcolor/dag.h"
#include "libcolor/surface.h"

namespace voxkit::color {

/// The colours of all cells of a DAG with Colors::all, in their order, from those of its voxels: a cell has
/// the mean of its voxels in linear light, rounded once. They count against `memory`.
Result<std::vector<Rgb>> node_colors(const Dag& dag, std::span<const Rgb> voxels, Reservation& memory);

}  // namespace voxkit::color
