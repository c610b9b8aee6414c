// vox-convert: from any volume format to any other, whole or in part; from coloured surfaces to one.
#include <fmt/core.h>

#include "formats/chunk_zstd.h"
#include "formats/convert.h"
#include "formats/copy.h"
#include "formats/fill.h"
#include "formats/orient.h"
#include "formats/output_file.h"
#include "formats/volume/open_volume.h"
#include "formats/volume/readers.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"
#include "tools/common/retype.h"
#include "tools/convert_surface.h"

namespace voxkit::cli {
namespace {

struct Options {
  std::vector<std::string> inputs;
  std::string input, output;
  OpenOptions open;
  std::optional<std::string> type;
  std::optional<TargetType> output_type;
  std::optional<Box> crop;
  std::optional<Index3> resample;
  std::optional<ValueRange> range;
  bool apply_scale = false;
  std::string orient;
  bool merge = false;
  std::optional<Index3> translate;
  int zstd = 0;
};

/// A move by whole voxels.
Parser steps(std::optional<Index3>& value) {
  return [&value](const std::string& text) -> Status {
    constexpr int64_t most = int64_t{1} << color::most_levels;
    const auto read = read_integers(text, -most, most);
    if (!read || read->size() != 3)
      return bad_usage(
          fmt::format("\"{}\": expected X,Y,Z, whole numbers of voxels from -{} to {}", text, most, most));
    value = Index3((*read)[0], (*read)[1], (*read)[2]);
    return {};
  };
}

void declare(CommandLine& line, Options& o) {
  line.arguments("INPUT",
                 "Volume file, folder, built-in such as menger:5, or -; with --merge one .dagc file or more",
                 o.inputs);
  line.file("-o,--output", "OUT",
            "Volume file, pattern such as slice-%04d.tif, or -; of .dagc files also a .dagc file, with the "
            "colors that they decode to, exactly",
            o.output, true);
  line.option("--type", "TYPE",
              "u8 i8 u16 i16 f32 rgba8 bit: type of the output; of a .raw INPUT, its own type",
              [&o](const std::string& text) -> Status {
                o.type = text;
                return {};
              });
  line.option("--output-type", "TYPE", "Type of the output, whatever the input is",
              target_type(o.output_type));
  declare_range_option(line, o.range,
                       "Values that a narrower type's ends stand for (default: least and greatest value)");
  line.flag("--apply-scale", "Write real values (slope and intercept applied) as f32", o.apply_scale);
  line.text(
      "--orient", "CODE",
      "Permute and flip axes, losslessly: three letters, such as RAS or LPI, or canonical (before --crop)",
      o.orient);
  line.option("--crop", "BOX", "X0,Y0,Z0,X1,Y1,Z1: part of the input, half open", box(o.crop));
  line.option("--resample", "X,Y,Z", "New extent, after --crop", dims(o.resample));
  line.flag("--merge",
            "From .dagc files to one: each where its world says, which must lead to one lattice; of a voxel "
            "that several have, that of the file named first counts",
            o.merge);
  line.option("--translate", "X,Y,Z",
              "From .dagc to .dagc: move the voxels in their grid, which stays where it is (before --crop); "
              "what leaves the grid is dropped",
              steps(o.translate));
  line.option("--zstd", "LEVEL",
              "Of a .dagc output: compress the parts of the file with zstd as well, 1 to 19 (not)",
              integer(o.zstd, 1, most_zstd_level));
  declare_input_options(line, o.open, false);
}

/// The input with everything done to it but its type.
Result<std::unique_ptr<VolumeSource>> open(const Options& o, Context& ctx) {
  OpenOptions how = o.open;
  how.real_values = o.apply_scale;
  VOX_TRY(Input input, open_input(o.input, how, ctx));
  auto source = std::move(input.source);
  if (!o.orient.empty()) {
    VOX_TRY(const AxisOrder order, order_for(o.orient, source->info()));
    VOX_TRY(source, reordered(std::move(source), order, ctx));
  }
  if (o.crop) {
    VOX_TRY(source, crop(std::move(source), *o.crop, ctx));
  }
  if (o.apply_scale) {
    VOX_TRY(source, apply_scale(std::move(source), ctx));
  }
  if (o.resample) {
    VOX_TRY(source, resample(std::move(source), *o.resample));
  }
  return source;
}

Result<int> work(Options& o, Run& run) {
  if (has_ending(o.output, ".dagc")) {
    if (o.type || o.output_type || o.range || o.apply_scale || !o.orient.empty() || o.resample)
      return bad_usage(
          "--type, --output-type, --range, --apply-scale, --orient, --resample: not of a .dagc output: leave "
          "them out");
  } else if (o.merge || o.translate || o.zstd > 0) {
    return bad_usage(
        "--merge, --translate, --zstd: expected a .dagc output: vox-decode makes volumes of that");
  }
  if (o.inputs.size() > 1 && !o.merge)
    return bad_usage(fmt::format("a second input, \"{}\": expected one, or --merge", o.inputs[1]));
  if (has_ending(o.output, ".dagc"))
    return convert_surfaces({o.inputs, o.output, o.merge, o.translate, o.crop, o.zstd}, run);
  o.input = o.inputs.front();
  if (has_ending(o.input, ".raw")) {
    o.open.type = o.type;
  } else if (o.type) {
    if (o.output_type)
      return bad_usage("--type and --output-type both name the type of the output: expected one");
    const auto type = parse_target_type(*o.type);
    if (!type) return bad_usage("--type: " + type.error().what);
    o.output_type = *type;
    o.open.round_wide = o.output_type->format == VoxelFormat::float32;
  }
  if (run.options.json && is_standard_output(o.output))
    return bad_usage("--json and the output - both use standard output");
  VOX_CHECK(check_distinct(o.input, o.output));
  o.open.outputs = is_numbered(o.output) ? std::vector{o.output} : files_of_output(o.output);
  VOX_CHECK(check_volume_output(o.output, run.options.force));

  VOX_TRY(auto source, open(o, run.ctx));
  if (o.input == "-" && source->forward_only()) {
    VOX_TRY(source, retyped(std::move(source), nullptr, o.output_type, o.range, run));
  } else {
    VOX_TRY(source, retyped(
                        std::move(source), [&] { return open(o, run.ctx); }, o.output_type, o.range, run));
  }
  source = fill_restored(std::move(source));
  const VolumeInfo info = source->info();
  VOX_TRY(auto sink, create_volume(o.output, info, run.options.force, run.ctx));
  run.stage("convert");
  VOX_CHECK(copy_volume(*source, info.box(), *sink, run.ctx));
  VOX_CHECK(sink->finish());

  run.note(fmt::format("{}: {} x {} x {} voxels of {} in {:.2f} s", o.output, info.dims.x, info.dims.y,
                       info.dims.z, type_name(info), run.seconds()));
  if (run.options.json) {
    Json json = Json::result();
    json.set("tool", run.tool).set("version", version_text()).set("input", o.input).set("output", o.output);
    json.set("dims", info.dims).set("voxel_format", name(info.format)).set("raw_bytes", raw_bytes(info));
    if (const auto bytes = file_bytes(o.output)) json.set("file_bytes", *bytes);
    json.set("seconds", run.seconds())
        .set("peak_rss_bytes", peak_rss_bytes())
        .set("threads", run.options.threads);
    VOX_CHECK(print(json.text()));
  }
  return 0;
}

}  // namespace
}  // namespace voxkit::cli

int main(int argc, char** argv) {
  using namespace voxkit::cli;
  Options options;
  return run_tool(
      argc, argv, "vox-convert",
      "Converts between volume formats; crops, moves and merges coloured surfaces.",
      "  vox-convert menger:4 -o sponge.nrrd\n"
      "  vox-convert scan.raw --dims 256,256,225 --type u8 -o scan.nii.gz\n"
      "  vox-convert head.nii.gz -o head.nrrd --type u8 --range 0,1200\n"
      "  vox-convert big.nrrd -o small.nrrd --crop 0,0,0,512,512,256 --resample 256,256,128\n"
      "  vox-convert scan.nrrd -o slice-%04d.tif\n"
      "  vox-convert house.dagc -o door.dagc --crop 0,0,0,64,128,32\n"
      "  vox-convert west.dagc east.dagc -o both.dagc --merge\n",
      [&](CommandLine& line) { declare(line, options); }, [&](Run& run) { return work(options, run); });
}
