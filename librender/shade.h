// From what the rays found to a picture: the deferred pipeline of thesis section 3.4, all in screen space.
#pragma once

#include <optional>

#include "formats/image/image.h"
#include "librender/camera.h"
#include "librender/frame.h"

namespace voxkit::render {

struct ShadeOptions {
  bool phong = true;             ///< Blinn-Phong with a light at the eye's upper left
  bool ssao = false;             ///< ambient occlusion: occlusion.h
  bool depth_antialias = false;  ///< blends the pixels on either side of a step in depth
  bool normals = false;          ///< hand out the normals as well
  float background[3] = {1, 1, 1};
};

/// Images of floats.
struct Picture {
  Image rgba;  ///< 0..1, as a display shows it (not linear light); over the background, so A is 1
  std::optional<Image> normals;  ///< unit vectors in the world; 0 where nothing was hit
};

/// `voxel`: edge of a voxel in world units, the scale of the smoothing. The picture does not depend on
/// ctx.threads. Errors: ErrorCode::limit.
Result<Picture> shade(const Frame& frame, const Camera& camera, double voxel, const ShadeOptions& options,
                      Context& ctx);

/// What `shade` reserves at most, in bytes a pixel, what it returns included.
inline constexpr uint64_t shading_bytes = 60;

/// Averages n x n pixels into one: the reference for anti-aliasing. The sides are multiples of n.
Result<Image> downsample(const Image& image, int n, Context& ctx);

}  // namespace voxkit::render
