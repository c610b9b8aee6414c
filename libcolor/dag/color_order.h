// From the colours of voxels in Morton order to those of a file: in the order of its curve, with those of
// nodes, which are the means of what is below them.
#pragma once

#include <span>
#include <vector>

#include "formats/context.h"
#include "formats/reservation.h"
#include "libcolor/dag/dag.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// The `count` colours of all voxels, and with Colors::all of all cells, of a DAG from DagBuilder. A cell has
/// the mean of its voxels in linear light, rounded once. They count against `memory`.
Result<std::vector<Rgb>> colors_in_order(const Dag& dag, uint64_t count, Colors colors, Curve curve,
                                         std::span<const Rgb> voxels, Reservation& memory);

}  // namespace voxkit::color
