// dagcolor-pack: a coloured surface as a DAG and an array of compressed colours.
#include <fmt/format.h>

#include <algorithm>
#include <glm/vec3.hpp>
#include <map>
#include <set>

#include "formats/names.h"
#include "formats/output_file.h"
#include "libcolor/compare.h"
#include "libcolor/part_codecs.h"
#include "libcolor/simplify/simplified_surface.h"
#include "tools/common/attributes.h"
#include "tools/common/batch.h"
#include "tools/common/color_report.h"
#include "tools/common/encoding.h"
#include "tools/common/surface_input.h"
#include "tools/common/tiles.h"

namespace voxkit::cli {
namespace {

struct Options {
  Batch batch;
  std::vector<std::string> names;       ///< of one surface
  std::map<size_t, glm::dvec3> places;  ///< of inputs that are moved
  std::string output;                   ///< its file
  std::string tiles;
  SurfaceOptions surface;
  std::string kind = "thin", codec, image_curve, curve = "morton", colors = "leaf", counts = "node", space,
              emissive = "add", geometry = "auto", purpose = "access";
  color::Options encoder;
  std::optional<double> threshold;
  std::optional<uint32_t> palette;
  std::optional<int> weight_bits, effort, quality;
  std::optional<color::AttributeSet> attributes;
  bool verify = false;
};

void declare(CommandLine& line, Options& o) {
  declare_batch(
      line,
      "Mesh (.obj .gltf .glb .ply .stl .3ds), points (.ply .pcd .las), model (.vox), RGBA or RGB "
      "volume, built-in "
      "(menger:5, terrain:N, terrain:N:box), or .dagc file. Several meshes or points become one surface: "
      "what shares a voxel has their mean, as in one file",
      ".dagc", o.batch);
  line.behind_arguments(
      "--at", "X,Y,Z",
      "Of the mesh or points named before it: moved by so much, in the unit of the file (0,0,0)",
      [&o](size_t number, const std::string& text) -> Status {
        VOX_TRY(const auto at, read_numbers(text, 3));
        o.places[number] = {at[0], at[1], at[2]};
        return {};
      });
  line.option(
      "--resolution", "N",
      "Of a mesh or points: voxels along the longest side (1024; of what vox-decode wrote, its own grid). "
      "Of a .dagc file: its own, or a half, a quarter ... of it: voxels become one, in their mean color",
      integer(o.surface.resolution, 1, int64_t{1} << color::most_levels));
  line.option("--surface", "KIND",
              "Of a mesh: thin: no more voxels than make it tight; conservative: all that it touches (thin)",
              one_of(o.kind, {"thin", "conservative"}));
  line.option("--emissive", "HOW",
              "Of a mesh: light that it emits: add: to its colors; drop. Of points: drop: without that "
              "attribute (add)",
              one_of(o.emissive, {"add", "drop"}));
  line.option(
      "--attributes", "LIST",
      "What voxels have: color, and any of emissive, opacity, normal, rm (roughness and metalness) and "
      "id (of material or label), such as color,opacity,id (color, and what the input has of emissive and "
      "opacity; of a .dagc file all that it has)",
      attribute_list(o.attributes));
  line.option(
      "--attribute-threshold", "LIST",
      "Of attributes in blocks: greatest errors, such as emissive=9,opacity=2,normal=1,rm=4; normal in "
      "degrees (emissive: as colors; opacity=4,normal=3,rm=8)",
      attribute_thresholds(o.encoder.attribute_thresholds));
  line.option("--frame", "N", "Of an animated .vox model: which frame, from 0 (0)",
              integer(o.surface.frame, 0, uint32_t{1} << 31));
  line.option(
      "--codec", "CODEC",
      "raw: 24 bits a colour; fws, vws: blocks with weights of fixed and of variable size; bc1, bc7, "
      "astc: images, as textures, of 4, 8 and 0.89 to 8 bits a colour; palette: indices into a "
      "palette of the scene; jpeg, jp2, png: images as files, smaller, but decoded as a whole; predicted: "
      "from the voxels around, smallest, decoded as a whole (vws, or for storage predicted; of a .vox model "
      "palette, or for storage raw: its colours are exact unless a threshold is said)",
      one_of(o.codec,
             {"raw", "fws", "vws", "bc1", "bc7", "astc", "palette", "jpeg", "jp2", "png", "predicted"}));
  line.option("-e,--threshold", "E",
              "Of blocks and predicted: no colour is further from the original; of predicted 0: lossless "
              "(9.56)",
              number(o.threshold, 0, 1e6));
  line.option("--space", "SPACE",
              "Of blocks: the threshold is a distance in srgb, of 0 to 255, or in lab: CIELAB, 1976 (srgb)",
              one_of(o.space, {"srgb", "lab"}));
  line.option("--weight-bits", "B", "Of fws: bits of a weight, 1 to 4 (3)",
              integer(o.weight_bits, 1, color::most_weight_bits));
  line.option(
      "--palette", "N",
      "Of palette: colours of the scene's, 1 to 65536 (256). Of png: of each image, 2 to 256; 0: all (0)",
      integer(o.palette, 0, color::most_palette_colors));
  line.option(
      "--effort", "N",
      "Of blocks: 1: greedy merging, as published; up to 9: smaller files, slower; of textures: up to 9: "
      "nearer, slower; of palette: both (3)",
      integer(o.effort, 1, 9));
  line.option(
      "--quality", "Q",
      "Of astc: 100: blocks of 4 x 4, 8 bits a colour; down to 0: of 12 x 12, 0.89 bits. Of jpeg: that "
      "of libjpeg. Of jp2: 100: lossless; 80: a fifth of 24 bits; half as many for each 20 less. Of "
      "png: 100: lossless; else that of libimagequant (100)",
      integer(o.quality, 0, 100));
  line.option("--image-curve", "CURVE",
              "Of textures and images: colours are laid along a curve: morton or hilbert (morton)",
              one_of(o.image_curve, {"morton", "hilbert"}));
  line.option("--curve", "CURVE",
              "Colours are in the order of a curve through space: morton or hilbert; hilbert: a little "
              "smaller, all colours "
              "are held in memory (morton)",
              one_of(o.curve, {"morton", "hilbert"}));
  line.option("--colors", "WHICH", "leaf: those of voxels; all: of all nodes, too (leaf)",
              one_of(o.colors, {"leaf", "all"}));
  line.option("--counts", "WHERE", "node: counts in nodes; pointer: beside pointers, larger, faster (node)",
              one_of(o.counts, {"node", "pointer"}));
  line.option(
      "--geometry", "HOW",
      "dag: nodes with pointers, as published; ssvdag: mirror images once as well, pointers of 2 to 4 bytes: "
      "half of that, more or less; octree: masks alone, entropy-coded: of scenes and scans a tenth to a "
      "fourth, "
      "but decoded as a whole before it is drawn; auto: ssvdag, or for storage the smaller of that and "
      "octree (auto)",
      one_of(o.geometry, {"auto", "dag", "ssvdag", "octree"}));
  line.option("--for", "WHAT",
              "What the file is made for: access or storage: the smaller geometry, and, unless another "
              "codec or level is said, predicted colors and --zstd 19 (access)",
              one_of(o.purpose, {"access", "storage"}));
  line.option("--simplify", "D",
              "Fewer voxels, for scans, where nothing repeats: each that there was has one within D voxels, "
              "0 to 8, and the other way around (a Hausdorff distance, measured and reported). What is tight "
              "stays so, gaps become wider (0)",
              number(o.encoder.simplify, 0, color::most_simplify));
  line.file("--tiles", "PATTERN",
            "Of a .dagc file: take the colours from the images that vox-decode --tiles wrote of it, such as "
            "tile-%04d.png; where codec and ending agree they are stored as they are",
            o.tiles);
  declare_zstd(line, o.encoder.zstd);
  line.flag(
      "--verify",
      "Decode and compare before the output appears; exit 1 if the promised bound, or what encoding found "
      "out, is broken",
      o.verify);
  declare_input_options(line, o.surface.open);
}

std::optional<color::Geometry> geometry_of(const Options& o) {
  if (o.geometry == "dag") return color::Geometry::dag;
  if (o.geometry == "ssvdag") return color::Geometry::ssvdag;
  if (o.geometry == "octree") return color::Geometry::octree;
  return {};
}

/// Not said: for storage the smallest one, unless other options ask for what it has not. Models have few
/// colours, and all of them count: unless a threshold is said they are exact.
color::ColorCodec codec_of(const Options& o) {
  using color::ColorCodec;
  if (!o.codec.empty()) return *color::codec_named(o.codec);
  const bool storage = o.purpose == "storage";
  if (o.names.size() == 1 && has_ending(o.names.front(), ".vox") && !o.threshold && o.colors == "leaf" &&
      o.encoder.simplify == 0)
    return storage ? ColorCodec::raw
                   : ColorCodec::palette;  // equal runs of raw colours take zstd next to nothing
  const bool fits = o.colors == "leaf" && o.curve == "morton" && o.space != "lab";
  return storage && fits ? ColorCodec::predicted : ColorCodec::vws;
}

color::Options encoder_options(const Options& o) {
  color::Options options = o.encoder;
  options.codec = codec_of(o);
  options.threshold = o.threshold.value_or(options.threshold);
  options.weight_bits = o.weight_bits.value_or(options.weight_bits);
  options.effort = o.effort.value_or(options.effort);
  options.quality = o.quality.value_or(options.quality);
  if (o.palette && options.codec == color::ColorCodec::palette) options.palette = *o.palette;
  if (o.palette && options.codec == color::ColorCodec::png)
    options.image_palette = static_cast<int>(*o.palette);
  options.image_curve = o.image_curve == "hilbert" ? color::ImageCurve::hilbert : color::ImageCurve::morton;
  options.curve = o.curve == "hilbert" ? color::Curve::hilbert : color::Curve::morton;
  options.space = o.space == "lab" ? color::ErrorSpace::lab : color::ErrorSpace::rgb;
  options.colors = o.colors == "all" ? color::Colors::all : color::Colors::leaf;
  options.geometry = geometry_of(o);
  options.for_storage = o.purpose == "storage";
  if (options.for_storage && options.zstd == 0) options.zstd = most_zstd_level;
  options.counts = o.counts == "pointer" ? color::Counts::pointer : color::Counts::node;
  return options;
}

/// Options that were given and that had no effect, in words.
std::vector<std::string> unused_options(const Options& o, const color::Report& report) {
  using enum color::ColorCodec;
  const color::ColorCodec codec = report.params.codec;
  const bool blocks = codec == fws || codec == vws, texture = codec == bc1 || codec == bc7 || codec == astc,
             image = codec == jpeg || codec == jp2 || codec == png;
  const struct {
    const char* name;
    bool given, used;
  } options[] = {
      {"--threshold", o.threshold.has_value(), color::has_threshold(codec)},
      {"--space", !o.space.empty(), blocks || codec == predicted},
      {"--weight-bits", o.weight_bits.has_value(), codec == fws},
      {"--palette", o.palette.has_value(), codec == palette || codec == png},
      {"--effort", o.effort.has_value(), blocks || texture || codec == palette || !report.attributes.empty()},
      {"--quality", o.quality.has_value(), codec == astc || image},
      {"--image-curve", !o.image_curve.empty(), texture || image},
  };
  std::vector<std::string> notes;
  for (const auto& option : options)
    if (option.given && !option.used)
      notes.push_back(
          fmt::format("{}: --codec {} has no use for it", option.name, color::part_codec(codec).name));
  std::set<color::Attribute> has;
  for (const color::AttributeParams& attribute : report.attributes) has.insert(attribute.attribute);
  for (size_t i = 0; i < o.encoder.attribute_thresholds.size(); ++i)
    if (o.encoder.attribute_thresholds[i] && !has.contains(static_cast<color::Attribute>(i)))
      notes.push_back(fmt::format("--attribute-threshold: it has no {}", color::attribute_kinds[i].name));
  return notes;
}

/// The inputs, in words.
std::string input_of(const Options& o) {
  return fmt::format("{}", fmt::join(o.names, " "));
}

/// Of a side of the grid that was asked for.
int64_t resolution_of(const VolumeInfo& info) {
  return std::max({info.dims.x, info.dims.y, info.dims.z});
}

Json json_of(const Encoding& encoding, const Run& run, const color::Report& report, const Options& o,
             const std::vector<std::string>& notes, const std::optional<color::SurfaceDiff>& diff) {
  const color::Params& p = report.params;
  Json json = encoding_json(encoding, run, params_json(p));
  json.set("resolution", resolution_of(encoding.info));
  add_sizes(p, json);
  if (!report.attributes.empty()) json.set("attributes", attributes_json(report.attributes, p.leaf_voxels));
  json.set("color_percent", color_percent(p));
  json.set("color_bits_per_voxel", 8 * static_cast<double>(p.color_bytes) /
                                       static_cast<double>(std::max<uint64_t>(p.leaf_voxels, 1)));
  json.set("geometry_bytes", p.dag_bytes).set("grmse", p.grmse).set("max_distance", report.most_error);
  json.set("emissive", o.emissive);
  if (o.names.size() > 1) {
    Json inputs = Json::array();
    for (const std::string& name : o.names) inputs.push(std::string_view(name));
    json.set("inputs", std::move(inputs));
  }
  Json list = Json::array();
  for (const std::string& note : notes) list.push(std::string_view(note));
  json.set("notes", std::move(list));
  json.set("build_seconds", report.build_seconds).set("color_seconds", report.color_seconds);
  if (diff)
    json.set("rmse", diff->rmse).set("psnr_db", diff->psnr_db).set("max_abs_error", diff->max_abs_error);
  return json;
}

/// Notes quote files: control characters become '?'.
std::vector<std::string> printable(std::vector<std::string> notes) {
  for (std::string& note : notes)
    for (char& c : note)
      if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = '?';
  return notes;
}

/// What is encoded, and what is already.
Result<TiledSurface> open_what(const Options& o, const color::Options& options, Context& ctx) {
  if (!o.tiles.empty()) {
    if (o.surface.resolution) return bad_usage("--resolution: tiles are of voxels: leave it out");
    if (o.encoder.simplify > 0) return bad_usage("--simplify: tiles are of voxels: leave it out");
    if (o.names.size() > 1 || !o.places.empty())
      return bad_usage("--tiles: expected one .dagc file, and no --at");
    VOX_TRY(TiledSurface tiled, open_tiled(o.names.front(), o.tiles, options, ctx));
    VOX_TRY(tiled.source, with_wanted(std::move(tiled.source), o.attributes, o.names.front()));
    return tiled;
  }
  SurfaceOptions surface = o.surface;
  surface.emission = o.emissive == "add";
  surface.attributes = o.attributes;
  surface.open.outputs = {o.output};
  surface.kind = o.kind == "thin" ? color::SurfaceKind::thin : color::SurfaceKind::conservative;
  TiledSurface opened;
  std::vector<PlacedInput> inputs;
  for (const std::string& name : o.names) {
    const auto at = o.places.find(inputs.size());
    inputs.push_back({name, at == o.places.end() ? std::nullopt : std::optional(at->second)});
  }
  VOX_TRY(opened.source, open_surfaces(inputs, surface, ctx));
  return opened;
}

Result<int> work(const Options& o, Run& run) {
  const std::string input = input_of(o);
  for (const std::string& name : o.names) VOX_CHECK(check_encoding(name, o.output, o.verify, run));
  const color::Options options = encoder_options(o);
  VOX_CHECK(color::validate(options));
  run.stage("read");
  VOX_TRY(TiledSurface opened, open_what(o, options, run.ctx));
  const VolumeInfo info = opened.source->info();
  std::vector<std::string> notes = printable(opened.source->notes());
  const bool emits = opened.source->emits();
  VOX_TRY(auto out, OutputFile::create(o.output, run.options.force));
  run.stage("encode");
  const double start = run.seconds();
  VOX_TRY(const color::Report report, color::encode(
                                          *opened.source, options, opened.stored,
                                          [&](auto bytes) { return out->write(bytes); }, run.ctx));
  const color::Params& p = report.params;
  if (p.leaf_voxels == 0)
    return bad_input(input, "nothing is left of it: expected voxels that are not void, at least half opaque");
  const Encoding encoding{input, o.output, info, out->position(), run.seconds() - start, {}};

  std::optional<color::SurfaceDiff> diff;
  if (o.verify) {
    run.stage("verify");
    VOX_TRY(opened, open_what(o, options, run.ctx));
    VOX_TRY(const Input decoded, open_compressed(out->temporary(), 0, run.ctx));
    color::SimplifiedSurface simplified(*opened.source, options.simplify);
    VOX_TRY(diff, color::compare(simplified, *decoded.color, run.ctx));
    const double bound = color::has_threshold(p.codec) ? p.threshold : report.most_error;
    const std::string broken = broken_attributes(*diff, report.attributes);
    if (!broken.empty()) {
      cli::report(run.tool, {ErrorCode::internal, o.output,
                             fmt::format("verification failed: {}; nothing was written", broken)});
      return 1;
    }
    if (!diff->same_voxels || diff->max_distance > bound) {
      cli::report(run.tool,
                  {ErrorCode::internal, o.output,
                   fmt::format("verification failed: {}, greatest error {:.6g}: expected at most {}; nothing "
                               "was written",
                               diff->same_voxels ? "all voxels are there" : "voxels differ",
                               diff->max_distance, bound)});
      return 1;
    }
  }
  VOX_CHECK(out->commit());
  for (const std::string& note : notes)
    run.say(o.names.size() > 1 ? note : fmt::format("{}: {}", input, note));
  const std::vector<std::string> unused = unused_options(o, report);
  for (const std::string& note : unused) run.say(note);
  notes.insert(notes.end(), unused.begin(), unused.end());
  if (run.options.json) VOX_CHECK(run.print_result(json_of(encoding, run, report, o, notes, diff)));
  if (!run.options.quiet && !run.options.json)
    tell(fmt::format(
        "{}: {} voxels in {} bytes: geometry {}, colors {} ({:.4g} %){}{}{}, error {:.4g}, in {:.2f} s{}",
        o.output, p.leaf_voxels, encoding.file_bytes, p.dag_bytes, p.color_bytes, color_percent(p),
        attribute_bytes_text(report.attributes),
        p.simplify > 0 ? fmt::format(", simplified: {:.4g} voxels off", p.hausdorff) : "",
        emits ? ", emission added" : "", p.grmse, encoding.seconds,
        diff ? fmt::format(", greatest error {:.4g}", diff->max_distance) : ""));
  return 0;
}

/// All inputs as one surface, or each as its own.
Result<int> work_on_all(const Options& o, Run& run) {
  Options options = o;
  if (!names_many(o.batch) && !o.batch.recursive) {
    options.names = o.batch.inputs;
    options.output = o.batch.output;
    return is_done(o.batch, options.output, run) ? Result<int>(0) : work(options, run);
  }
  if (!o.places.empty()) return bad_usage("--at: of inputs that become one surface: expected one output");
  return run_batch(o.batch, {".dagc", is_surface_file}, run, [&](const Job& job, Run& own) {
    options.names = {job.input};
    options.output = job.output;
    return work(options, own);
  });
}

}  // namespace
}  // namespace voxkit::cli

int main(int argc, char** argv) {
  using namespace voxkit::cli;
  Options options;
  return run_tool(
      argc, argv, "dagcolor-pack", "Compresses a coloured surface: geometry as a DAG, colours apart from it.",
      "  dagcolor-pack menger:5 -o sponge.dagc\n"
      "  dagcolor-pack house.glb -o house.dagc --resolution 4096\n"
      "  dagcolor-pack terrain:2048 -o hamlet.dagc\n"
      "  dagcolor-pack model.nrrd -o model.dagc --threshold 6.38 --verify\n"
      "  dagcolor-pack model.nrrd -o model.dagc --codec raw\n"
      "  dagcolor-pack house.glb -o house.dagc --codec bc1 --image-curve hilbert\n"
      "  dagcolor-pack house.glb tree.ply --at 12,0,-3.5 -o garden.dagc\n"
      "  dagcolor-pack house.dagc -o coarse.dagc --resolution 512\n"
      "  dagcolor-pack scan.ply -o scan.dagc --attributes color,normal,id\n"
      "  dagcolor-pack house.dagc --tiles tile-%04d.dds -o other.dagc --codec bc7\n",
      [&](CommandLine& line) { declare(line, options); },
      [&](Run& run) { return work_on_all(options, run); });
}
