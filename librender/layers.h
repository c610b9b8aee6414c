// What the rays found as layers of an image, beside the picture.
#pragma once

#include <optional>

#include "formats/image/image.h"
#include "librender/camera.h"
#include "librender/frame.h"

namespace voxkit::render {

/// depth: distance from the eye, in world units; infinite where nothing was hit. normal: as `shade` found it;
/// 0 where nothing was hit. position: where the ray entered the first voxel that is not void, in the world;
/// 0 where nothing was hit. steps: cells that the ray looked at.
enum class Layer { depth, normal, position, steps };

/// A layer for every n x n pixels of a frame: what the pixel (n/2, n/2) of them found, since no mean of
/// depths or normals is one. `normals` is needed for `normal` only, and the frame's details for `steps`.
/// Errors: ErrorCode::limit.
Result<ImageLayer> make_layer(Layer layer, const Frame& frame, const Camera& camera,
                              const std::optional<Image>& normals, int n, Context& ctx);

}  // namespace voxkit::render
