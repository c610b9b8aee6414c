// svmm-encode: a volume as sparse voxel mip-maps.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "formats/copy.h"
#include "formats/full_scale.h"
#include "formats/output_file.h"
#include "formats/spool.h"
#include "libsvmm/packed/packed.h"
#include "libsvmm/svmm.h"
#include "tools/common/batch.h"
#include "tools/common/encoding.h"
#include "tools/common/retype.h"
#include "tools/common/svmm_report.h"

namespace voxkit::cli {
namespace {

struct Options {
  Batch batch;
  std::string input, output;  ///< of one encoding
  OpenOptions open;
  std::optional<double> quality, delta;
  std::string layout;
  // Of layouts plain and thesis.
  std::vector<int64_t> blockwidths;
  std::optional<int64_t> rootwidth;
  std::string base, bound, alpha_weight;
  // Of layout packed.
  std::string levels, page;
  std::optional<double> max_error, target_psnr, target_bpv;
  std::optional<ValueRange> range;
  int zstd = 0;
  bool verify = false;

  bool has_blocks_option() const {
    return !blockwidths.empty() || rootwidth || !base.empty() || !bound.empty() || !alpha_weight.empty() ||
           zstd != 0;
  }
  bool has_pages_option() const {
    return max_error || target_psnr || target_bpv || !levels.empty() || !page.empty();
  }
  bool is_packed() const { return layout == "packed" || (layout.empty() && !has_blocks_option()); }
};

void declare(CommandLine& line, Options& o) {
  declare_batch(line, "Volume file, folder or pattern of images, built-in such as menger:5, or -", ".svmm",
                o.batch);
  line.option("-w,--blockwidth", "W[,W...]",
              "Block widths, powers of two, base level first, the last for all levels above; 0: stepped 2, "
              "4, 8 ... (0)",
              [&o](const std::string& text) -> Status {
                VOX_TRY(o.blockwidths, read_integers(text, 0, svmm::max_blockwidth));
                return {};
              });
  line.option("-r,--rootwidth", "R", "The level with no side above R is the root (32)",
              integer(o.rootwidth, 1, max_side));
  line.option("-q,--quality", "Q",
              "0 to 100; 100 is lossless (90, of labels 100). In this tool -q is not --quiet",
              number(o.quality, 0, 100));
  line.option("--delta", "D", "In place of a quality: distance allowed, as a fraction of full scale",
              number(o.delta, 0, 1e9));
  line.option("-b,--base", "BASE", "Base level: raw bitmap alpha gray bc1 (raw)",
              one_of(o.base, {"raw", "bitmap", "alpha", "gray", "bc1"}));
  line.option("--layout", "LAYOUT",
              "packed: entropy-coded pages, the smallest; plain: blocks, the fastest to look up; thesis: the "
              "published bits, sizes and stop rule (packed, or plain with an option of blocks)",
              one_of(o.layout, {"plain", "thesis", "packed"}));
  line.option("--max-error", "E",
              "Of layout packed, in place of a quality: greatest error, in units of samples",
              number(o.max_error, 0, 1e300));
  line.option("--target-psnr", "DB",
              "Of layout packed, in place of a quality: finds the greatest error that leads to so many dB",
              number(o.target_psnr, 1, 1000));
  line.option(
      "--target-bpv", "B",
      "Of layout packed, in place of a quality: finds the greatest error that leads to so many bits a "
      "voxel, of the whole file",
      number(o.target_bpv, 0.001, 1000));
  line.option(
      "--levels", "on|off",
      "Of layout packed: coarser levels, for views from afar; colours and 8 bits within 2 of means (on)",
      one_of(o.levels, {"on", "off"}));
  line.option("--page", "N",
              "Of layout packed: voxels along a page's side, 16, or 8 for quicker single voxels (16)",
              one_of(o.page, {"16", "8"}));
  line.option(
      "--bound", "BOUND",
      "global: no voxel is further than delta from the original; local: than from the level below (global)",
      one_of(o.bound, {"local", "global"}));
  line.option("--alpha-weight", "on|off", "Weigh colours by alpha in averages (on; thesis: off)",
              one_of(o.alpha_weight, {"on", "off"}));
  declare_range_option(
      line, o.range,
      "Sample values of 16 bit and float volumes that are full scale (default: 0 to as many bits as the "
      "greatest sample needs; of floats, measured)");
  declare_zstd(line, o.zstd);
  line.flag("--verify",
            "Decode and compare before the output appears; exit 1 if the promised bound is broken", o.verify);
  declare_input_options(line, o.open);
}

/// What is asked for, or else 90, or 100 where voxels cannot be off.
double quality_of(const Options& o, const VolumeInfo& info) {
  return o.quality.value_or(svmm::may_be_off(info) ? 90 : 100);
}

/// Everything but full_scale, which may need the voxels.
Result<svmm::Params> params_of(const Options& o, const VolumeInfo& info) {
  using namespace svmm;
  Params params;
  params.layout = o.layout == "thesis" ? Layout::thesis : Layout::plain;
  for (const Base base : {Base::raw, Base::bitmap, Base::alpha, Base::gray, Base::bc1})
    if (name(base) == (o.base.empty() ? "raw" : o.base)) params.base = base;
  const bool thesis = params.layout == Layout::thesis;
  params.bound = o.bound == "local" || (o.bound.empty() && thesis) ? Bound::local : Bound::global;
  params.alpha_weight = o.alpha_weight == "on" || (o.alpha_weight.empty() && !thesis);
  if (o.blockwidths != std::vector<int64_t>{0}) {
    for (const int64_t w : o.blockwidths) params.blockwidths.push_back(static_cast<int>(w));
  }
  params.rootwidth = o.rootwidth.value_or(32);
  params.zstd = o.zstd;
  if (o.quality && o.delta) return bad_usage("--quality and --delta: expected one of them");
  params.quality = o.delta ? -1 : quality_of(o, info);
  params.delta = o.delta ? *o.delta : delta_of_quality(params.quality, info.format, params.layout);
  return params;
}

/// Lossless means identical; bound global with a raw base promises a distance.
bool keeps_promise(const svmm::Params& params, const VolumeDiff& diff) {
  if (params.base != svmm::Base::raw || params.layout != svmm::Layout::plain)
    return true;  // these promise nothing
  if (params.delta == 0) return diff.differing_voxels == 0;
  return params.bound == svmm::Bound::local || diff.max_distance <= params.delta * params.full_scale;
}

Json json_of(const Encoding& encoding, const Run& run, const svmm::Params& params,
             std::span<const svmm::Level> levels) {
  Json json = encoding_json(encoding, run, params_json(params));
  if (params.layout == svmm::Layout::thesis) json.set("thesis_bytes", svmm::thesis_bytes(levels));
  json.set("levels", levels_json(levels));
  add_verified(encoding, json);
  return json;
}

/// Compares what was written with the source, and says where it is further off than promised: then nothing is
/// to appear.
Result<bool> holds(std::unique_ptr<VolumeSource>& source, Inputs& inputs, const OutputFile& out,
                   const Options& o, double promised, const std::function<bool(const VolumeDiff&)>& kept,
                   Encoding& encoding, Run& run) {
  run.stage("verify");
  if (source->forward_only()) {
    VOX_TRY(source, inputs.open(true));
  }
  VOX_TRY(const Input decoded, open_compressed(out.temporary(), 0, run.ctx));
  VOX_TRY(encoding.diff, diff_volumes(*source, *decoded.source, std::nullopt, nullptr, run.ctx));
  if (kept(*encoding.diff)) return true;
  report(run.tool,
         {ErrorCode::internal, o.output,
          fmt::format("verification failed: greatest error {}: expected at most {}; nothing was written",
                      encoding.diff->max_distance, promised)});
  return false;
}

std::optional<svmm::PackedTarget> target_of(const Options& o) {
  using Kind = svmm::PackedTarget::Kind;
  if (o.target_psnr) return svmm::PackedTarget{Kind::psnr, *o.target_psnr};
  if (o.target_bpv) return svmm::PackedTarget{Kind::bits, *o.target_bpv};
  return std::nullopt;
}

/// Full scale: what --range says, or else, unless nothing depends on it, what is measured. A value of floats
/// that stands for nothing is looked for on the way.
Result<double> scale_of(const Options& o, bool lossless, std::unique_ptr<VolumeSource>& source,
                        Inputs& inputs, Run& run) {
  if (o.range) return o.range->hi - o.range->lo;
  ValueRange range{0, 1};
  const VoxelFormat format = source->info().format;
  if (!lossless && format == VoxelFormat::float32) {
    VOX_TRY(const Census census, look_at_floats(source, inputs, o.input, run));
    range = census.range;
  } else if (!lossless && !o.max_error && !target_of(o) && format == VoxelFormat::density16) {
    run.stage("measure");
    VOX_TRY(range, measure_range(*source, run.ctx));
    if (source->forward_only()) {
      VOX_TRY(source, inputs.open(true));
    }
  }
  return full_scale(source->info(), range);
}

Status check_packed(const Options& o) {
  if (o.has_blocks_option())
    return bad_usage(
        "--blockwidth, --rootwidth, --base, --bound, --alpha-weight, --zstd: not of --layout packed");
  if (o.quality.has_value() + o.delta.has_value() + o.max_error.has_value() + o.target_psnr.has_value() +
          o.target_bpv.has_value() >
      1)
    return bad_usage("--quality, --delta, --max-error, --target-psnr and --target-bpv: expected one of them");
  if (o.range && (o.max_error || target_of(o)))
    return bad_usage("--range: of --quality and --delta, which are fractions of it");
  return {};
}

Result<int> work_packed(const Options& o, Inputs& inputs, Run& run) {
  VOX_CHECK(check_packed(o));
  VOX_TRY(auto source, inputs.open(true));
  const VoxelFormat format = source->info().format;
  svmm::PackedOptions options;
  options.page_side = o.page == "8" ? 8 : 16;
  options.levels = o.levels != "off";
  const double delta =
      o.delta ? *o.delta : svmm::delta_of_quality(quality_of(o, source->info()), format, svmm::Layout::plain);
  options.target = target_of(o);
  const bool lossless = o.max_error ? *o.max_error == 0 : delta == 0 && !options.target;
  VOX_TRY(const double scale, scale_of(o, lossless, source, inputs, run));
  if (!options.target) options.max_error = o.max_error.value_or(delta * scale);
  const VolumeInfo info = source->info();
  run.stage("read");
  VOX_TRY(source, spooled(std::move(source), run.ctx));
  VOX_TRY(auto out, OutputFile::create(o.output, run.options.force));
  run.stage("encode");
  const double start = run.seconds();
  VOX_TRY(const svmm::PackedParams params,
          svmm::encode_packed(
              *source, options, [&](auto bytes) { return out->write(bytes); }, run.ctx));
  Encoding encoding{o.input, o.output, info, out->position(), run.seconds() - start, {}};
  const bool exact =
      format == VoxelFormat::float32 ? params.map.kind == svmm::CodeKind::ordered : params.max_error < 1;
  encoding.lossless = exact && !info.rounded;
  if (o.verify) {
    const auto kept = [&](const VolumeDiff& diff) {
      return exact ? diff.differing_voxels == 0
                   : (is_color(format) ? diff.max_distance : diff.max_abs_error) <= params.max_error;
    };
    VOX_TRY(const bool held, holds(source, inputs, *out, o, params.max_error, kept, encoding, run));
    if (!held) return 1;
  }
  Json json = encoding_json(encoding, run, params_json(params));
  if (run.options.json) {
    VOX_TRY(const Input written, open_compressed(out->temporary(), 0, run.ctx));
    json.set("levels", levels_json(*written.packed));
    add_verified(encoding, json);
  }
  VOX_CHECK(out->commit());
  if (run.options.json) VOX_CHECK(run.print_result(json));
  if (!run.options.quiet && !run.options.json) print_encoding(encoding);
  return 0;
}

Result<int> work(const Options& o, Run& run) {
  VOX_CHECK(check_encoding(o.input, o.output, o.verify, run));
  OpenOptions open = o.open;
  open.outputs = {o.output};
  Inputs inputs(o.input, open, run.ctx);
  if (o.is_packed()) return work_packed(o, inputs, run);
  if (o.has_pages_option())
    return bad_usage(fmt::format(
        "--max-error, --target-psnr, --target-bpv, --levels, --page: of --layout packed only{}",
        o.layout.empty() ? ", which has no --blockwidth, --rootwidth, --base, --bound, --alpha-weight, --zstd"
                         : ""));
  const bool may_lose = o.delta ? *o.delta > 0 : o.quality.value_or(90) < 100;
  VOX_TRY(auto source, inputs.open(o.verify || (may_lose && !o.range)));
  VOX_TRY(svmm::Params params, params_of(o, source->info()));
  VOX_CHECK(svmm::validate(params, source->info()));
  const VoxelFormat format = source->info().format;
  if (o.range && format != VoxelFormat::density16 && format != VoxelFormat::float32)
    return bad_usage(
        fmt::format("--range: {} voxels{} have a full scale of their own: expected 16 bit or float voxels",
                    type_name(source->info()), source->info().has_wide_base() ? ", held in 8 bits," : ""));
  VOX_TRY(params.full_scale, scale_of(o, params.delta == 0, source, inputs, run));
  const VolumeInfo info = source->info();

  VOX_TRY(auto out, OutputFile::create(o.output, run.options.force));
  run.stage("encode");
  const double start = run.seconds();
  VOX_TRY(const auto levels, svmm::encode(
                                 *source, params, [&](auto bytes) { return out->write(bytes); }, run.ctx));
  Encoding encoding{o.input, o.output, info, out->position(), run.seconds() - start, {}};
  encoding.lossless = params.delta == 0 && params.base == svmm::Base::raw &&
                      params.layout == svmm::Layout::plain && !info.rounded;

  if (o.verify) {
    const auto kept = [&](const VolumeDiff& diff) { return keeps_promise(params, diff); };
    VOX_TRY(const bool held,
            holds(source, inputs, *out, o, params.delta * params.full_scale, kept, encoding, run));
    if (!held) return 1;
  }
  VOX_CHECK(out->commit());
  if (run.options.json) VOX_CHECK(run.print_result(json_of(encoding, run, params, levels)));
  if (!run.options.quiet && !run.options.json) print_encoding(encoding);
  return 0;
}

Result<int> work_on_all(const Options& o, Run& run) {
  return run_batch(o.batch, {".svmm", is_volume_file}, run, [&](const Job& job, Run& own) {
    Options options = o;
    options.input = job.input;
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
      argc, argv, "svmm-encode", "Compresses a volume as sparse voxel mip-maps.",
      "  svmm-encode head.nii.gz -o head.svmm\n"
      "  svmm-encode head.nii.gz -o head.svmm --quality 100 --verify\n"
      "  svmm-encode head.nii.gz -o head.svmm --target-psnr 45\n"
      "  svmm-encode menger:6 -o menger.svmm --blockwidth 4 --base bitmap --quality 80\n"
      "  svmm-encode scan.raw --dims 512,512,361 --type u16 -o - --max-error 2 > scan.svmm\n",
      [&](CommandLine& line) { declare(line, options); },
      [&](Run& run) { return work_on_all(options, run); });
}
