// Fewer bricks for a volume that has been collected.
#pragma once

#include "libvq/collect.h"

namespace voxkit::vq {

/// Replaces the unique bricks by the centres of k-means, and the numbers of places by theirs, as Options say;
/// does nothing where no k-means is asked for, or there are no more bricks than it would leave. `report`: its
/// seeding, iterations and seconds are set. Centres are numbered as places first have them.
Status cluster(Collected& collected, const Options& options, const VolumeInfo& info,
               const Quantiser& quantiser, Report& report, Context& ctx);

}  // namespace voxkit::vq
