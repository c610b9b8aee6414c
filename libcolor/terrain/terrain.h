// A built-in scene: a hamlet on a hillside with trees, in the light of an afternoon.
#pragma once

#include <memory>
#include <string>

#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// Whether a name is that of a terrain, "terrain:" and more.
bool is_terrain(const std::string& name);

/// "terrain:N": hills, rock and meadow, a road, houses and trees on 128 x 128 metres, up to 36 metres high,
/// with N voxels, 1 to 2^21, along the two longest sides. It is the same scene for every N, sampled more or
/// less finely, with detail down to twice the size of a voxel. Sun with shadows and sky are in its colours.
/// "terrain:N:box" has a closed black box under the ground, besides, 112 x 112 x 3.5 metres, that is to be
/// seen from nowhere: about half as many voxels again as there are.
///
/// What is solid has no hole in its surface for what moves from face to face; leaves are single voxels thick.
/// The sides of the ground are cut down to the floor of the world. Everything is decided in whole numbers and
/// in square roots, which IEEE 754 defines: the same voxels and colours everywhere. Nothing is held but the
/// scene, about 60 MB, and batches of cubes; 2^21 voxels a side take 10^12 of them.
///
/// ErrorCode::usage for a name of another form.
Result<std::unique_ptr<SurfaceSource>> open_terrain(const std::string& name);

}  // namespace voxkit::color
