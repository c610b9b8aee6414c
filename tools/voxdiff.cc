// voxdiff: how far one volume or image is from another.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <vector>

#include "formats/fill.h"
#include "formats/image/image.h"
#include "formats/names.h"
#include "formats/output_file.h"
#include "formats/volume/open_volume.h"
#include "libcolor/attributes/attribute_selection.h"
#include "libcolor/edit/levels.h"
#include "libmetrics/color_distance.h"
#include "libmetrics/image_diff.h"
#include "libmetrics/ssim.h"
#include "libmetrics/volume_diff.h"
#include "tools/common/attributes.h"
#include "tools/common/input.h"
#include "tools/common/json.h"
#include "tools/common/main.h"

namespace voxkit::cli {
namespace {

constexpr double largest = std::numeric_limits<double>::max();

struct Options {
  std::string a, b, errors;
  OpenOptions open;
  std::string space = "srgb";  ///< of colour distances; lab adds CIELAB
  std::optional<double> fail_psnr, fail_max, fail_ms_ssim, peak;
  bool histogram = false;
};

void declare(CommandLine& line, Options& o) {
  line.argument("A", "The reference: a volume, a compressed volume, an image, or -", o.a);
  line.argument("B", "What is compared with it", o.b);
  line.option("--fail-psnr", "DB", "Exit 1 if the PSNR is below", number(o.fail_psnr, -largest, largest));
  line.option("--fail-max", "E",
              "Exit 1 if an absolute error is above; of attributes, too, where .dagc files have them",
              number(o.fail_max, 0, largest));
  line.option("--fail-ms-ssim", "S", "Images: exit 1 if the MS-SSIM is below", number(o.fail_ms_ssim, 0, 1));
  line.option("--space", "srgb|lab", "Images: lab adds differences in CIELAB (CIE 1976; default: srgb)",
              one_of(o.space, {"srgb", "lab"}));
  line.option("--peak", "P", "Peak of PSNR and SSIM (default: full scale of A's format)",
              [&o](const std::string& text) -> Status {
                VOX_TRY(o.peak, read_number(text, -largest, largest));
                return *o.peak > 0 ? Status{}
                                   : bad_usage("\"" + text + "\": expected a number greater than 0");
              });
  line.flag("--histogram", "Print how the absolute errors are distributed (--json always does)", o.histogram);
  line.file("-o,--output", "ERR", "Write the absolute errors as a volume or an image", o.errors);
  declare_input_options(line, o.open);
}

/// Shares of the samples, in percent, whose greatest errors are said.
constexpr double shares[] = {50, 95, 99, 99.9};

Json describe(const ErrorHistogram& histogram) {
  Json percentiles = Json::object(), errors = Json::array(), counts = Json::array();
  for (const double share : shares)
    percentiles.set(fmt::format("{}", share), histogram.percentile(share / 100));
  for (const auto& bin : histogram.bins()) {
    errors.push(bin.least);
    counts.push(static_cast<int64_t>(bin.count));
  }
  Json json = Json::object();
  json.set("samples", histogram.samples()).set("percentiles", std::move(percentiles));
  json.set("errors", std::move(errors)).set("counts", std::move(counts));
  return json;
}

std::string readable_line(const ErrorHistogram& histogram) {
  std::string text = "error percentiles ";
  for (const double share : shares)
    text += fmt::format("{}{} % <= {}", share == shares[0] ? "" : ", ", share,
                        readable(histogram.percentile(share / 100)));
  return text + "\n";
}

/// What the voxels of two compressed surfaces have beside colours.
struct AttributesDiff {
  color::AttributeSet only_a, only_b;
  std::vector<color::AttributeDiff> both;

  bool passes(std::optional<double> most) const {
    if (!most) return true;
    return only_a.empty() && only_b.empty() &&
           std::ranges::all_of(both, [&](const auto& d) { return d.most_error <= *most; });
  }
};

/// Of voxels that are in both; nothing where neither has any, or one is no compressed surface.
Result<std::optional<AttributesDiff>> compare_attributes(const Input& a, const Input& b, Context& ctx) {
  std::optional<AttributesDiff> none;
  const auto set_of = [](const Input& input) {
    return input.color ? input.color->params().attributes : color::AttributeSet();
  };
  const color::AttributeSet in_a = set_of(a), in_b = set_of(b);
  if (!a.color || !b.color || (in_a.empty() && in_b.empty())) return none;
  AttributesDiff diff{without(in_a, in_b), without(in_b, in_a), {}};
  auto surface = color::with_attributes(color::surface_of(a.color), without(in_a, diff.only_a));
  VOX_TRY(color::SurfaceDiff found, color::compare(*surface, *b.color, ctx));
  diff.both = std::move(found.attributes);
  return std::optional(std::move(diff));
}

Json describe(const AttributesDiff& diff) {
  Json list = Json::array();
  for (const color::AttributeDiff& d : diff.both) {
    Json one = Json::object();
    one.set("name", color::kind_of(d.attribute).name).set("differing_voxels", d.differing);
    one.set("max_error", d.most_error);
    list.push(std::move(one));
  }
  for (const auto& [set, where] : {std::pair{diff.only_a, "a"}, std::pair{diff.only_b, "b"}})
    for (size_t i = 0; i < color::attribute_kinds.size(); ++i) {
      if (!set.has(static_cast<color::Attribute>(i))) continue;
      Json one = Json::object();
      one.set("name", color::attribute_kinds[i].name).set("only_in", where);
      list.push(std::move(one));
    }
  return list;
}

std::string readable_lines(const AttributesDiff& diff) {
  std::string text;
  for (const color::AttributeDiff& d : diff.both)
    text += fmt::format("{:<18}{} voxels differ, by up to {:.4g}{}\n", color::kind_of(d.attribute).name,
                        d.differing, d.most_error, d.attribute == color::Attribute::normal ? " degrees" : "");
  if (!diff.only_a.empty()) text += fmt::format("only A has        {}\n", names_of(diff.only_a));
  if (!diff.only_b.empty()) text += fmt::format("only B has        {}\n", names_of(diff.only_b));
  return text;
}

Json describe(const VolumeDiff& d, const std::optional<AttributesDiff>& attributes,
              const ErrorHistogram& histogram, const Run& run, const Options& o, bool passed) {
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
  if (attributes) json.set("attributes", describe(*attributes));
  json.set("histogram", describe(histogram)).set("passed", passed);
  return json;
}

std::string readable_lines(const VolumeDiff& d) {
  std::string text =
      fmt::format("voxels            {} x {} x {} {}\n", d.dims.x, d.dims.y, d.dims.z, d.type_name);
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

/// Where one volume of floats says which value stands for nothing measured and the other does not, it is that
/// of both: such voxels are NaN on one side, and the same measurement is no infinite error. Beside integers
/// it is the value that counts.
void share_fill(std::unique_ptr<VolumeSource>& from, const std::string& from_name,
                std::unique_ptr<VolumeSource>& to, const std::string& to_name, Run& run) {
  const VolumeInfo &said = from->info(), &other = to->info();
  if (said.format != VoxelFormat::float32 || !said.fill || std::isnan(*said.fill) || is_color(other.format))
    return;
  const double fill = *said.fill;
  if (other.format != VoxelFormat::float32) {
    from = fill_restored(std::move(from));
    return;
  }
  if (other.fill) return;
  run.say(fmt::format("{}: the value {:.9g} is taken as its fill value, as it is that of {}", to_name, fill,
                      from_name));
  to = with_fill(std::move(to), fill);
}

Result<int> compare_volumes(const Options& o, Run& run) {
  if (o.fail_ms_ssim) return bad_usage("--fail-ms-ssim is for images: A and B are volumes");
  if (o.space != "srgb") return bad_usage("--space lab is for images: A and B are volumes");
  OpenOptions open = o.open;
  if (!o.errors.empty())
    open.outputs = is_numbered(o.errors) ? std::vector{o.errors} : files_of_output(o.errors);
  VOX_TRY(Input a, open_input(o.a, open, run.ctx));
  VOX_TRY(Input b, open_input(o.b, open, run.ctx));
  share_fill(a.source, o.a, b.source, o.b, run);
  share_fill(b.source, o.b, a.source, o.a, run);
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
    tell(fmt::format("{}: {}: has {} voxels: expected {}, as {}", run.tool, o.b, extent(info_b.dims),
                     extent(info_a.dims), o.a));
    return 1;
  }
  std::unique_ptr<VolumeSink> sink;
  if (!o.errors.empty()) {
    VOX_TRY(sink, create_volume(o.errors, error_volume_info(info_a, info_b), run.options.force, run.ctx));
  }
  run.stage("compare");
  const bool count = o.histogram || run.options.json;
  ErrorHistogram histogram;
  VOX_TRY(const VolumeDiff d,
          diff_volumes(*a.source, *b.source, o.peak, sink.get(), run.ctx, count ? &histogram : nullptr));

  VOX_TRY(const auto attributes, compare_attributes(a, b, run.ctx));
  const bool passed = !(o.fail_psnr && !(d.psnr_db >= *o.fail_psnr)) &&
                      !(o.fail_max && !(d.max_abs_error <= *o.fail_max)) &&
                      (!attributes || attributes->passes(o.fail_max));
  if (run.options.json) {
    VOX_CHECK(print(describe(d, attributes, histogram, run, o, passed).text()));
  } else if (!run.options.quiet) {
    VOX_CHECK(print(readable_lines(d) + (attributes ? readable_lines(*attributes) : "") +
                    (o.histogram ? readable_line(histogram) : "")));
  }
  return passed ? 0 : 1;
}

struct ImageResult {
  ImageDiff diff;
  ErrorHistogram histogram;        ///< with --json or --histogram
  Ssim ssim;                       ///< of the luma
  std::vector<Ssim> channel_ssim;  ///< colours
  std::optional<LabDiff> lab;
};

Result<ImageResult> measure(const Image& a, const Image& b, const Options& o, Run& run) {
  ImageResult result;
  const bool count = o.histogram || run.options.json;
  VOX_TRY(result.diff, diff_images(a, b, o.peak, run.ctx, count ? &result.histogram : nullptr));
  {
    VOX_TRY(const Image luma_a, luma(a, run.ctx));
    VOX_TRY(const Image luma_b, luma(b, run.ctx));
    VOX_TRY(result.ssim, ssim(luma_a, luma_b, o.peak, run.ctx));
  }
  // Four times the work, so only where it is shown.
  for (int c = 0; run.options.json && a.colors() > 1 && c < std::min(a.channels(), b.channels()); ++c) {
    VOX_TRY(const Image channel_a, channel(a, c, run.ctx));
    VOX_TRY(const Image channel_b, channel(b, c, run.ctx));
    VOX_TRY(const Ssim one, ssim(channel_a, channel_b, o.peak, run.ctx));
    result.channel_ssim.push_back(one);
  }
  if (o.space == "lab") {
    VOX_TRY(result.lab, diff_lab(a, b, run.ctx));
  }
  return result;
}

Json describe(const ImageResult& r, const Run& run, const Options& o, bool passed) {
  const ImageDiff& d = r.diff;
  Json json = Json::result();
  json.set("tool", run.tool).set("version", version_text()).set("a", o.a).set("b", o.b);
  json.set("width", d.width).set("height", d.height).set("channels", d.channels).set("peak", d.peak);
  json.set("mse", d.mse).set("rmse", d.rmse).set("psnr_db", d.psnr_db);
  json.set("ssim", r.ssim.ssim).set("ms_ssim", r.ssim.ms_ssim).set("ms_ssim_scales", r.ssim.scales);
  if (!r.channel_ssim.empty()) {
    Json ssims = Json::array(), ms_ssims = Json::array();
    for (const Ssim& s : r.channel_ssim) {
      ssims.push(s.ssim);
      ms_ssims.push(s.ms_ssim);
    }
    json.set("ssim_channels", std::move(ssims)).set("ms_ssim_channels", std::move(ms_ssims));
  }
  json.set("max_abs_error", d.max_abs_error).set("differing_pixels", d.differing_pixels);
  if (d.grmse) json.set("grmse", *d.grmse).set("grmse_distance", *d.grmse_distance);
  if (r.lab) json.set("delta_e_mean", r.lab->mean_delta_e).set("delta_e_max", r.lab->max_delta_e);
  json.set("histogram", describe(r.histogram)).set("passed", passed);
  return json;
}

std::string readable_lines(const ImageResult& r) {
  const ImageDiff& d = r.diff;
  std::string text = fmt::format("pixels            {} x {}, {} channel{}\n", d.width, d.height, d.channels,
                                 d.channels == 1 ? "" : "s");
  text += fmt::format("differing pixels  {} ({:.4g} %)\n", d.differing_pixels,
                      100 * static_cast<double>(d.differing_pixels) /
                          (static_cast<double>(d.width) * static_cast<double>(d.height)));
  text += fmt::format("PSNR              {} dB (peak {})\n", readable(d.psnr_db), readable(d.peak));
  text += fmt::format("SSIM              {}\n", readable(r.ssim.ssim));
  text += fmt::format("MS-SSIM           {} ({} scale{})\n", readable(r.ssim.ms_ssim), r.ssim.scales,
                      r.ssim.scales == 1 ? "" : "s");
  text += fmt::format("RMSE              {}\n", readable(d.rmse));
  text += fmt::format("absolute error    greatest {}\n", readable(d.max_abs_error));
  if (d.grmse)
    text += fmt::format("RGB RMSE          {} a channel, {} as a distance\n", readable(*d.grmse),
                        readable(*d.grmse_distance));
  if (r.lab)
    text += fmt::format("delta E (1976)    mean {}, greatest {}\n", readable(r.lab->mean_delta_e),
                        readable(r.lab->max_delta_e));
  return text;
}

Result<int> compare_images(const Image& a, const Image& b, const Options& o, Run& run) {
  if (!o.errors.empty() && !is_image_name(o.errors))
    return bad_usage("-o " + o.errors + ": the errors of images are an image: expected .png, .tif or .exr");
  if (a.width() != b.width() || a.height() != b.height()) {
    if (run.options.json) {
      Json json = Json::result();
      json.set("tool", run.tool).set("version", version_text()).set("a", o.a).set("b", o.b);
      json.set("width", a.width()).set("height", a.height());
      json.set("width_b", b.width()).set("height_b", b.height()).set("passed", false);
      VOX_CHECK(print(json.text()));
    }
    tell(fmt::format("{}: {}: has {} x {} pixels: expected {} x {}, as {}", run.tool, o.b, b.width(),
                     b.height(), a.width(), a.height(), o.a));
    return 1;
  }
  run.stage("compare");
  VOX_TRY(const ImageResult r, measure(a, b, o, run));
  if (!o.errors.empty()) {
    VOX_TRY(const Image errors, error_image(a, b, run.ctx));
    VOX_CHECK(write_image(o.errors, errors, run.options.force));
  }

  const bool passed = !(o.fail_psnr && !(r.diff.psnr_db >= *o.fail_psnr)) &&
                      !(o.fail_max && !(r.diff.max_abs_error <= *o.fail_max)) &&
                      !(o.fail_ms_ssim && !(r.ssim.ms_ssim >= *o.fail_ms_ssim));
  if (run.options.json) {
    VOX_CHECK(print(describe(r, run, o, passed).text()));
  } else if (!run.options.quiet) {
    VOX_CHECK(print(readable_lines(r) + (o.histogram ? readable_line(r.histogram) : "")));
  }
  return passed ? 0 : 1;
}

bool is_image_file(const std::string& name) {
  std::error_code ignored;
  return is_image_name(name) && std::filesystem::is_regular_file(name, ignored);
}

Result<int> work(const Options& o, Run& run) {
  if (o.a == "-" && o.b == "-") return bad_usage("A and B are both standard input: expected one - at most");
  if (!o.errors.empty()) {
    if (is_standard_output(o.errors))
      return bad_usage("the errors cannot go to standard output: expected a file");
    VOX_CHECK(check_distinct(o.a, o.errors));
    VOX_CHECK(check_distinct(o.b, o.errors));
    VOX_CHECK(is_image_name(o.errors) ? check_image_output(o.errors, run.options.force)
                                      : check_volume_output(o.errors, run.options.force));
  }
  if (is_image_file(o.a) && is_image_file(o.b)) {
    VOX_TRY(const auto a, read_image(o.a, run.ctx));
    VOX_TRY(const auto b, read_image(o.b, run.ctx));
    if (a && b) return compare_images(*a, *b, o, run);
  }
  return compare_volumes(o, run);
}

}  // namespace
}  // namespace voxkit::cli

int main(int argc, char** argv) {
  using namespace voxkit::cli;
  Options options;
  return run_tool(
      argc, argv, "voxdiff",
      "Compares two volumes or images. Exits 1 if their sizes differ or a --fail limit is broken; "
      "--fail-max 0 asks for equality.",
      "  voxdiff head.nrrd head.svmm\n"
      "  voxdiff head.nrrd head.svmm --histogram\n"
      "  voxdiff head.nrrd head.svmm --json --fail-psnr 40 --fail-max 12\n"
      "  voxdiff a.nrrd b.nrrd -o errors.nrrd\n"
      "  voxdiff a.png b.png --fail-ms-ssim 0.98 --space lab -o errors.png\n",
      [&](CommandLine& line) { declare(line, options); }, [&](Run& run) { return work(options, run); });
}
