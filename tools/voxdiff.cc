// voxdiff: how far one volume is from another.
#include <fmt/core.h>

#include <limits>

#include "formats/open_volume.h"
#include "libmetrics/volume_diff.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"

namespace voxkit::cli {
namespace {

constexpr double largest = std::numeric_limits<double>::max();

struct Options {
  std::string a, b, errors;
  OpenOptions open;
  std::optional<double> fail_psnr, fail_max, peak;
};

void declare(CommandLine& line, Options& o) {
  line.argument("A", "The reference: a volume, a compressed volume, or -", o.a);
  line.argument("B", "What is compared with it", o.b);
  line.option("--fail-psnr", "DB", "Exit 1 if the PSNR is below", number(o.fail_psnr, -largest, largest));
  line.option("--fail-max", "E", "Exit 1 if an absolute error is above", number(o.fail_max, 0, largest));
  line.option("--peak", "P", "Peak of the PSNR (default: full scale of A's format)",
              [&o](const std::string& text) -> Status {
                VOX_TRY(o.peak, read_number(text, -largest, largest));
                return *o.peak > 0 ? Status{}
                                   : bad_usage("\"" + text + "\": expected a number greater than 0");
              });
  line.text("-o,--output", "ERR", "Write the absolute errors as a volume", o.errors);
  declare_input_options(line, o.open);
}

Json describe(const VolumeDiff& d, const Run& run, const Options& o, bool passed) {
  Json json = Json::result();
  json.set("tool", run.tool).set("version", version_text()).set("a", o.a).set("b", o.b);
  json.set("dims", d.dims)
      .set("voxels", d.voxels)
      .set("voxel_format", name(d.voxel_format))
      .set("peak", d.peak);
  json.set("mse", d.mse).set("rmse", d.rmse).set("psnr_db", d.psnr_db).set("max_abs_error", d.max_abs_error);
  json.set("mean_abs_error", d.mean_abs_error)
      .set("differing_voxels", d.differing_voxels)
      .set("snr_db", d.snr_db);
  if (d.grmse) json.set("grmse", *d.grmse).set("grmse_distance", *d.grmse_distance);
  json.set("passed", passed);
  return json;
}

std::string readable_lines(const VolumeDiff& d) {
  std::string text =
      fmt::format("voxels            {} x {} x {} {}\n", d.dims.x, d.dims.y, d.dims.z, name(d.voxel_format));
  text += fmt::format("differing voxels  {} ({:.4g} %)\n", d.differing_voxels,
                      100 * static_cast<double>(d.differing_voxels) / static_cast<double>(d.voxels));
  text += fmt::format("PSNR              {} dB (peak {})\n", readable(d.psnr_db), readable(d.peak));
  text += fmt::format("SNR               {} dB\n", readable(d.snr_db));
  text += fmt::format("RMSE              {}\n", readable(d.rmse));
  text += fmt::format("absolute error    mean {}, greatest {}\n", readable(d.mean_abs_error),
                      readable(d.max_abs_error));
  if (d.grmse)
    text += fmt::format("RGB RMSE          {} a channel, {} as a distance\n", readable(*d.grmse),
                        readable(*d.grmse_distance));
  return text;
}

Result<int> work(const Options& o, Run& run) {
  if (o.a == "-" && o.b == "-") return bad_usage("A and B are both standard input: expected one - at most");
  if (!o.errors.empty()) {
    if (o.errors == "-") return bad_usage("the error volume cannot go to standard output: expected a file");
    VOX_CHECK(check_distinct(o.a, o.errors));
    VOX_CHECK(check_distinct(o.b, o.errors));
    VOX_CHECK(check_volume_output(o.errors, run.options.force));
  }
  VOX_TRY(const Input a, open_input(o.a, o.open, run.ctx));
  VOX_TRY(const Input b, open_input(o.b, o.open, run.ctx));
  const VolumeInfo& info_a = a.source->info();
  const VolumeInfo& info_b = b.source->info();
  if (info_a.dims != info_b.dims) {
    const auto extent = [](const Index3& d) { return fmt::format("{} x {} x {}", d.x, d.y, d.z); };
    if (run.options.json) {
      Json json = Json::result();
      json.set("tool", run.tool).set("version", version_text()).set("a", o.a).set("b", o.b);
      json.set("dims", info_a.dims).set("dims_b", info_b.dims).set("passed", false);
      VOX_CHECK(print(json.text()));
    }
    fmt::print(stderr, "{}: {}: has {} voxels: expected {}, as {}\n", run.tool, o.b, extent(info_b.dims),
               extent(info_a.dims), o.a);
    return 1;
  }
  std::unique_ptr<VolumeSink> sink;
  if (!o.errors.empty()) {
    VOX_TRY(sink, create_volume(o.errors, error_volume_info(info_a, info_b), run.options.force, run.ctx));
  }
  run.stage("compare");
  VOX_TRY(const VolumeDiff d, diff_volumes(*a.source, *b.source, o.peak, sink.get(), run.ctx));

  const bool tolerant = o.fail_psnr || o.fail_max;
  const bool passed = tolerant ? !(o.fail_psnr && !(d.psnr_db >= *o.fail_psnr)) &&
                                     !(o.fail_max && !(d.max_abs_error <= *o.fail_max))
                               : d.differing_voxels == 0;
  if (run.options.json) {
    VOX_CHECK(print(describe(d, run, o, passed).text()));
  } else if (!run.options.quiet) {
    VOX_CHECK(print(readable_lines(d)));
  }
  return passed ? 0 : 1;
}

}  // namespace
}  // namespace voxkit::cli

int main(int argc, char** argv) {
  using namespace voxkit::cli;
  Options options;
  return run_tool(
      argc, argv, "voxdiff",
      "Compares two volumes. Exits 1 if any voxel differs, or with --fail options only if one of those is "
      "violated.",
      "  voxdiff head.nrrd head.svmm\n"
      "  voxdiff head.nrrd head.svmm --json --fail-psnr 40 --fail-max 12\n"
      "  voxdiff a.nrrd b.nrrd -o errors.nrrd\n",
      [&](CommandLine& line) { declare(line, options); }, [&](Run& run) { return work(options, run); });
}
