// vox-render: pictures of volumes, compressed or not, and what they cost.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "formats/copy.h"
#include "formats/full_scale.h"
#include "formats/image.h"
#include "formats/output_file.h"
#include "librender/shade.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"

namespace voxkit::cli {
namespace {

using namespace voxkit::render;

struct Options {
  std::string input, output, path, report;
  OpenOptions open;
  int width = 1024, height = 768;
  std::string camera = "orbit:30,20,1.8", traversal = "path", shade = "phong", aa = "none", lod = "off",
              device = "cpu";
  double fov = 45;
  std::optional<ValueRange> range;
  bool no_images = false;
};

void declare(CommandLine& line, Options& o) {
  line.argument("INPUT", "Volume: a file, a built-in such as menger:5, or -", o.input);
  line.text("-o,--output", "OUT", "Picture (.png, .tif), with --path a pattern such as frame-%04d.png",
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
  line.text("--path", "PATH", "A camera path: thesis94 or orbit:N", o.path);
  line.option("--traversal", "KIND",
              "path: keeps the path of blocks; restart: from the root at every step (path)",
              one_of(o.traversal, {"path", "restart"}));
  line.option("--shade", "KIND", "none, phong, ssao or phong+ssao (phong)",
              one_of(o.shade, {"none", "phong", "ssao", "phong+ssao"}));
  line.option("--aa", "KIND", "none, or depth: softens steps in depth (none)",
              one_of(o.aa, {"none", "depth"}));
  line.option("--lod", "on|off", "Stop at voxels as small as a pixel (off)", one_of(o.lod, {"on", "off"}));
  line.option("--device", "DEVICE", "Where to render: cpu (cpu)", one_of(o.device, {"cpu", "cuda"}));
  line.option("--range", "LO,HI",
              "Sample values that are shown as 0 and 1 (default: full scale, or measured)",
              [&o](const std::string& text) -> Status {
                VOX_TRY(const auto ends, read_numbers(text, 2));
                if (!(ends[0] < ends[1]))
                  return bad_usage("\"" + text + "\": expected LO,HI with LO less than HI");
                o.range = ValueRange{ends[0], ends[1]};
                return {};
              });
  line.text("--report", "OUT.json", "Write what every frame cost", o.report);
  line.flag("--no-images", "Render and report only", o.no_images);
  declare_input_options(line, o.open);
}

/// Writes an 8-bit RGB picture.
Status write_picture(const Picture& picture, const std::string& name, Run& run) {
  VOX_TRY(Image image, Image::create(picture.width, picture.height, 3, SampleType::u8, run.ctx));
  for (int64_t y = 0; y < image.height(); ++y)
    for (int64_t x = 0; x < image.width(); ++x)
      for (int64_t k = 0; k < 3; ++k)
        image.row(y)[3 * x + k] =
            std::round(255 * picture.rgba[static_cast<size_t>(4 * (y * image.width() + x) + k)]);
  return write_image(name, image, run.options.force);
}

/// The name of a frame: the pattern's number filled in.
std::string frame_name(const std::string& pattern, size_t frame) {
  const size_t percent = pattern.find('%'), d = pattern.find('d', percent);
  const int width = std::atoi(pattern.c_str() + percent + 1);
  return pattern.substr(0, percent) + fmt::format("{:0{}}", frame, std::max(width, 1)) +
         pattern.substr(d + 1);
}

Json json_of(const Frame& frame) {
  Json json = Json::object();
  json.set("ms", frame.seconds * 1000).set("rays", frame.rays).set("rays_hit", frame.rays_hit);
  json.set("samples", uint64_t{0})
      .set("cells_visited", frame.cells_visited)
      .set("blocks_touched", frame.blocks_touched);
  return json;
}

Result<int> work(const Options& o, Run& run) {
  if (o.device == "cuda")
    return fail(ErrorCode::device, {}, "--device cuda: this build has no CUDA: expected cpu");
  if (o.output.empty() && !o.no_images) return bad_usage("no output: expected -o OUT.png, or --no-images");
  VOX_TRY(const Camera camera, parse_camera(o.camera, o.fov));
  std::vector<Camera> cameras = {camera};
  if (!o.path.empty()) {
    VOX_TRY(cameras, camera_path(o.path, camera));
  }
  const bool images = !o.no_images;
  const bool pattern = o.output.find('%') != std::string::npos;
  if (images && !o.path.empty() && !pattern)
    return bad_usage("-o " + o.output + ": a path needs a pattern such as frame-%04d.png");
  for (size_t i = 0; images && i < cameras.size(); ++i)
    VOX_CHECK(check_image_output(pattern ? frame_name(o.output, i) : o.output, run.options.force));
  if (!o.report.empty()) VOX_CHECK(check_output(o.report, run.options.force));

  VOX_TRY(Input input, open_input(o.input, o.open, run.ctx));
  const VolumeInfo info = input.source->info();
  CastOptions cast_options;
  cast_options.width = o.width;
  cast_options.height = o.height;
  cast_options.traversal = o.traversal == "restart" ? Traversal::restart : Traversal::path;
  cast_options.level_of_detail = o.lod == "on";
  std::optional<SvmmGrid> compressed;
  std::shared_ptr<const DenseGrid> dense;
  if (input.svmm) {
    compressed.emplace(input.svmm);
  } else {
    run.stage("read");
    VOX_TRY(dense, DenseGrid::read(*input.source, run.ctx));
  }
  if (o.range) {
    cast_options.range = {o.range->lo + info.bias(), o.range->hi + info.bias()};
  } else if (info.format == VoxelFormat::density16 || info.format == VoxelFormat::float32) {
    if (input.svmm && input.svmm->params().full_scale > 1 && info.format == VoxelFormat::density16) {
      cast_options.range = {static_cast<double>(info.bias()), info.bias() + input.svmm->params().full_scale};
    } else {
      VOX_TRY(auto again, open_input(o.input, o.open, run.ctx));
      VOX_TRY(cast_options.range, measure_range(*again.source, run.ctx));
    }
  }
  const GridTransform transform(info);
  ShadeOptions shade_options;
  shade_options.phong = o.shade.find("phong") != std::string::npos;
  shade_options.ssao = o.shade.find("ssao") != std::string::npos;
  shade_options.depth_antialias = o.aa == "depth";

  run.stage("render");
  std::vector<double> ms;
  uint64_t rays = 0;
  Json frames = Json::array();
  for (size_t i = 0; i < cameras.size(); ++i) {
    VOX_TRY(const Frame frame, compressed ? cast(*compressed, cameras[i], cast_options, run.ctx)
                                          : cast(*dense, cameras[i], cast_options, run.ctx));
    ms.push_back(frame.seconds * 1000);
    rays += frame.rays;
    frames.push(json_of(frame));
    if (images) {
      VOX_TRY(const Picture picture,
              shade(frame, cameras[i], transform.smallest_edge(), shade_options, run.ctx));
      VOX_CHECK(write_picture(picture, pattern ? frame_name(o.output, i) : o.output, run));
    }
    run.ctx.progress(static_cast<double>(i + 1) / static_cast<double>(cameras.size()));
  }
  const double total = std::accumulate(ms.begin(), ms.end(), 0.0);
  Json json = Json::result();
  json.set("tool", run.tool).set("version", version_text()).set("input", o.input).set("device", "cpu");
  json.set("size", fmt::format("{}x{}", o.width, o.height))
      .set("mode", "surface")
      .set("frames", std::move(frames));
  json.set("ms_min", *std::min_element(ms.begin(), ms.end()))
      .set("ms_avg", total / static_cast<double>(ms.size()));
  json.set("ms_max", *std::max_element(ms.begin(), ms.end()));
  json.set("mrays_per_s", static_cast<double>(rays) / 1e3 / std::max(total, 1e-9))
      .set("threads", run.options.threads);
  json.set("peak_rss_bytes", peak_rss_bytes());
  if (!o.report.empty()) {
    VOX_TRY(auto out, OutputFile::create(o.report, run.options.force));
    VOX_CHECK(out->write(json.text()));
    VOX_CHECK(out->commit());
  }
  if (run.options.json) VOX_CHECK(print(json.text()));
  if (!run.options.quiet && !run.options.json)
    fmt::print(stderr, "{}: {} frames of {}x{}, {:.3g} ms a frame, {:.3g} million rays a second\n", o.input,
               ms.size(), o.width, o.height, total / static_cast<double>(ms.size()),
               static_cast<double>(rays) / 1e3 / std::max(total, 1e-9));
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
      "  vox-render scan.svmm --path thesis94 --no-images --report cost.json\n",
      [&](CommandLine& line) { declare(line, options); }, [&](Run& run) { return work(options, run); });
}
