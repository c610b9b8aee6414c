// From the attributes of voxels in Morton order to those of a file, as color_order.h does it for colours.
#pragma once

#include <span>
#include <vector>

#include "formats/reservation.h"
#include "libcolor/dag/dag.h"
#include "libcolor/surface/attributes.h"

namespace voxkit::color {

/// The attributes of all voxels, and with Colors::all of all `count` cells, of a DAG from DagBuilder. What a
/// cell has follows from its voxels (attribute_means.h). They count against `memory`.
Result<std::vector<std::byte>> attributes_in_order(const Dag& dag, uint64_t count, Colors colors, Curve curve,
                                                   AttributeSet set, std::span<const std::byte> voxels,
                                                   Reservation& memory);

}  // namespace voxkit::color
