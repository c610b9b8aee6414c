#include "tools/common/encoding.h"

#include <fmt/core.h>

#include <cstdio>
#include <utility>

#include "formats/chunk_zstd.h"
#include "formats/input_stream.h"
#include "formats/output_file.h"
#include "tools/common/parse.h"

namespace voxkit::cli {

Result<std::unique_ptr<VolumeSource>> Inputs::open(bool wanted_again) {
  VOX_TRY(auto source, open_as_it_is(wanted_again));
  return found_fill_ ? with_fill(std::move(source), *found_fill_) : std::move(source);
}

Result<std::unique_ptr<VolumeSource>> Inputs::open_as_it_is(bool wanted_again) {
  if (name_ != "-" || (!wanted_again && !spooled_)) {
    VOX_TRY(Input input, open_input(name_, open_, ctx_));
    return std::move(input.source);
  }
  if (!spooled_) {
    VOX_TRY(auto stream, open_stream("-"));
    VOX_TRY(spooled_, MappedFile::spool(*stream));
  }
  VOX_TRY(Input input, open_spooled(spooled_, open_, ctx_));
  return std::move(input.source);
}

Result<Census> look_at_floats(std::unique_ptr<VolumeSource>& source, Inputs& inputs, const std::string& input,
                              Run& run) {
  run.stage("measure");
  VOX_TRY(Census census, take_census(*source, run.ctx));
  const bool has_fill = source->info().fill.has_value();
  if (source->forward_only()) {
    VOX_TRY(source, inputs.open(true));
  }
  if (has_fill || !census.outlier) return census;
  if (census.has_nan) {
    run.say(fmt::format(
        "{}: the value {:.9g} lies more than 1000 times the range of all others away; as there are "
        "voxels that are no number, too, it is not taken as a fill value (--fill V is)",
        input, *census.outlier));
    return census;
  }
  run.say(fmt::format(
      "{}: the value {:.9g} lies more than 1000 times the range of all others away: it is taken as a fill "
      "value (--fill V names another)",
      input, *census.outlier));
  inputs.set_fill(*census.outlier);
  source = with_fill(std::move(source), *census.outlier);
  census.range = census.rest;
  census.has_nan = true;
  return census;
}

void declare_zstd(CommandLine& line, int& level) {
  line.option("--zstd", "LEVEL",
              "Compress the parts of the file with zstd as well, 1 (fast) to 19 (small); a part is expanded "
              "in memory when it is first used (not)",
              integer(level, 1, most_zstd_level));
}

Status check_encoding(const std::string& input, const std::string& output, bool verify, const Run& run) {
  if (run.options.json && is_standard_output(output))
    return bad_usage("--json and the output - both use standard output");
  VOX_CHECK(check_output(output, run.options.force));
  VOX_CHECK(check_distinct(input, output));
  if (verify && is_standard_output(output))
    return bad_usage("--verify: cannot read back what went to standard output: name a file");
  return {};
}

Json encoding_json(const Encoding& e, const Run& run, Json params) {
  const double raw = static_cast<double>(raw_bytes(e.info)), bytes = static_cast<double>(e.file_bytes);
  Json json = Json::result();
  json.set("tool", run.tool).set("version", version_text()).set("input", e.input).set("output", e.output);
  json.set("dims", e.info.dims).set("voxel_format", name(e.info.format)).set("raw_bytes", raw_bytes(e.info));
  json.set("file_bytes", e.file_bytes).set("percent", 100 * bytes / raw).set("ratio", raw / bytes);
  json.set("lossless", e.lossless);
  json.set("bits_per_voxel", 8 * bytes / static_cast<double>(*checked_voxels(e.info.dims)));
  json.set("encode_seconds", e.seconds).set("input_mb_per_s", raw / 1e6 / e.seconds);
  json.set("peak_rss_bytes", peak_rss_bytes())
      .set("params", std::move(params))
      .set("threads", run.options.threads);
  return json;
}

void add_verified(const Encoding& e, Json& json) {
  if (e.diff)
    json.set("rmse", e.diff->rmse)
        .set("psnr_db", e.diff->psnr_db)
        .set("max_abs_error", e.diff->max_abs_error);
}

void print_encoding(const Encoding& e) {
  const double raw = static_cast<double>(raw_bytes(e.info)), bytes = static_cast<double>(e.file_bytes);
  std::string share = fmt::format("{:.4g} % of raw", 100 * bytes / raw);
  if (const auto input = file_bytes(e.input); input && *input > 0)
    share += fmt::format(", {:.4g} % of the input", 100 * bytes / static_cast<double>(*input));
  tell(fmt::format(
      "{}: {} -> {} bytes ({}), {}, in {:.2f} s{}", e.output, raw_bytes(e.info), e.file_bytes, share,
      e.lossless ? "lossless" : "lossy", e.seconds,
      e.diff ? fmt::format(", {} dB, greatest error {:.6g}", readable(e.diff->psnr_db), e.diff->max_abs_error)
             : ""));
}

}  // namespace voxkit::cli
