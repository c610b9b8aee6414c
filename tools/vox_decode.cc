// vox-decode: a compressed volume, whole, in part, or at a coarser level, as a plain volume.
#include <fmt/core.h>

#include <algorithm>

#include "formats/convert.h"
#include "formats/copy.h"
#include "formats/fill.h"
#include "formats/mesh/voxel_faces.h"
#include "formats/output_file.h"
#include "formats/volume/open_volume.h"
#include "formats/volume/readers.h"
#include "libcolor/edit/levels.h"
#include "libsvmm/packed/salvage.h"
#include "tools/common/attributes.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"
#include "tools/common/retype.h"
#include "tools/common/surface_output.h"
#include "tools/common/tiles.h"

namespace voxkit::cli {
namespace {

struct Options {
  std::string input, output;
  std::optional<Box> roi;
  int level = 0;
  std::optional<TargetType> type;
  std::optional<ValueRange> range;
  std::string enclosed = "keep";
  bool tiles = false, salvage = false;
};

void declare(CommandLine& line, Options& o) {
  line.argument("FILE", "Compressed volume (.svmm, .vqv, .dagc), or -", o.input);
  line.file(
      "-o,--output", "OUT",
      "Volume file, pattern such as slice-%04d.tif, or -; of a .dagc file also meshes (.glb, .obj), points "
      "(.ply) or MagicaVoxel models (.vox; more than 255 colors become the nearest of a palette)",
      o.output, true);
  line.option("--roi", "BOX", "X0,Y0,Z0,X1,Y1,Z1: part of the volume, half open, in voxels of level 0",
              box(o.roi));
  line.option("--level", "N", "Stop at this mip level; 0: all detail", integer(o.level, 0, 64));
  line.option("--type", "TYPE", "Type of the output: u8 i8 u16 i16 f32 rgba8 bit", target_type(o.type));
  line.option("--enclosed", "HOW",
              "Of a mesh: voxels that have voxels on all sides, and no face: keep: as points, so that "
              "dagcolor-pack finds them; drop (keep)",
              one_of(o.enclosed, {"keep", "drop"}));
  line.flag("--tiles",
            "Of a .dagc file: the images of its colours, one for each 2^20; OUT is a pattern such as "
            "tile-%04d.png (or .jpg .jp2; .dds of bc1 and bc7; .astc of astc)",
            o.tiles);
  line.flag(
      "--salvage",
      "Of a damaged .svmm file of layout packed: decode the pages that are sound, others are void (0, or "
      "the fill value), and exit 1",
      o.salvage);
  declare_range_option(line, o.range,
                       "Values that a narrower type's ends stand for (default: least and greatest value)");
}

Status check_box(const Box& box, const Index3& dims) {
  if (Box{{0, 0, 0}, dims}.contains(box)) return {};
  return bad_usage(fmt::format("--roi: the box is not inside the volume: expected one inside 0,0,0,{},{},{}",
                               dims.x, dims.y, dims.z));
}

/// What a mesh does not show.
void report_enclosed(const Options& o, const SurfaceCount& count, Run& run) {
  if (count.enclosed == 0) return;
  run.say(fmt::format("{}: {} of {} voxels have voxels on all sides, and no face: {}", o.output,
                      count.enclosed, count.voxels,
                      o.enclosed == "keep" ? "they are points: --enclosed drop leaves them out" : "dropped"));
}

/// The voxels of a level of a surface, or a part of it, one by one: void costs nothing.
Result<int> write_voxels(const Options& o, const std::shared_ptr<const color::Volume>& volume, Run& run) {
  const color::Level level(volume, o.level);
  SurfaceOutput what{level.info().box(), o.enclosed == "keep"};
  if (o.roi) {
    VOX_CHECK(check_box(*o.roi, volume->info().dims));
    what.box = level.touched(*o.roi);
  }
  const bool mesh = is_face_output(o.output);
  run.stage("decode");
  const double start = run.seconds();
  // Colours of cells are found by counts, of which each follows but a few.
  if (o.level > 0 && !o.roi) VOX_CHECK(volume->check(run.ctx));
  VOX_TRY(const SurfaceCount count, write_surface(level, what, o.output, run.options.force, run.ctx));
  const double seconds = run.seconds() - start;
  report_enclosed(o, count, run);
  run.note(fmt::format("{}: {} {}{} in {:.2f} s", o.output, count.voxels,
                       has_ending(o.output, ".ply") ? "points" : "voxels",
                       mesh ? fmt::format(" as {} rectangles", count.faces) : "", seconds));
  if (run.options.json) {
    Json json = Json::result();
    json.set("tool", run.tool).set("version", version_text()).set("input", o.input).set("output", o.output);
    json.set("level", o.level).set("dims", what.box.size());
    json.set("voxel_format", name(level.info().format)).set("leaf_voxels", count.voxels);
    if (mesh) json.set("rectangles", count.faces).set("enclosed_voxels", count.enclosed);
    json.set("decode_seconds", seconds)
        .set("peak_rss_bytes", peak_rss_bytes())
        .set("threads", run.options.threads);
    VOX_CHECK(print(json.text()));
  }
  return 0;
}

Result<int> write_images(const Options& o, Run& run) {
  if (o.roi || o.type || o.level != 0 || o.salvage)
    return bad_usage("--roi, --type, --level, --salvage: not of --tiles: leave them out");
  VOX_TRY(const Input input, open_compressed(o.input, 0, run.ctx));
  if (!input.color) return fail(ErrorCode::usage, o.input, "--tiles: expected a .dagc file");
  const double start = run.seconds();
  VOX_TRY(const uint64_t tiles, write_tiles(*input.color, o.output, run));
  const double seconds = run.seconds() - start;
  run.note(fmt::format("{}: {} images in {:.2f} s", o.output, tiles, seconds));
  if (run.options.json) {
    Json json = Json::result();
    json.set("tool", run.tool).set("version", version_text()).set("input", o.input).set("output", o.output);
    json.set("tiles", tiles).set("color_count", input.color->params().color_count);
    json.set("decode_seconds", seconds)
        .set("peak_rss_bytes", peak_rss_bytes())
        .set("threads", run.options.threads);
    VOX_CHECK(print(json.text()));
  }
  return 0;
}

/// A surface of few voxels, as a dense grid, may be larger than anybody expects.
Status warn_of_size(const Options& o, const Input& input, const VolumeInfo& info, Run& run) {
  constexpr uint64_t many = uint64_t{1} << 30, per_voxel = 64;
  const uint64_t bytes = raw_bytes(info);
  if (!input.color || bytes < many) return {};
  const color::Level level(input.color, o.level);
  VOX_TRY(const uint64_t voxels, level.count(level.info().box()));
  if (bytes / per_voxel < voxels) return {};
  run.say(fmt::format(
      "{}: {} voxels become a grid of {:.3g} GB: --roi takes a part; .vdb, .ply, .vox, .glb and .obj "
      "hold voxels only",
      o.output, voxels, static_cast<double>(bytes) / 1e9));
  return {};
}

/// What a damaged file has lost: a line, with --verbose one for each page.
void report_losses(const Options& o, const std::vector<svmm::Losses::Page>& pages, size_t lost, Run& run) {
  constexpr size_t most_named = 4;
  const auto place = [](const svmm::Losses::Page& page) {
    return fmt::format("level {} at {},{},{}", page.level, page.at.x, page.at.y, page.at.z);
  };
  std::string named;
  size_t left = lost;
  for (const svmm::Losses::Page& page : pages) {
    run.note(fmt::format("{}: {}: {}", o.input, place(page), page.doubtful ? "doubtful" : "lost"));
    if (page.doubtful || lost - left == most_named) continue;
    named += (named.empty() ? ": " : "; ") + place(page);
    --left;
  }
  if (left > 0) named += fmt::format("; and {} more", left);
  report(run.tool, {ErrorCode::input, o.input,
                    fmt::format("damaged: {} doubtful pages were kept, {} are lost{}", pages.size() - lost,
                                lost, named)});
}

Result<int> work(const Options& o, Run& run) {
  if (run.options.json && is_standard_output(o.output))
    return bad_usage("--json and the output - both use standard output");
  if (o.tiles) return write_images(o, run);
  VOX_CHECK(check_distinct(o.input, o.output));
  if (has_ending(o.output, ".gltf"))
    return fail(ErrorCode::usage, o.output, "meshes are written as .glb or .obj: expected one of these");
  const bool only_surface = is_only_surface_output(o.output);
  if (only_surface && o.type)
    return bad_usage("--type: not of points, models and meshes: leave it out, or name a volume");
  if (o.enclosed != "keep" && !is_face_output(o.output))
    return bad_usage("--enclosed: of meshes only: expected an output that ends in .glb or .obj");
  if (only_surface) {
    for (const std::string& file : files_of_surface(o.output)) {
      VOX_CHECK(check_distinct(o.input, file));
      VOX_CHECK(check_output(file, run.options.force));
    }
  } else {
    VOX_CHECK(check_volume_output(o.output, run.options.force));
  }
  VOX_TRY(Input input, open_compressed(o.input, o.level, run.ctx));
  if (only_surface && !input.color)
    return fail(ErrorCode::usage, o.input,
                "points, models and meshes are made of surfaces: expected a .dagc file");
  const auto losses = std::make_shared<svmm::Losses>();
  if (o.salvage) {
    if (!input.packed)
      return fail(ErrorCode::usage, o.input, "--salvage: expected a .svmm file of layout packed");
    VOX_TRY(input.source, svmm::open_salvaged(input.packed, o.level, losses));
  }
  if (input.color && is_surface_output(o.output) && !o.type) return write_voxels(o, input.color, run);
  // Boxes are found by counts, of which each box follows but a few.
  if (input.color && !o.roi) VOX_CHECK(input.color->check(run.ctx));
  auto source = std::move(input.source);
  if (o.roi) {
    const VolumeInfo whole = input.svmm     ? input.svmm->info()
                             : input.packed ? input.packed->info()
                             : input.color  ? input.color->info()
                                            : source->info();
    const Index3 dims = whole.dims;
    VOX_CHECK(check_box(*o.roi, dims));
    // Every voxel of the level that the box touches.
    const int64_t factor =
        input.svmm ? static_cast<int64_t>(input.svmm->levels()[static_cast<size_t>(o.level)].mip_factor)
        : input.packed || input.color ? int64_t{1} << o.level
                                      : 1;
    const Box part{o.roi->lo / factor, (o.roi->hi + (factor - 1)) / factor};
    VOX_TRY(source, crop(std::move(source), part, run.ctx));
  }
  VOX_TRY(source, retyped(std::move(source), nullptr, o.type, o.range, run));
  source = fill_restored(std::move(source));
  const VolumeInfo info = source->info();
  if (input.color) {
    color::AttributeSet set = input.color->params().attributes;
    // That is alpha.
    if (info.format == VoxelFormat::rgba32) set.remove(color::Attribute::opacity);
    if (!set.empty())
      run.say(fmt::format("{}: dropped: {}: points (.ply) have all attributes", o.output, names_of(set)));
  }
  VOX_CHECK(warn_of_size(o, input, info, run));
  VOX_TRY(auto sink, create_volume(o.output, info, run.options.force, run.ctx));
  run.stage("decode");
  const double start = run.seconds();
  VOX_CHECK(copy_volume(*source, info.box(), *sink, run.ctx));
  const double seconds = run.seconds() - start;  // decoding and writing, without waiting for the disk
  VOX_CHECK(sink->finish());

  run.note(fmt::format("{}: {} x {} x {} voxels of {} in {:.2f} s", o.output, info.dims.x, info.dims.y,
                       info.dims.z, type_name(info), seconds));
  const std::vector<svmm::Losses::Page> pages = losses->pages();
  const auto lost = static_cast<size_t>(std::ranges::count(pages, false, &svmm::Losses::Page::doubtful));
  if (run.options.json) {
    Json json = Json::result();
    json.set("tool", run.tool).set("version", version_text()).set("input", o.input).set("output", o.output);
    json.set("level", o.level).set("dims", info.dims).set("voxel_format", name(info.format));
    json.set("raw_bytes", raw_bytes(info)).set("decode_seconds", seconds);
    if (o.salvage) json.set("lost_pages", lost).set("doubtful_pages", pages.size() - lost);
    json.set("peak_rss_bytes", peak_rss_bytes()).set("threads", run.options.threads);
    VOX_CHECK(print(json.text()));
  }
  if (pages.empty()) return 0;
  report_losses(o, pages, lost, run);
  return 1;
}

}  // namespace
}  // namespace voxkit::cli

int main(int argc, char** argv) {
  using namespace voxkit::cli;
  Options options;
  return run_tool(
      argc, argv, "vox-decode", "Decompresses volumes.",
      "  vox-decode head.svmm -o head.nrrd\n"
      "  vox-decode head.vqv -o part.nii.gz --roi 0,0,0,64,64,64\n"
      "  vox-decode head.svmm -o small.nrrd --level 2\n"
      "  vox-decode damaged.svmm -o rest.nrrd --salvage\n"
      "  vox-decode house.dagc -o house.glb\n"
      "  vox-decode house.dagc -o house.ply\n"
      "  vox-decode house.dagc -o small.vox --level 2\n"
      "  vox-decode house.dagc -o tile-%04d.png --tiles\n"
      "  vox-decode house.dagc -o house.vox\n"
      "  vox-decode head.svmm -o slice-%04d.png --type u8\n",
      [&](CommandLine& line) { declare(line, options); }, [&](Run& run) { return work(options, run); });
}
