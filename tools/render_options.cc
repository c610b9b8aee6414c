#include "tools/render_options.h"

#include <fmt/core.h>

#include <string_view>
#include <utility>

#include "tools/common/input.h"
#include "tools/common/retype.h"

namespace voxkit::cli {

using namespace voxkit::render;

namespace {

Status parse_antialias(const std::string& text, RenderOptions& o) {
  constexpr int most = 16;
  o.depth_antialias = text == "depth";
  o.rays_a_side = 1;
  if (text == "none" || text == "depth") return {};
  const auto n = text.starts_with("ssaa:") ? read_integer(text.substr(5), 2, most) : bad_usage({});
  if (!n)
    return bad_usage(fmt::format("\"{}\": expected none, depth or ssaa:N with N from 2 to {}", text, most));
  o.rays_a_side = static_cast<int>(*n);
  return {};
}

Status parse_layers(const std::string& text, std::vector<Layer>& layers) {
  const std::pair<std::string_view, Layer> names[] = {{"depth", Layer::depth},
                                                      {"normal", Layer::normal},
                                                      {"position", Layer::position},
                                                      {"steps", Layer::steps},
                                                      {"emissive", Layer::emissive},
                                                      {"opacity", Layer::opacity},
                                                      {"rm", Layer::rm},
                                                      {"id", Layer::id}};
  layers.clear();
  for (size_t at = 0; at <= text.size();) {
    const size_t comma = std::min(text.find(',', at), text.size());
    const auto found = std::find_if(std::begin(names), std::end(names), [&](const auto& name) {
      return name.first == std::string_view(text).substr(at, comma - at);
    });
    if (found == std::end(names) || std::find(layers.begin(), layers.end(), found->second) != layers.end())
      return bad_usage(
          fmt::format("\"{}\": expected some of depth, normal, position, steps, emissive, opacity, rm and "
                      "id, with commas between them",
                      text));
    layers.push_back(found->second);
    at = comma + 1;
  }
  return {};
}

}  // namespace

void declare(CommandLine& line, RenderOptions& o) {
  line.argument("INPUT", "Volume: a file, a built-in such as menger:5, or -", o.input);
  line.file("-o,--output", "OUT",
            "Picture (.png .tif, or .exr for floats), with --path a pattern such as frame-%04d.png",
            o.output);
  line.option("--size", "WxH", "Size of the picture in pixels (1024x768)",
              [&o](const std::string& text) -> Status {
                const size_t x = text.find('x');
                if (x == std::string::npos)
                  return bad_usage("\"" + text + "\": expected WxH, such as 1920x1080");
                VOX_TRY(const int64_t width, read_integer(text.substr(0, x), 1, 65536));
                VOX_TRY(const int64_t height, read_integer(text.substr(x + 1), 1, 65536));
                o.width = static_cast<int>(width), o.height = static_cast<int>(height);
                return {};
              });
  line.text("--camera", "CAMERA",
            "orbit:AZ,EL,DIST or lookat:EX,EY,EZ,TX,TY,TZ; the longest side is 1 (orbit:30,20,1.8)",
            o.camera);
  line.option("--fov", "DEG", "Vertical field of view (45)", number(o.fov, 0.01, 179));
  line.file("--path", "PATH",
            "A camera path: thesis94, orbit:N or FILE.json, as tools/README.md describes it", o.path);
  line.option("--mode", "MODE",
              "surface: shades what a ray meets first; dvr: direct volume rendering, of scalars (surface)",
              one_of(o.mode, {"surface", "dvr"}));
  line.file("--tf", "TF", "dvr: transfer function, FILE.json or one of " + transfer_presets() + " (gray)",
            o.transfer);
  line.option("--step", "S", "dvr: distance of samples in smallest voxel edges (0.25)",
              number(o.step, least_step, greatest_step));
  line.option("--gradient", "KIND",
              "dvr: analytic: of the trilinear cell; neighbour: from samples of neighbouring rays (analytic)",
              one_of(o.gradient, {"analytic", "neighbour"}));
  line.option("--modulate", "G",
              "dvr: multiply opacity by G times the gradient, in widths of the transfer function a voxel, up "
              "to 1 (0: off)",
              number(o.modulate, 0, 1e6));
  line.option("--traversal", "KIND",
              "path: keeps the path of blocks; restart: from the root at every step; baseline: voxel by "
              "voxel in floats, uncompressed volumes only (path)",
              one_of(o.traversal, {"path", "restart", "baseline"}));
  line.option("--shade", "KIND", "none, phong, ssao or phong+ssao (phong)",
              one_of(o.shade, {"none", "phong", "ssao", "phong+ssao"}));
  line.option("--aa", "KIND",
              "none; depth: softens steps in depth; ssaa:N: N x N rays a pixel, N from 2 to 16 (none)",
              [&o](const std::string& text) { return parse_antialias(text, o); });
  line.option(
      "--aov", "LAYERS",
      "Further layers of an .exr, as floats: some of depth,normal,position,steps, and of surfaces that have "
      "them emissive,opacity,rm,id; with ssaa:N those of the ray at the pixel's centre",
      [&o](const std::string& text) { return parse_layers(text, o.layers); });
  line.option("--lod", "on|off", "Stop at voxels as small as a pixel (off)", one_of(o.lod, {"on", "off"}));
  line.option(
      "--skip", "on|off",
      "Step over whole cells of one value, of what cannot be seen; off: voxel by voxel, all samples (on)",
      one_of(o.skip, {"on", "off"}));
  line.option("--device", "DEVICE", "Where to render: cpu or cuda, a GPU (cpu)",
              one_of(o.device, {"cpu", "cuda"}));
  declare_range_option(
      line, o.scene.range,
      "Sample values that are shown as 0 and 1, or that a preset spans (default: full scale, or measured)");
  line.file("--reference", "INPUT2", "Render this as well, and report how far the pictures are apart",
            o.reference);
  line.option("--reference-traversal", "KIND", "That of the reference (as --traversal)",
              one_of(o.reference_traversal, {"path", "restart", "baseline"}));
  line.file("--report", "OUT.json", "Write what every frame cost", o.report);
  line.flag("--no-images", "Render and report only", o.no_images);
  declare_input_options(line, o.scene.open);
}

Status check_mode(const RenderOptions& o) {
  if (o.mode != "dvr") {
    const char* const given = !o.transfer.empty()   ? "--tf"
                              : o.step              ? "--step"
                              : !o.gradient.empty() ? "--gradient"
                              : o.modulate          ? "--modulate"
                                                    : nullptr;
    return given == nullptr ? Status{} : bad_usage(fmt::format("{}: expected --mode dvr", given));
  }
  const bool wrong[] = {o.traversal != "path" || !o.reference_traversal.empty(),
                        o.shade.find("ssao") != std::string::npos, o.depth_antialias, o.lod == "on"};
  const char* const expected[] = {"--traversal: expected path", "--shade: expected none or phong",
                                  "--aa: expected none or ssaa:N", "--lod: expected off"};
  for (int i = 0; i < 4; ++i)
    if (wrong[i]) return bad_usage(fmt::format("{} with --mode dvr", expected[i]));
  if (o.scene.range && !o.transfer.empty() && !is_transfer_preset(o.transfer))
    return bad_usage("--range: expected a preset, whose values it gives, not a file");
  return o.transfer.empty() ? Status{} : check_transfer(o.transfer);
}

}  // namespace voxkit::cli
