// vox-render: pictures of volumes, compressed or not, what they cost, and how far they are from a reference.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <utility>
#include <vector>

#include "formats/image/image.h"
#include "formats/names.h"
#include "formats/output_file.h"
#include "libmetrics/image_diff.h"
#include "libmetrics/ssim.h"
#include "librender/camera_file.h"
#include "librender/shade.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"
#include "tools/render_options.h"
#include "tools/render_scene.h"

namespace voxkit::cli {
namespace {

using namespace voxkit::render;

/// An 8-bit RGB picture.
Result<Image> image_of(const Image& picture, Context& ctx) {
  VOX_TRY(Image image, Image::create(picture.width(), picture.height(), 3, SampleType::u8, ctx));
  for (int64_t y = 0; y < image.height(); ++y)
    for (int64_t x = 0; x < image.width(); ++x)
      for (int64_t k = 0; k < 3; ++k) image.row(y)[3 * x + k] = std::round(255 * picture.row(y)[4 * x + k]);
  return image;
}

Traversal traversal_of(const std::string& name) {
  return name == "restart" ? Traversal::restart : name == "baseline" ? Traversal::baseline : Traversal::path;
}

/// What the frames of one volume cost.
struct Costs {
  Json frames = Json::array();
  std::vector<double> ms;
  uint64_t rays = 0;
  double lookup_seconds = 0;

  double average() const {
    return std::accumulate(ms.begin(), ms.end(), 0.0) / static_cast<double>(ms.size());
  }
  double mrays_per_s() const {
    return static_cast<double>(rays) / 1e3 / std::max(average() * static_cast<double>(ms.size()), 1e-9);
  }
  void add(const Frame& frame, Json json) {
    ms.push_back(frame.seconds * 1000);
    rays += frame.rays;
    lookup_seconds += frame.lookup_seconds;
    json.set("ms", ms.back())
        .set("rays", frame.rays)
        .set("rays_hit", frame.rays_hit)
        .set("samples", frame.samples);
    json.set("cells_visited", frame.cells_visited).set("blocks_touched", frame.blocks_touched);
    json.set("bytes_touched", frame.bytes_touched)
        .set("bricks_decoded", frame.bricks_decoded)
        .set("pages_decoded", frame.pages_decoded);
    if (frame.lookup_seconds > 0) json.set("lookup_ms", frame.lookup_seconds * 1000);
    frames.push(std::move(json));
  }
  void write(Json& json) {
    json.set("frames", std::move(frames));
    json.set("ms_min", *std::min_element(ms.begin(), ms.end())).set("ms_avg", average());
    json.set("ms_max", *std::max_element(ms.begin(), ms.end())).set("mrays_per_s", mrays_per_s());
    if (lookup_seconds > 0) json.set("lookup_ms_avg", lookup_seconds * 1000 / static_cast<double>(ms.size()));
  }
};

/// What is to be drawn, checked before any work.
struct Plan {
  std::vector<Camera> cameras;
  std::vector<std::string> names;          ///< of the pictures, one a camera, or none
  bool exr = false;                        ///< pictures are floats, with layers
  bool pictures = false;                   ///< written, or compared
  std::shared_ptr<const Backend> backend;  ///< null: cpu
};

/// The picture's name for each camera.
Status name_pictures(const RenderOptions& o, bool force, Plan& plan) {
  const bool pattern = is_numbered(o.output);
  if (!o.path.empty() && !pattern)
    return bad_usage("-o " + o.output + ": a path needs a pattern such as frame-%04d.png");
  for (size_t i = 0; i < plan.cameras.size(); ++i) {
    plan.names.push_back(o.output);
    if (pattern) {
      VOX_TRY(const NumberedName numbered, numbered_name(o.output));
      plan.names.back() = numbered.path(i);
    }
    VOX_CHECK(check_image_output(plan.names.back(), force));
  }
  return {};
}

/// Options, device, names and outputs, in this order.
Result<Plan> check(const RenderOptions& o, const Run& run) {
  VOX_CHECK(check_mode(o));
  if (!o.reference_traversal.empty() && o.reference.empty())
    return bad_usage("--reference-traversal: there is no reference: expected --reference INPUT2");
  Plan plan;
  if (o.device == "cuda") {
    VOX_TRY(plan.backend, Backend::open(BackendKind::cuda));
  }
  if (o.output.empty() && !o.no_images) return bad_usage("no output: expected -o OUT.png, or --no-images");
  plan.exr = !o.no_images && has_ending(o.output, ".exr");
  plan.pictures = !o.no_images || !o.reference.empty();
  if (!o.layers.empty() && !plan.exr)
    return bad_usage("--aov: layers are part of an OpenEXR file: expected -o OUT.exr");
  if (std::max(o.width, o.height) * o.rays_a_side > most_rays_a_side)
    return bad_usage(fmt::format("{} x {} rays: expected at most {} a side", o.width * o.rays_a_side,
                                 o.height * o.rays_a_side, most_rays_a_side));
  VOX_TRY(const Camera camera, parse_camera(o.camera, o.fov));
  if (has_ending(o.path, ".json")) {
    VOX_TRY(plan.cameras, read_camera_file(o.path, o.fov));
  } else if (!o.path.empty()) {
    VOX_TRY(plan.cameras, camera_path(o.path, camera));
  } else {
    plan.cameras = {camera};
  }
  if (!o.no_images) VOX_CHECK(name_pictures(o, run.options.force, plan));
  if (!o.report.empty()) VOX_CHECK(check_output(o.report, run.options.force));
  return plan;
}

/// The options of a frame, for every part that takes some.
struct FrameOptions {
  CastOptions cast;
  DvrOptions dvr;
  ShadeOptions shade;
  SceneOptions scene;
};
FrameOptions options_of(const RenderOptions& o, const Plan& plan) {
  FrameOptions options;
  CastOptions& cast = options.cast;
  cast.width = o.width * o.rays_a_side;
  cast.height = o.height * o.rays_a_side;
  cast.traversal = traversal_of(o.traversal);
  cast.level_of_detail = o.lod == "on";
  cast.skip = o.skip == "on";
  cast.details = o.wants(Layer::steps);
  const bool phong = o.shade.find("phong") != std::string::npos;
  DvrOptions& dvr = options.dvr;
  dvr.width = cast.width;
  dvr.height = cast.height;
  dvr.step = o.step.value_or(0.25);
  dvr.gradient = o.gradient == "neighbour" ? Gradient::neighbour : Gradient::analytic;
  dvr.modulate = o.modulate.value_or(0);
  dvr.lit = phong;
  dvr.skip = cast.skip;
  dvr.details = cast.details;
  options.scene = o.scene;
  options.scene.open.outputs = plan.names;
  if (!o.report.empty()) options.scene.open.outputs.push_back(o.report);
  options.scene.dvr = o.mode == "dvr";
  options.scene.level_of_detail = options.cast.level_of_detail;
  options.scene.backend = plan.backend;
  options.shade.phong = phong && !options.scene.dvr;  // there every sample is lit by itself
  for (const Layer layer : o.layers)
    if (const auto attribute = attribute_of(layer)) {
      cast.traits.add(*attribute);
      // Normals are found where there are none.
      if (layer != Layer::normal) options.scene.needs.add(*attribute);
    }
  options.shade.ssao = o.shade.find("ssao") != std::string::npos;
  options.shade.depth_antialias = o.depth_antialias;
  if (options.shade.phong || options.shade.ssao) {
    cast.traits.add(color::Attribute::emissive);
    cast.traits.add(color::Attribute::normal);
  }
  return options;
}

/// The input and what it is compared with, each with a frame whose memory serves all pictures.
struct Drawn {
  Scene scene;
  std::optional<Scene> other;
  Frame frame, expected;
};

/// Holds the memory of both frames from the start, so that too large a picture is refused before any work;
/// and again once it is known what the volumes need. What comes of the frames must fit beside them, but
/// counts when it is made.
Result<Reservation> hold_frames(const RenderOptions& o, const Plan& plan, const FrameJob& frame,
                                const FrameJob& expected, Context& ctx) {
  const uint64_t frames = frame.bytes() + (o.reference.empty() ? 0 : expected.bytes());
  constexpr uint64_t written_bytes = (4 + 3 + 3 + 8) * sizeof(float);  // a pixel: floats, integers, layers
  const uint64_t pixels = static_cast<uint64_t>(o.width) * static_cast<uint64_t>(o.height);
  const uint64_t rest = plan.pictures ? frame.rays() * shading_bytes + pixels * written_bytes : 0;
  VOX_TRY(Reservation held,
          Reservation::take(frames + rest, fmt::format("a frame of {} x {} rays", frame.width, frame.height),
                            ctx));
  held.release(rest);
  return held;
}

/// Opens the volumes.
Status open(const RenderOptions& o, const SceneOptions& options, Drawn& drawn, Run& run) {
  VOX_TRY(drawn.scene, open_scene(o.input, options, run));
  Scene& scene = drawn.scene;
  if (!o.reference.empty()) {
    VOX_TRY(drawn.other, open_scene(o.reference, options, run));
    const Index3& dims = drawn.other->info.dims;
    if (dims != scene.info.dims)
      return bad_usage(fmt::format("--reference {}: {} x {} x {} voxels: expected as many as the input has",
                                   o.reference, dims.x, dims.y, dims.z));
  }
  if (!options.dvr) return {};
  // Both are seen through one function: where it depends on values, on those of the reference.
  run.stage("classify");
  VOX_TRY(const TransferFunction transfer, find_transfer(o.transfer.empty() ? "gray" : o.transfer, options,
                                                         drawn.other ? *drawn.other : scene));
  for (Scene* const each : {&scene, drawn.other ? &*drawn.other : nullptr})
    if (each != nullptr) VOX_CHECK(each->classify(transfer, options, run));
  return {};
}

/// What the pictures of a run cost, and how far they are from the reference, on average.
struct Outcome {
  Costs costs, other;
  double rmse = 0, psnr = 0, ms_ssim = 0;
};

/// Draws, shades, writes and compares the pictures, one after the other.
class Drawing {
 public:
  Drawing(const RenderOptions& o, const Plan& plan, const FrameOptions& options, Drawn& drawn, Run& run)
      : o_(o), plan_(plan), options_(options), drawn_(drawn), run_(run) {}

  Result<Outcome> draw() {
    run_.stage("render");
    const double count = static_cast<double>(plan_.cameras.size());
    for (size_t i = 0; i < plan_.cameras.size(); ++i) {
      const Camera& camera = plan_.cameras[i];
      VOX_CHECK(drawn_.scene.draw(camera, options_.cast, options_.dvr, drawn_.frame, run_.ctx));
      Json json = Json::object();
      std::optional<Image> picture;
      if (plan_.pictures) {
        VOX_TRY(picture, write(i));
      }
      if (drawn_.other) VOX_CHECK(compare(camera, *picture, json));
      outcome_.costs.add(drawn_.frame, std::move(json));
      run_.ctx.progress(static_cast<double>(i + 1) / count);
    }
    return std::move(outcome_);
  }

 private:
  /// A picture as large as it is asked for.
  Result<Picture> shaded(const Frame& frame, const Camera& camera, bool normals) {
    ShadeOptions options = options_.shade;
    options.normals = normals;
    const double edge = GridTransform(drawn_.scene.info).largest_edge();
    VOX_TRY(Picture picture, shade(frame, camera, edge, options, run_.ctx));
    if (o_.rays_a_side > 1) {
      VOX_TRY(picture.rgba, downsample(picture.rgba, o_.rays_a_side, run_.ctx));
    }
    return picture;
  }
  /// Writes picture i where it has a name; returns it in 8 bits.
  Result<Image> write(size_t i) {
    const Camera& camera = plan_.cameras[i];
    VOX_TRY(Picture floats, shaded(drawn_.frame, camera, o_.wants(Layer::normal)));
    std::vector<ImageLayer> layers;
    for (const Layer layer : o_.layers) {
      VOX_TRY(ImageLayer made,
              make_layer(layer, drawn_.frame, camera, floats.normals, o_.rays_a_side, run_.ctx));
      layers.push_back(std::move(made));
    }
    const bool force = run_.options.force;
    if (plan_.exr) VOX_CHECK(write_image(plan_.names[i], floats.rgba, force, layers));
    VOX_TRY(Image picture, image_of(floats.rgba, run_.ctx));
    if (!plan_.exr && !plan_.names.empty()) VOX_CHECK(write_image(plan_.names[i], picture, force));
    return picture;
  }
  /// Draws the reference, and notes how far a picture is from it.
  Status compare(const Camera& camera, const Image& picture, Json& json) {
    Context& ctx = run_.ctx;
    CastOptions options = options_.cast;
    if (!o_.reference_traversal.empty()) options.traversal = traversal_of(o_.reference_traversal);
    VOX_CHECK(drawn_.other->draw(camera, options, options_.dvr, drawn_.expected, ctx));
    VOX_TRY(const Picture floats, shaded(drawn_.expected, camera, false));
    VOX_TRY(const Image reference, image_of(floats.rgba, ctx));
    VOX_TRY(const ImageDiff diff, diff_images(reference, picture, std::nullopt, ctx));
    VOX_TRY(const Image a, luma(reference, ctx));
    VOX_TRY(const Image b, luma(picture, ctx));
    VOX_TRY(const Ssim similarity, ssim(a, b, std::nullopt, ctx));
    json.set("rmse", diff.rmse).set("psnr_db", diff.psnr_db).set("ms_ssim", similarity.ms_ssim);
    const double count = static_cast<double>(plan_.cameras.size());
    outcome_.rmse += diff.rmse / count, outcome_.psnr += diff.psnr_db / count;
    outcome_.ms_ssim += similarity.ms_ssim / count;
    outcome_.other.add(drawn_.expected, Json::object());
    return {};
  }

  const RenderOptions& o_;
  const Plan& plan_;
  const FrameOptions& options_;
  Drawn& drawn_;
  Run& run_;
  Outcome outcome_;
};

/// Writes and prints what it cost.
Status report(const RenderOptions& o, const Plan& plan, const Drawn& drawn, Outcome outcome, Run& run) {
  const double average = outcome.costs.average(), speed = outcome.costs.mrays_per_s();
  Json json = Json::result();
  json.set("tool", run.tool).set("version", version_text()).set("input", o.input).set("device", o.device);
  json.set("size", fmt::format("{}x{}", o.width, o.height)).set("mode", o.mode).set("traversal", o.traversal);
  if (o.mode == "dvr") {
    const Index3 bricks = drawn.scene.volume->ranges().bricks();
    json.set("bricks", bricks.x * bricks.y * bricks.z)
        .set("bricks_visible", drawn.scene.dvr->visible_bricks());
    if (drawn.scene.dvr->volume().packed()) json.set("pages_decoded", drawn.scene.dvr->pages_decoded());
  }
  outcome.costs.write(json);
  if (drawn.other) {
    Json reference = Json::object();
    reference.set("input", o.reference);
    json.set("speed_ratio", outcome.other.average() / average);
    outcome.other.write(reference);
    json.set("reference", std::move(reference));
    json.set("rmse_avg", outcome.rmse).set("psnr_db_avg", outcome.psnr).set("ms_ssim_avg", outcome.ms_ssim);
  }
  json.set("threads", run.options.threads).set("peak_rss_bytes", peak_rss_bytes());
  if (!o.report.empty()) {
    VOX_TRY(auto out, OutputFile::create(o.report, run.options.force));
    VOX_CHECK(out->write(json.text()));
    VOX_CHECK(out->commit());
  }
  if (run.options.json) VOX_CHECK(print(json.text()));
  if (!run.options.quiet && !run.options.json)
    tell(fmt::format(
        "{}: {} frames of {}x{}, {:.3g} ms a frame, {:.3g} million rays a second{}", o.input,
        plan.cameras.size(), o.width, o.height, average, speed,
        drawn.other ? fmt::format("; {} dB, MS-SSIM {:.6f}", readable(outcome.psnr), outcome.ms_ssim) : ""));
  return {};
}

Result<int> work(const RenderOptions& o, Run& run) {
  VOX_TRY(const Plan plan, check(o, run));
  const FrameOptions options = options_of(o, plan);
  Drawn drawn;
  FrameJob least{options.cast.width, options.cast.height, options.cast.details};
  VOX_TRY(Reservation held, hold_frames(o, plan, least, least, run.ctx));
  VOX_CHECK(open(o, options.scene, drawn, run));
  held = {};
  least.traits = options.cast.traits;
  const FrameJob frame = drawn.scene.job(least), expected = drawn.other ? drawn.other->job(least) : least;
  VOX_TRY(held, hold_frames(o, plan, frame, expected, run.ctx));
  held = {};
  VOX_CHECK(drawn.frame.begin(frame, run.ctx));
  if (drawn.other) VOX_CHECK(drawn.expected.begin(expected, run.ctx));
  VOX_TRY(Outcome outcome, Drawing(o, plan, options, drawn, run).draw());
  VOX_CHECK(report(o, plan, drawn, std::move(outcome), run));
  return 0;
}

}  // namespace
}  // namespace voxkit::cli

int main(int argc, char** argv) {
  using namespace voxkit::cli;
  RenderOptions options;
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
