// The command line of vox-render.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "librender/layers.h"
#include "tools/render_scene.h"

namespace voxkit::cli {

inline constexpr int most_rays_a_side = 65536;  ///< of a picture

struct RenderOptions {
  std::string input, output, path, report, reference;
  SceneOptions scene;
  int width = 1024, height = 768;
  std::string camera = "orbit:30,20,1.8", mode = "surface", traversal = "path", reference_traversal,
              shade = "phong", lod = "off", skip = "on", device = "cpu";
  bool depth_antialias = false;
  int rays_a_side = 1;  ///< of a pixel
  std::vector<render::Layer> layers;
  bool wants(render::Layer layer) const {
    return std::find(layers.begin(), layers.end(), layer) != layers.end();
  }
  double fov = 45;
  // Direct volume rendering; empty where not given.
  std::string transfer, gradient;
  std::optional<double> step, modulate;
  bool no_images = false;
};

/// Says what may be asked; what is asked goes to `o`.
void declare(CommandLine& line, RenderOptions& o);
/// Errors: ErrorCode::usage of options that do not go with the mode, or with each other.
Status check_mode(const RenderOptions& o);

}  // namespace voxkit::cli
