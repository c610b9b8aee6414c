// What the rays found as layers of an image, beside the picture.
#pragma once

#include <optional>

#include "formats/image/image.h"
#include "librender/camera.h"
#include "librender/frame.h"

namespace voxkit::render {

/// depth: distance from the eye, in world units; infinite where nothing was hit. normal: as `shade` found it;
/// 0 where nothing was hit. position: where the ray entered the first voxel that is not void, in the world;
/// 0 where nothing was hit. steps: cells that the ray looked at. The others: what the frame's traits say of
/// the first voxel that is not void; ids are whole up to 2^24, above that the nearest float; 0 where nothing
/// was hit.
enum class Layer { depth, normal, position, steps, emissive, opacity, rm, id };

/// The attribute of surfaces that a layer shows and needs; of normals it may be one that is found.
std::optional<color::Attribute> attribute_of(Layer layer);

/// A layer for every n x n pixels of a frame: what the pixel (n/2, n/2) of them found, since no mean of
/// depths or normals is one. `normals` is needed for `normal` only, and the frame's details for `steps`.
/// Errors: ErrorCode::limit.
Result<ImageLayer> make_layer(Layer layer, const Frame& frame, const Camera& camera,
                              const std::optional<Image>& normals, int n, Context& ctx);

}  // namespace voxkit::render
