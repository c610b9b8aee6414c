// From what the rays found to a picture: the deferred pipeline of thesis section 3.4, all in screen space.
#pragma once

#include <vector>

#include "librender/ray_cast.h"

namespace voxkit::render {

struct ShadeOptions {
  bool phong = true;  ///< Blinn-Phong with a light at the eye's upper left
  bool ssao = false;  ///< ambient occlusion from the depth buffer (Bavoil & Sainz 2008, horizon-free variant)
  bool depth_antialias = false;  ///< blends the pixels on either side of a step in depth
  float background[3] = {1, 1, 1};
};

/// A picture: R, G, B, A in 0..1, row by row from the top; and the normals that were found (world, 0 where
/// nothing was hit).
struct Picture {
  int width = 0, height = 0;
  std::vector<float> rgba;
  std::vector<float> normals;
};

/// `voxel`: edge of a voxel in world units, the scale of the smoothing. The picture does not depend on
/// ctx.threads.
Result<Picture> shade(const Frame& frame, const Camera& camera, double voxel, const ShadeOptions& options,
                      Context& ctx);

/// Averages n x n pixels into one: the reference for anti-aliasing. The sides are multiples of n.
Picture downsample(const Picture& picture, int n);

}  // namespace voxkit::render
