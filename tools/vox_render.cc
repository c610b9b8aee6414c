// vox-render: pictures of volumes, compressed or not, what they cost, and how far they are from a reference.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <string_view>
#include <utility>
#include <vector>

#include "formats/image/image.h"
#include "formats/names.h"
#include "formats/output_file.h"
#include "libmetrics/image_diff.h"
#include "libmetrics/ssim.h"
#include "librender/camera_file.h"
#include "librender/layers.h"
#include "librender/shade.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"
#include "tools/common/retype.h"
#include "tools/render_scene.h"

namespace voxkit::cli {
namespace {

using namespace voxkit::render;

constexpr int most_rays_a_side = 65536;  ///< of a picture

struct Options {
  std::string input, output, path, report, reference;
  SceneOptions scene;
  int width = 1024, height = 768;
  std::string camera = "orbit:30,20,1.8", mode = "surface", traversal = "path", reference_traversal,
              shade = "phong", lod = "off", skip = "on", device = "cpu";
  bool depth_antialias = false;
  int rays_a_side = 1;  ///< of a pixel
  std::vector<Layer> layers;
  bool wants(Layer layer) const { return std::find(layers.begin(), layers.end(), layer) != layers.end(); }
  double fov = 45;
  // Direct volume rendering; empty where not given.
  std::string transfer, gradient;
  std::optional<double> step, modulate;
  bool no_images = false;
};

Status parse_antialias(const std::string& text, Options& o) {
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
                                                      {"steps", Layer::steps}};
  layers.clear();
  for (size_t at = 0; at <= text.size();) {
    const size_t comma = std::min(text.find(',', at), text.size());
    const auto found = std::find_if(std::begin(names), std::end(names), [&](const auto& name) {
      return name.first == std::string_view(text).substr(at, comma - at);
    });
    if (found == std::end(names) || std::find(layers.begin(), layers.end(), found->second) != layers.end())
      return bad_usage(fmt::format(
          "\"{}\": expected some of depth, normal, position and steps, with commas between them", text));
    layers.push_back(found->second);
    at = comma + 1;
  }
  return {};
}

void declare(CommandLine& line, Options& o) {
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
      "Further layers of an .exr, as floats: some of depth,normal,position,steps; with ssaa:N those of "
      "the ray at the pixel's centre",
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

/// An 8-bit RGB picture.
Result<Image> image_of(const Image& picture, Context& ctx) {
  VOX_TRY(Image image, Image::create(picture.width(), picture.height(), 3, SampleType::u8, ctx));
  for (int64_t y = 0; y < image.height(); ++y)
    for (int64_t x = 0; x < image.width(); ++x)
      for (int64_t k = 0; k < 3; ++k) image.row(y)[3 * x + k] = std::round(255 * picture.row(y)[4 * x + k]);
  return image;
}

/// Memory that is held from the start, so that too large a picture is refused before any work.
class Held {
 public:
  /// For the frames of the input and of the reference. What comes of them must fit beside them, but counts
  /// when it is made.
  static Result<Held> for_frames(const Options& o, bool pictures, Context& ctx) {
    const uint64_t pixels = static_cast<uint64_t>(o.width) * static_cast<uint64_t>(o.height);
    const uint64_t rays = pixels * static_cast<uint64_t>(o.rays_a_side * o.rays_a_side);
    const uint64_t ray_bytes = sizeof(Pixel) + (o.wants(Layer::steps) ? sizeof(PixelDetail) : 0);
    const uint64_t frames = rays * ray_bytes * (o.reference.empty() ? 1 : 2);
    constexpr uint64_t written_bytes = (4 + 3 + 3 + 8) * sizeof(float);  // a pixel: floats, integers, layers
    const uint64_t rest = pictures ? rays * shading_bytes + pixels * written_bytes : 0;
    const std::string what =
        fmt::format("a frame of {} x {} rays", o.width * o.rays_a_side, o.height * o.rays_a_side);
    VOX_CHECK(ctx.memory->reserve(frames + rest, what));
    ctx.memory->release(rest);
    return Held(*ctx.memory, frames);
  }
  Held(Held&& other) noexcept : budget_(other.budget_), bytes_(std::exchange(other.bytes_, 0)) {}
  ~Held() { budget_.release(bytes_); }

 private:
  Held(MemoryBudget& budget, uint64_t bytes) : budget_(budget), bytes_(bytes) {}
  MemoryBudget& budget_;
  uint64_t bytes_;
};

Traversal traversal_of(const std::string& name) {
  return name == "restart" ? Traversal::restart : name == "baseline" ? Traversal::baseline : Traversal::path;
}

/// What the frames of one volume cost.
struct Costs {
  Json frames = Json::array();
  std::vector<double> ms;
  uint64_t rays = 0;

  double average() const {
    return std::accumulate(ms.begin(), ms.end(), 0.0) / static_cast<double>(ms.size());
  }
  double mrays_per_s() const {
    return static_cast<double>(rays) / 1e3 / std::max(average() * static_cast<double>(ms.size()), 1e-9);
  }
  void add(const DvrFrame& frame, Json json) {
    ms.push_back(frame.seconds * 1000);
    rays += frame.rays;
    json.set("ms", ms.back())
        .set("rays", frame.rays)
        .set("rays_hit", frame.rays_hit)
        .set("samples", frame.samples);
    json.set("cells_visited", frame.cells_visited).set("blocks_touched", frame.blocks_touched);
    json.set("bytes_touched", frame.bytes_touched).set("bricks_decoded", frame.bricks_decoded);
    if (frame.lookup_seconds > 0) json.set("lookup_ms", frame.lookup_seconds * 1000);
    frames.push(std::move(json));
  }
  void write(Json& json) {
    json.set("frames", std::move(frames));
    json.set("ms_min", *std::min_element(ms.begin(), ms.end())).set("ms_avg", average());
    json.set("ms_max", *std::max_element(ms.begin(), ms.end())).set("mrays_per_s", mrays_per_s());
  }
};

/// Options that do not go with the mode.
Status check_mode(const Options& o) {
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

Result<int> work(const Options& o, Run& run) {
  VOX_CHECK(check_mode(o));
  if (!o.reference_traversal.empty() && o.reference.empty())
    return bad_usage("--reference-traversal: there is no reference: expected --reference INPUT2");
  if (o.device == "cuda") VOX_CHECK(check_device());
  if (o.output.empty() && !o.no_images) return bad_usage("no output: expected -o OUT.png, or --no-images");
  const bool exr = !o.no_images && has_ending(o.output, ".exr");
  if (!o.layers.empty() && !exr)
    return bad_usage("--aov: layers are part of an OpenEXR file: expected -o OUT.exr");
  if (std::max(o.width, o.height) * o.rays_a_side > most_rays_a_side)
    return bad_usage(fmt::format("{} x {} rays: expected at most {} a side", o.width * o.rays_a_side,
                                 o.height * o.rays_a_side, most_rays_a_side));
  VOX_TRY(const Camera camera, parse_camera(o.camera, o.fov));
  std::vector<Camera> cameras = {camera};
  if (has_ending(o.path, ".json")) {
    VOX_TRY(cameras, read_camera_file(o.path, o.fov));
  } else if (!o.path.empty()) {
    VOX_TRY(cameras, camera_path(o.path, camera));
  }
  std::vector<std::string> names;
  if (!o.no_images) {
    const bool pattern = is_numbered(o.output);
    if (!o.path.empty() && !pattern)
      return bad_usage("-o " + o.output + ": a path needs a pattern such as frame-%04d.png");
    for (size_t i = 0; i < cameras.size(); ++i) {
      names.push_back(o.output);
      if (pattern) {
        VOX_TRY(const NumberedName numbered, numbered_name(o.output));
        names.back() = numbered.path(i);
      }
      VOX_CHECK(check_image_output(names.back(), run.options.force));
    }
  }
  if (!o.report.empty()) VOX_CHECK(check_output(o.report, run.options.force));

  const bool normals = o.wants(Layer::normal);
  const bool pictures = !names.empty() || !o.reference.empty();
  VOX_TRY(const Held frames, Held::for_frames(o, pictures, run.ctx));
  CastOptions cast_options;
  cast_options.width = o.width * o.rays_a_side;
  cast_options.height = o.height * o.rays_a_side;
  cast_options.traversal = traversal_of(o.traversal);
  cast_options.level_of_detail = o.lod == "on";
  cast_options.skip = o.skip == "on";
  cast_options.details = o.wants(Layer::steps);
  ShadeOptions shade_options;
  shade_options.phong = o.shade.find("phong") != std::string::npos;
  shade_options.ssao = o.shade.find("ssao") != std::string::npos;
  shade_options.depth_antialias = o.depth_antialias;

  const bool dvr = o.mode == "dvr";
  DvrOptions dvr_options;
  dvr_options.width = cast_options.width;
  dvr_options.height = cast_options.height;
  dvr_options.step = o.step.value_or(0.25);
  dvr_options.gradient = o.gradient == "neighbour" ? Gradient::neighbour : Gradient::analytic;
  dvr_options.modulate = o.modulate.value_or(0);
  dvr_options.lit = shade_options.phong;
  dvr_options.skip = cast_options.skip;
  dvr_options.details = cast_options.details;
  if (dvr) shade_options.phong = false;  // every sample is lit by itself

  SceneOptions scene_options = o.scene;
  scene_options.dvr = dvr;
  scene_options.cuda = o.device == "cuda";
  VOX_TRY(Scene scene, open_scene(o.input, scene_options, run));
  std::optional<Scene> other;
  if (!o.reference.empty()) {
    VOX_TRY(other, open_scene(o.reference, scene_options, run));
    if (other->info.dims != scene.info.dims)
      return bad_usage(fmt::format("--reference {}: {} x {} x {} voxels: expected as many as the input has",
                                   o.reference, other->info.dims.x, other->info.dims.y, other->info.dims.z));
  }
  if (dvr) {
    // Both are seen through one function: where it depends on values, on those of the reference.
    run.stage("classify");
    VOX_TRY(const TransferFunction transfer,
            find_transfer(o.transfer.empty() ? "gray" : o.transfer, scene_options, other ? *other : scene));
    for (Scene* const each : {&scene, other ? &*other : nullptr})
      if (each != nullptr) {
        VOX_TRY(each->dvr, DvrScene::create(each->volume, transfer, run.ctx));
        if (scene_options.cuda) {
          run.stage("upload");
          VOX_TRY(each->device_dvr, DeviceDvr::upload(*each->dvr, run.ctx));
        }
      }
  }
  const double edge = GridTransform(scene.info).largest_edge();
  const auto shaded = [&](const Frame& seen, const Camera& from, bool with_normals) -> Result<Picture> {
    shade_options.normals = with_normals;
    VOX_TRY(Picture picture, shade(seen, from, edge, shade_options, run.ctx));
    if (o.rays_a_side > 1) {
      VOX_TRY(picture.rgba, downsample(picture.rgba, o.rays_a_side, run.ctx));
    }
    return picture;
  };

  run.stage("render");
  Costs costs, other_costs;
  DvrFrame frame, expected;  // their memory serves all frames
  double rmse = 0, psnr = 0, ms_ssim = 0;
  const double count = static_cast<double>(cameras.size());
  for (size_t i = 0; i < cameras.size(); ++i) {
    VOX_CHECK(scene.draw(cameras[i], cast_options, dvr_options, frame, run.ctx));
    Json json = Json::object();
    std::optional<Image> picture;
    if (pictures) {
      VOX_TRY(Picture floats, shaded(frame, cameras[i], normals));
      std::vector<ImageLayer> layers;
      for (const Layer layer : o.layers) {
        VOX_TRY(ImageLayer made,
                make_layer(layer, frame, cameras[i], floats.normals, o.rays_a_side, run.ctx));
        layers.push_back(std::move(made));
      }
      if (exr) VOX_CHECK(write_image(names[i], floats.rgba, run.options.force, layers));
      VOX_TRY(picture, image_of(floats.rgba, run.ctx));
      if (!exr && !names.empty()) VOX_CHECK(write_image(names[i], *picture, run.options.force));
    }
    if (other) {
      CastOptions reference_options = cast_options;
      if (!o.reference_traversal.empty()) reference_options.traversal = traversal_of(o.reference_traversal);
      VOX_CHECK(other->draw(cameras[i], reference_options, dvr_options, expected, run.ctx));
      VOX_TRY(const Picture floats, shaded(expected, cameras[i], false));
      VOX_TRY(const Image reference, image_of(floats.rgba, run.ctx));
      VOX_TRY(const ImageDiff diff, diff_images(reference, *picture, std::nullopt, run.ctx));
      VOX_TRY(const Image a, luma(reference, run.ctx));
      VOX_TRY(const Image b, luma(*picture, run.ctx));
      VOX_TRY(const Ssim similarity, ssim(a, b, std::nullopt, run.ctx));
      json.set("rmse", diff.rmse).set("psnr_db", diff.psnr_db).set("ms_ssim", similarity.ms_ssim);
      rmse += diff.rmse / count, psnr += diff.psnr_db / count, ms_ssim += similarity.ms_ssim / count;
      other_costs.add(expected, Json::object());
    }
    costs.add(frame, std::move(json));
    run.ctx.progress(static_cast<double>(i + 1) / count);
  }

  const double average = costs.average(), speed = costs.mrays_per_s();
  Json json = Json::result();
  json.set("tool", run.tool).set("version", version_text()).set("input", o.input).set("device", o.device);
  json.set("size", fmt::format("{}x{}", o.width, o.height)).set("mode", o.mode).set("traversal", o.traversal);
  if (dvr) {
    const Index3 bricks = scene.volume->ranges().bricks();
    json.set("bricks", bricks.x * bricks.y * bricks.z).set("bricks_visible", scene.dvr->visible_bricks());
  }
  costs.write(json);
  if (other) {
    Json reference = Json::object();
    reference.set("input", o.reference);
    json.set("speed_ratio", other_costs.average() / average);
    other_costs.write(reference);
    json.set("reference", std::move(reference));
    json.set("rmse_avg", rmse).set("psnr_db_avg", psnr).set("ms_ssim_avg", ms_ssim);
  }
  json.set("threads", run.options.threads).set("peak_rss_bytes", peak_rss_bytes());
  if (!o.report.empty()) {
    VOX_TRY(auto out, OutputFile::create(o.report, run.options.force));
    VOX_CHECK(out->write(json.text()));
    VOX_CHECK(out->commit());
  }
  if (run.options.json) VOX_CHECK(print(json.text()));
  if (!run.options.quiet && !run.options.json)
    fmt::print(stderr, "{}: {} frames of {}x{}, {:.3g} ms a frame, {:.3g} million rays a second{}\n", o.input,
               cameras.size(), o.width, o.height, average, speed,
               other ? fmt::format("; {} dB, MS-SSIM {:.6f}", readable(psnr), ms_ssim) : "");
  return 0;
}

}  // namespace
}  // namespace voxkit::cli

int main(int argc, char** argv) {
  using namespace voxkit::cli;
  Options options;
  return run_tool(
      argc, argv, "vox-render", "Renders volumes, straight from the compressed form.",
      "  vox-render menger:4 -o sponge.png\n"
      "  vox-render scan.svmm -o scan.png --camera orbit:120,30,1.6 --size 1920x1080 --shade phong+ssao\n"
      "  vox-render scan.svmm -o scan.exr --aa ssaa:3 --aov depth,normal\n"
      "  vox-render scan.svmm -o frame-%04d.png --path flight.json\n"
      "  vox-render scan.vqv -o bones.png --mode dvr --tf ct-bone\n"
      "  vox-render scan.svmm -o scan.png --reference scan.nrrd\n"
      "  vox-render scan.svmm --path thesis94 --no-images --report cost.json\n",
      [&](CommandLine& line) { declare(line, options); }, [&](Run& run) { return work(options, run); });
}
