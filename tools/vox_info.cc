// vox-info: what is in a volume file, without decoding it.
#include <fmt/core.h>

#include "formats/container.h"
#include "formats/copy.h"
#include "formats/volume/facts.h"
#include "formats/volume/open_volume.h"
#include "formats/volume/readers.h"
#include "formats/volume/volume_formats.h"
#include "libsvmm/packed/needed_ranges.h"
#include "tools/common/attributes.h"
#include "tools/common/color_report.h"
#include "tools/common/formats_report.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"
#include "tools/common/stats_report.h"
#include "tools/common/svmm_report.h"
#include "tools/common/vq_report.h"

namespace voxkit::cli {
namespace {

struct Options {
  std::string file;
  OpenOptions open;
  bool check = false, formats = false, ranges = false, stats = false;
  std::optional<Box> roi;
  std::optional<int64_t> level;
};

void declare(CommandLine& line, Options& o) {
  line.argument("FILE", "Volume file, folder, built-in or -", o.file, false);
  line.flag("--formats", "List the formats of volumes, and what files of each hold, instead", o.formats);
  line.flag("--check", "Verify every checksum and the whole structure; exit 1 if something is wrong",
            o.check);
  line.flag("--stats",
            "Read all voxels, too: extremes, mean, deviation, percentiles, entropy, histogram, share of void",
            o.stats);
  line.flag("--ranges",
            "List the bytes of a packed .svmm that a view needs, in the order to fetch them, instead",
            o.ranges);
  line.option("--roi", "BOX", "Of --ranges: X0,Y0,Z0,X1,Y1,Z1, half open, in voxels of level 0 (all)",
              box(o.roi));
  line.option("--level", "L", "Of --ranges: the finest level that is seen (0)",
              integer(o.level, 0, svmm::max_packed_levels - 1));
  declare_input_options(line, o.open);
}

std::string_view format_of(const std::string& file, const Input& input) {
  if (input.svmm || input.packed) return "svmm";
  if (input.vq) return "vqv";
  if (input.color) return "dagc";
  if (is_builtin(file)) return "builtin";
  return input.format ? input.format->name : "slices";
}

std::string_view codec_of(const Input& input) {
  return input.svmm || input.packed ? "svmm" : input.vq ? "vq" : input.color ? "dagcolor" : "none";
}
std::string letters(uint32_t kind) {
  std::string text;
  for (int i = 0; i < 4; ++i) text += static_cast<char>(kind >> (8 * i) & 0xff);
  return text;
}

/// The container of a compressed volume; null for others.
const Container* container_of(const Input& input) {
  return input.svmm     ? &input.svmm->container()
         : input.packed ? &input.packed->container()
         : input.vq     ? &input.vq->container()
         : input.color  ? &input.color->container()
                        : nullptr;
}

Json json_of(const Options& o, const Run& run, const Input& input, std::optional<uint64_t> bytes) {
  const VolumeInfo& info = input.source->info();
  Json json = Json::result();
  json.set("tool", run.tool).set("version", version_text()).set("input", o.file);
  json.set("format", format_of(o.file, input)).set("codec", codec_of(input));
  json.set("dims", info.dims).set("voxel_format", voxkit::name(info.format));
  if (!is_color(info.format)) json.set("sample_type", voxkit::name(info.sample_type));
  json.set("raw_bytes", raw_bytes(info));
  if (bytes) {
    json.set("file_bytes", *bytes);
    json.set("percent", 100 * static_cast<double>(*bytes) / static_cast<double>(raw_bytes(info)));
    json.set("bits_per_voxel",
             8 * static_cast<double>(*bytes) / static_cast<double>(*checked_voxels(info.dims)));
  }
  Json spacing = Json::array(), origin = Json::array(), affine = Json::array();
  const Affine::Vector lengths = info.affine.spacing();
  for (size_t a = 0; a < 3; ++a) {
    spacing.push(lengths[a]);
    origin.push(info.affine.origin[a]);
    Json row = Json::array();
    for (size_t b = 0; b < 3; ++b) row.push(info.affine.axes[b][a]);
    row.push(info.affine.origin[a]);
    affine.push(std::move(row));
  }
  json.set("spacing", std::move(spacing)).set("origin", std::move(origin)).set("affine", std::move(affine));
  json.set("world", voxkit::name(info.world)).set("unit", voxkit::name(info.unit));
  json.set("orientation", orientation(info.affine, info.world));
  json.set("slope", info.slope).set("intercept", info.intercept);
  if (!info.description.empty()) json.set("description", info.description);
  if (info.fill) json.set("fill", info.sample(*info.fill));
  if (info.is_labels) json.set("labels", true);
  if (info.labels) json.set("different_values", static_cast<uint64_t>(info.labels->size()));
  if (!info.parts.empty()) {
    Json parts = Json::array();
    for (const std::string& part : info.parts) parts.push(part);
    json.set("parts", std::move(parts));
  }
  json.set("params", input.svmm     ? params_json(input.svmm->params())
                     : input.packed ? params_json(input.packed->params())
                     : input.vq     ? params_json(input.vq->params())
                     : input.color  ? params_json(input.color->params())
                                    : Json::object());
  Json chunks = Json::array();
  if (const Container* container = container_of(input)) {
    for (const ChunkEntry& entry : container->table()) {
      Json chunk = Json::object();
      chunk.set("kind", letters(entry.kind)).set("index", entry.index).set("part", entry.part);
      chunk.set("offset", entry.offset).set("length", entry.stored);
      if (entry.compressed()) chunk.set("plain_length", entry.length);
      chunk.set("checksum", fmt::format("{:016x}", entry.checksum));
      chunks.push(std::move(chunk));
    }
  }
  json.set("chunks", std::move(chunks));
  if (input.svmm) {
    json.set("levels", levels_json(input.svmm->levels()));
  }
  if (input.packed) json.set("levels", levels_json(*input.packed));
  if (input.vq) add_sizes(input.vq->params(), json);
  if (input.color) {
    add_sizes(input.color->params(), json);
    if (const auto& attributes = input.color->attributes(); !attributes.empty())
      json.set("attributes", attributes_json(attributes, input.color->params().leaf_voxels));
  }
  if (o.check) json.set("checked", true);
  return json;
}

/// A line of chunks that are compressed; nothing if there are none.
std::string compression_text(const Container& container) {
  uint64_t chunks = 0, stored = 0, plain = 0;
  for (const ChunkEntry& entry : container.table()) {
    chunks += entry.compressed();
    stored += entry.stored;
    plain += entry.length;
  }
  if (chunks == 0) return {};
  return fmt::format("zstd        {} of {} chunks, {} bytes of {}\n", chunks, container.table().size(),
                     stored, plain);
}

/// The type of voxels, and of integers that are held in fewer bits than they have in how many: so many are
/// the raw bytes.
std::string type_text(const VolumeInfo& info) {
  const std::string_view type = type_name(info);
  if (is_color(info.format)) return std::string(type);
  if (!is_wide(info.sample_type)) return fmt::format("{} ({})", type, voxkit::name(info.sample_type));
  if (!info.has_wide_base()) return fmt::format("{} (held in floats of 32 bits)", type);
  return fmt::format("{} (held in {} bits)", type, 8 * voxel_bytes(info.format));
}

/// Where the volume is: in a line, and another one where its axes are not those of the world.
std::string place_text(const VolumeInfo& info) {
  const Affine& at = info.affine;
  const Affine::Vector spacing = at.spacing();
  std::string text = fmt::format("spacing     {:.6g} {:.6g} {:.6g}, origin {:.6g} {:.6g} {:.6g}", spacing[0],
                                 spacing[1], spacing[2], at.origin[0], at.origin[1], at.origin[2]);
  if (info.unit != Unit::unknown) text += fmt::format(" {}", voxkit::name(info.unit));
  if (info.world != World::unknown) text += fmt::format(", {}", voxkit::name(info.world));
  text += "\n";
  if (!at.is_plain()) {
    text += fmt::format("axes        {}:", orientation(at, info.world));
    for (const Affine::Vector& axis : at.axes)
      text += fmt::format(" ({:.6g},{:.6g},{:.6g})", axis[0], axis[1], axis[2]);
    text += "\n";
  }
  return text;
}

std::string text_of(const Options& o, const Input& input, std::optional<uint64_t> bytes) {
  const VolumeInfo& info = input.source->info();
  std::string text = fmt::format("{}: {}\n", o.file, format_of(o.file, input));
  text +=
      fmt::format("voxels      {} x {} x {} {}\n", info.dims.x, info.dims.y, info.dims.z, type_text(info));
  text += place_text(info);
  if (info.slope != 1 || info.intercept != 0)
    text += fmt::format("real value  {:.6g} * sample + {:.6g}\n", info.slope, info.intercept);
  if (info.fill) text += fmt::format("fill value  {:.9g}\n", info.sample(*info.fill));
  if (info.labels) text += fmt::format("values      {} different ones\n", info.labels->size());
  if (info.is_labels) text += "meaning     labels\n";
  if (!info.description.empty()) text += fmt::format("description {}\n", text_field(info.description));
  for (const std::string& part : info.parts) text += fmt::format("part        {}\n", part);
  text += fmt::format("raw bytes   {}\n", raw_bytes(info));
  if (bytes)
    text += fmt::format("file bytes  {} ({:.4g} %, {:.4g} bits a voxel)\n", *bytes,
                        100 * static_cast<double>(*bytes) / static_cast<double>(raw_bytes(info)),
                        8 * static_cast<double>(*bytes) / static_cast<double>(*checked_voxels(info.dims)));
  if (const Container* container = container_of(input)) text += compression_text(*container);
  if (input.svmm) {
    const svmm::Params& p = input.svmm->params();
    text += fmt::format(
        "params      layout {}, base {}, bound {}, quality {:.6g}, delta {:.6g}, rootwidth {}\n",
        cli::name(p.layout), cli::name(p.base), cli::name(p.bound), p.quality, p.delta, p.rootwidth);
    text += "level  width  factor  dims                    blocks  block bytes  terminal voxels\n";
    int index = 0;
    for (const svmm::Level& l : input.svmm->levels())
      text += fmt::format("{:>5}  {:>5}  {:>6}  {:<18}  {:>10}  {:>11}  {:>15}\n", index++, l.blockwidth,
                          l.mip_factor, fmt::format("{} x {} x {}", l.dims.x, l.dims.y, l.dims.z), l.blocks,
                          l.block_bytes, l.terminal_voxels);
  }
  if (input.packed) text += levels_text(*input.packed);
  if (input.vq) text += sizes_text(*input.vq);
  if (input.color) {
    text += sizes_text(input.color->params());
    text += attributes_text(input.color->attributes(), input.color->params().color_count);
  }
  if (o.check) text += "check       passed\n";
  return text;
}

/// Bytes of all files that a volume consists of.
std::optional<uint64_t> bytes_of(const VolumeInfo& info, const std::string& name) {
  if (info.files.empty()) return file_bytes(name);
  uint64_t total = 0;
  for (const std::string& file : info.files) total += file_bytes(file).value_or(0);
  return total;
}

/// Takes voxels and keeps none: to check a plain volume is to read it.
class NullSink : public VolumeSink {
 public:
  Status write(int64_t, int64_t, ConstVoxelSpan) override { return {}; }
  Status finish() override { return {}; }
};

/// Floats are read twice: their range comes first. What --check has read front to back is opened again.
Result<VolumeStats> stats_of(const Options& o, const OpenOptions& open, const Input& input, Run& run) {
  run.stage("stats");
  const bool floats = input.source->info().format == VoxelFormat::float32,
             used_up = o.check && input.source->forward_only();
  if (!floats && !used_up) return volume_stats(*input.source, {}, run.ctx);
  if (o.file == "-")
    return bad_usage("--stats: of floats, or with --check: a stream cannot be looked at twice: name a file");
  ValueRange range;
  if (floats) {
    VOX_TRY(const Input measured, open_input(o.file, open, run.ctx));
    VOX_TRY(range, measure_range(*measured.source, run.ctx));
  }
  VOX_TRY(const Input again, open_input(o.file, open, run.ctx));
  return volume_stats(*again.source, range, run.ctx);
}

/// The bytes that a view needs, with their sum.
Result<int> list_ranges(const Options& o, const Input& input, Run& run) {
  if (!input.packed) return bad_usage("--ranges: expected a .svmm file of layout packed");
  const svmm::PackedVolume& volume = *input.packed;
  const int64_t level = o.level.value_or(volume.finest());
  if (level < volume.finest() || level >= volume.params().levels)
    return bad_usage(fmt::format("--level: {}: expected {} to {}, which the file has", level, volume.finest(),
                                 volume.params().levels - 1));
  const Index3 dims = volume.levels()[0].dims;
  const Box whole{Index3{0}, dims}, view = o.roi.value_or(whole);
  if (!whole.contains(view) || view.empty())
    return bad_usage(
        fmt::format("--roi: the box is not inside the volume: expected one inside 0,0,0,{},{},{}", dims.x,
                    dims.y, dims.z));
  Json json = Json::array();
  std::string text = "part       from byte         bytes\n";
  uint64_t total = 0;
  for (const svmm::NeededRange& range : svmm::needed_ranges(volume, view, static_cast<int>(level))) {
    const uint64_t bytes = range.end - range.begin;
    total += bytes;
    const bool index = range.level == svmm::NeededRange::index;
    const std::string part = index ? "index" : fmt::format("level {}", range.level);
    text += fmt::format("{:<8}  {:>10}  {:>12}\n", part, range.begin, bytes);
    Json row = Json::object();
    row.set("part", part).set("offset", range.begin).set("bytes", bytes);
    json.push(std::move(row));
  }
  const uint64_t of = volume.container().file_bytes();
  text += fmt::format("total     {} of {} bytes, {:.3g} %\n", total, of,
                      100. * static_cast<double>(total) / static_cast<double>(of));
  if (run.options.json) {
    Json all = Json::result();
    all.set("tool", run.tool).set("version", version_text()).set("input", o.file);
    all.set("ranges", std::move(json)).set("bytes", total).set("file_bytes", of);
    VOX_CHECK(print(all.text()));
  } else if (!run.options.quiet) {
    VOX_CHECK(print(text));
  }
  return 0;
}

Result<int> work(const Options& o, Run& run) {
  if (o.formats) {
    if (!o.file.empty()) return bad_usage("--formats: is of no file: leave FILE out");
    VOX_CHECK(print(run.options.json ? formats_json(run).text() : formats_text()));
    return 0;
  }
  if (o.file.empty()) return bad_usage("FILE is required: see --help");
  OpenOptions open = o.open;
  open.any_part = true;
  if (!o.ranges && (o.roi || o.level)) return bad_usage("--roi, --level: of --ranges only");
  if (o.ranges && (o.check || o.stats))
    return bad_usage("--ranges and --check or --stats: expected one of them");
  VOX_TRY(const Input input, open_input(o.file, open, run.ctx));
  if (o.ranges) return list_ranges(o, input, run);
  if (o.check) {
    run.stage("check");
    NullSink sink;
    const Status status = input.svmm     ? input.svmm->check(run.ctx)
                          : input.packed ? input.packed->check(run.ctx)
                          : input.vq     ? input.vq->check(run.ctx)
                          : input.color
                              ? input.color->check(run.ctx)
                              : copy_volume(*input.source, input.source->info().box(), sink, run.ctx);
    if (!status && status.error().code == ErrorCode::input) {
      // The answer of the check is no: not a failure to give one.
      report(run.tool, status.error());
      return 1;
    }
    VOX_CHECK(status);
  }
  std::optional<VolumeStats> stats;
  if (o.stats) {
    VOX_TRY(stats, stats_of(o, open, input, run));
  }
  const Container* container = container_of(input);
  const auto bytes =
      container ? std::optional(container->file_bytes()) : bytes_of(input.source->info(), o.file);
  if (run.options.json) {
    Json json = json_of(o, run, input, bytes);
    if (stats) json.set("stats", stats_json(*stats));
    VOX_CHECK(print(json.text()));
  } else if (!run.options.quiet) {
    VOX_CHECK(print(text_of(o, input, bytes) + (stats ? stats_text(*stats) : "")));
  }
  return 0;
}

}  // namespace
}  // namespace voxkit::cli

int main(int argc, char** argv) {
  using namespace voxkit::cli;
  Options options;
  return run_tool(
      argc, argv, "vox-info", "Shows what is in a volume file.",
      "  vox-info head.nii.gz\n"
      "  vox-info head.svmm --json\n"
      "  vox-info head.vqv --check\n"
      "  vox-info head.nii.gz --stats\n"
      "  vox-info --formats\n",
      [&](CommandLine& line) { declare(line, options); }, [&](Run& run) { return work(options, run); });
}
