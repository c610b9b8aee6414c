// vq-encode: a volume as a codebook of 4^3 bricks.
#include <fmt/core.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "formats/copy.h"
#include "formats/output_file.h"
#include "libvq/error_step.h"
#include "libvq/vq.h"
#include "tools/common/batch.h"
#include "tools/common/encoding.h"
#include "tools/common/vq_report.h"

namespace voxkit::cli {
namespace {

struct Options {
  Batch batch;
  std::string input, output;  ///< of one encoding
  OpenOptions open;
  bool lossless = false;
  std::string codebook = "rbuc", offsets = "auto";
  std::optional<double> max_error;
  uint64_t codewords = 0, reduce = 0;
  std::string seeding;
  std::optional<uint32_t> max_iterations;
  int zstd = 0;
  bool verify = false;
};

void declare(CommandLine& line, Options& o) {
  declare_batch(line, "Volume file, folder or pattern of images, built-in such as sphere:64, or -", ".vqv",
                o.batch);
  line.flag("--lossless", "Every voxel as it is; floats are refused (default, but floats get 65536 levels)",
            o.lossless);
  line.option("--max-error", "E", "No voxel is further than this from the original, in sample values",
              number(o.max_error, 0, std::numeric_limits<double>::max()));
  line.option("-k,--codewords", "K", "Keep so many different bricks, chosen by k-means",
              integer(o.codewords, 1, vq::most_codewords));
  line.option("--reduce", "N", "Keep one of N different bricks", integer(o.reduce, 1, vq::most_codewords));
  line.option("--seeding", "HOW",
              "First centres of k-means: furthest: those furthest from all others; d2: at random, by "
              "squared distance (furthest)",
              one_of(o.seeding, {"furthest", "d2"}));
  line.option("--max-iterations", "N", "Of k-means (until nothing changes)",
              integer(o.max_iterations, 0, 0xfffffffe));
  line.option("--codebook", "BOOK", "rbuc: codewords of variable length; packed: larger, faster (rbuc)",
              one_of(o.codebook, {"rbuc", "packed"}));
  line.option("--offsets", "MAP",
              "What places say: direct: addresses; indirect: numbers; auto: the smaller (auto)",
              one_of(o.offsets, {"auto", "direct", "indirect"}));
  declare_zstd(line, o.zstd);
  line.flag("--verify",
            "Decode and compare before the output appears; exit 1 if the promised bound is broken", o.verify);
  declare_input_options(line, o.open);
}

Result<vq::Options> encoder_options(const Options& o) {
  vq::Options options;
  if (o.lossless + o.max_error.has_value() + (o.codewords > 0) + (o.reduce > 0) > 1)
    return bad_usage("--lossless, --max-error, --codewords and --reduce: expected one of them");
  if ((o.max_iterations || !o.seeding.empty()) && o.codewords == 0 && o.reduce == 0)
    return bad_usage(std::string(o.max_iterations ? "--max-iterations" : "--seeding") +
                     " is for k-means: expected --codewords or --reduce beside it");
  options.max_error = o.max_error;
  options.codewords = o.codewords;
  options.reduce = o.reduce;
  options.zstd = o.zstd;
  options.seeding = o.seeding == "d2" ? vq::Seeding::d2 : vq::Seeding::furthest;
  if (o.max_iterations) options.max_iterations = *o.max_iterations;
  if (o.codebook == "packed") options.codebook = vq::Codebook::packed;
  if (o.offsets == "direct") options.mapping = vq::Mapping::direct;
  if (o.offsets == "indirect") options.mapping = vq::Mapping::indirect;
  return options;
}

bool keeps_promise(const vq::Params& params, const VolumeDiff& diff) {
  if (params.max_error < 0) return true;
  if (params.max_error == 0 && diff.voxel_format != VoxelFormat::float32) return diff.differing_voxels == 0;
  return diff.max_abs_error <= params.max_error;
}

Json json_of(const Encoding& encoding, const Run& run, const vq::Report& report) {
  Json json = encoding_json(encoding, run, params_json(report.params));
  json.set("bricks", report.bricks);
  add_sizes(report.params, json);
  const auto& counts = report.transform_codewords;
  const double all =
      static_cast<double>(std::max<uint64_t>(1, std::accumulate(counts.begin(), counts.end(), uint64_t{0})));
  Json shares = Json::array();
  for (const uint64_t count : counts) shares.push(static_cast<double>(count) / all);
  json.set("iterations", report.params.iterations);
  json.set("seeding_seconds", report.seeding_seconds).set("kmeans_seconds", report.kmeans_seconds);
  json.set("transform_share", std::move(shares)).set("quantisation_error", report.quantisation_error);
  add_verified(encoding, json);
  return json;
}

Result<int> work(const Options& o, Run& run) {
  VOX_CHECK(check_encoding(o.input, o.output, o.verify, run));
  VOX_TRY(vq::Options options, encoder_options(o));

  OpenOptions open = o.open;
  open.outputs = {o.output};
  Inputs inputs(o.input, open, run.ctx);
  // Of floats the range must be known first. What kind of voxels there are, the input tells only when it is
  // open.
  VOX_TRY(auto source, inputs.open(true));
  if (const Status valid = vq::validate(options, source->info()); !valid) {
    Error error = valid.error();
    if (error.code == ErrorCode::input) error.file = o.input;
    return tl::unexpected<Error>(error);
  }
  if (source->info().format == VoxelFormat::float32) {
    VOX_TRY(const Census census, look_at_floats(source, inputs, o.input, run));
    options.range = census.range;
    const bool clusters = options.codewords > 0 || options.reduce > 0;
    options.keep_nan = census.has_nan && !(clusters && !source->info().fill);
    if (source->info().fill) VOX_CHECK(vq::validate(options, source->info()));
  }
  const VolumeInfo info = source->info();
  if (info.is_labels && (options.max_error.value_or(0) > 0 || options.codewords > 0 || options.reduce > 0))
    return bad_usage("labels have no values between them: expected --lossless");
  if (options.max_error.value_or(0) >=
      (info.format == VoxelFormat::float32 ? std::numeric_limits<double>::min() : 2)) {
    run.stage("choose steps");
    VOX_TRY(options.max_error, vq::smallest_error_step(*source, *options.max_error, options, run.ctx));
    if (source->forward_only()) {
      VOX_TRY(source, inputs.open(true));
    }
  }
  VOX_TRY(const double bound, vq::error_bound(options, info));
  if (o.lossless && bound > 0)
    return bad_usage(
        fmt::format("--lossless: {} voxels are quantised to 65536 levels: leave it out, or use --max-error",
                    type_name(info)));

  VOX_TRY(auto out, OutputFile::create(o.output, run.options.force));
  options.clustering = [&run] { run.stage("k-means"); };
  options.clustered = [&run](uint32_t iteration, double psnr_db) {
    run.detail(fmt::format("iteration={} psnr_db={:.4f}", iteration, psnr_db));
  };
  run.stage("encode");
  const double start = run.seconds();
  VOX_TRY(const vq::Report report,
          vq::encode(
              *source, options, [&](auto bytes) { return out->write(bytes); }, run.ctx));
  Encoding encoding{o.input, o.output, info, out->position(), run.seconds() - start, {}};
  encoding.lossless = report.params.max_error == 0 && !report.replaced && !info.rounded;

  if (o.verify) {
    run.stage("verify");
    if (source->forward_only()) {
      VOX_TRY(source, inputs.open(true));
    }
    VOX_TRY(const Input decoded, open_compressed(out->temporary(), 0, run.ctx));
    // What is no number has no error: it is compared with what it was taken for.
    const auto finite =
        report.replaced ? vq::finite_source(*source, options.range, options.keep_nan) : nullptr;
    VOX_TRY(encoding.diff,
            diff_volumes(finite ? *finite : *source, *decoded.source, std::nullopt, nullptr, run.ctx));
    if (!keeps_promise(report.params, *encoding.diff)) {
      cli::report(
          run.tool,
          {ErrorCode::internal, o.output,
           fmt::format("verification failed: greatest error {}: expected at most {}; nothing was written",
                       encoding.diff->max_abs_error, report.params.max_error)});
      return 1;
    }
  }
  VOX_CHECK(out->commit());
  if (run.options.json) VOX_CHECK(run.print_result(json_of(encoding, run, report)));
  if (!run.options.quiet && !run.options.json) print_encoding(encoding);
  if (!run.options.quiet && report.replaced)
    tell(fmt::format("{}: {}: {}", run.tool, o.input,
                     options.keep_nan
                         ? "voxels that are infinite became the least or the greatest value"
                         : "voxels that are NaN or infinite became the least or the greatest value"));
  return 0;
}

Result<int> work_on_all(const Options& o, Run& run) {
  return run_batch(o.batch, {".vqv", is_volume_file}, run, [&](const Job& job, Run& own) {
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
      argc, argv, "vq-encode", "Compresses a scalar volume as a codebook of 4x4x4 bricks.",
      "  vq-encode head.nii.gz -o head.vqv\n"
      "  vq-encode head.nii.gz -o head.vqv --max-error 2 --verify\n"
      "  vq-encode head.nii.gz -o head.vqv --reduce 16 --verify\n"
      "  vq-encode head.nii.gz -o head.vqv --codewords 4096 --codebook packed\n"
      "  vq-encode scan.raw --dims 512,512,361 --type u16 -o - > scan.vqv\n",
      [&](CommandLine& line) { declare(line, options); },
      [&](Run& run) { return work_on_all(options, run); });
}
