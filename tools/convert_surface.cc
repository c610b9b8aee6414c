#include "tools/convert_surface.h"

#include <fmt/core.h>

#include <algorithm>

#include "formats/names.h"
#include "formats/output_file.h"
#include "libcolor/edit/arrangement.h"
#include "libcolor/edit/exact.h"
#include "libcolor/edit/lattice.h"
#include "libcolor/part_codecs.h"
#include "tools/common/attributes.h"
#include "tools/common/color_report.h"
#include "tools/common/input.h"
#include "tools/common/json.h"

namespace voxkit::cli {
namespace {

using Volumes = std::vector<std::shared_ptr<const color::Volume>>;

Status check_names(const SurfaceEdit& edit, const Run& run) {
  for (const std::string& input : edit.inputs) {
    if (!has_ending(input, ".dagc") && input != "-")
      return fail(ErrorCode::usage, input,
                  "a .dagc file is made of .dagc files here: dagcolor-pack makes one of other inputs");
    VOX_CHECK(check_distinct(input, edit.output));
  }
  if (std::count(edit.inputs.begin(), edit.inputs.end(), "-") > 1)
    return bad_usage("-: standard input can be read once: expected it once");
  return check_output(edit.output, run.options.force);
}

Result<Volumes> open_all(const SurfaceEdit& edit, Run& run) {
  Volumes volumes;
  for (const std::string& name : edit.inputs) {
    VOX_TRY(Input input, open_compressed(name, 0, run.ctx));
    if (!input.color) return fail(ErrorCode::usage, name, "expected a coloured surface (.dagc)");
    // Colours are found by counts; of a part few of them are followed.
    if (!edit.crop) VOX_CHECK(input.color->check(run.ctx));
    volumes.push_back(std::move(input.color));
  }
  return volumes;
}

/// How many voxels have been moved out of the grid.
Result<uint64_t> left_out(const Volumes& volumes, const color::CommonGrid& grid) {
  uint64_t out = 0;
  for (size_t i = 0; i < volumes.size(); ++i) {
    VOX_TRY(const uint64_t kept,
            color::voxels_in(*volumes[i], {Index3(0) - grid.at[i], grid.info.dims - grid.at[i]}));
    out += volumes[i]->params().leaf_voxels - kept;
  }
  return out;
}

Status crop(color::CommonGrid& grid, const Box& box) {
  const Index3 dims = grid.info.dims;
  if (!grid.info.box().contains(box))
    return bad_usage(fmt::format("--crop: the box is not inside the grid: expected one inside 0,0,0,{},{},{}",
                                 dims.x, dims.y, dims.z));
  grid.info.dims = box.size();
  grid.info.affine = grid.info.affine.moved_to(
      {static_cast<double>(box.lo.x), static_cast<double>(box.lo.y), static_cast<double>(box.lo.z)});
  for (Index3& at : grid.at) at -= box.lo;
  return {};
}

/// What was lost before, which nothing brings back.
std::string told_of_losses(const SurfaceEdit& edit, const Volumes& volumes) {
  size_t lossy = 0;
  std::string names;
  double most = 0;
  for (size_t i = 0; i < volumes.size(); ++i) {
    const color::Params& params = volumes[i]->params();
    if (!(params.grmse > 0)) continue;
    most = std::max(most, params.grmse);
    if (++lossy == 1) names = edit.inputs[i];
  }
  if (lossy == 0) return {};
  if (lossy > 1) names += fmt::format(" and {} more", lossy - 1);
  return fmt::format(
      "{}: colors are lossy already, error up to {:.4g} a channel: stored here as they decode, "
      "without another loss",
      names, most);
}

/// Those that some inputs have and others do not.
std::string attributes_not_common(const Volumes& volumes) {
  color::AttributeSet lost;
  for (const auto& a : volumes)
    for (const auto& b : volumes) {
      const color::AttributeSet own = without(a->params().attributes, b->params().attributes);
      for (size_t i = 0; i < color::attribute_kinds.size(); ++i)
        if (own.has(static_cast<color::Attribute>(i))) lost.add(static_cast<color::Attribute>(i));
    }
  return names_of(lost);
}

void tell_what_was_done(const SurfaceEdit& edit, const Volumes& volumes, const color::CommonGrid& grid,
                        const color::Arrangement::Census& census, uint64_t dropped, Run& run) {
  for (const std::string& note : grid.notes) run.say(note);
  if (const std::string losses = told_of_losses(edit, volumes); !losses.empty()) run.say(losses);
  if (const std::string lost = attributes_not_common(volumes); !lost.empty())
    run.say(fmt::format("{}: dropped: {}, which not all inputs have", edit.output, lost));
  if (dropped > 0) run.say(fmt::format("{}: dropped: {} voxels that leave the grid", edit.output, dropped));
  if (census.shared > 0)
    run.say(
        fmt::format("{}: {} voxels are in more inputs than one, {} of them in different colors: those of "
                    "the input named first count",
                    edit.output, census.shared, census.differing));
  if (census.voxels == 0) run.say(fmt::format("{}: no voxels are left", edit.output));
}

Json json_of(const SurfaceEdit& edit, const VolumeInfo& info, const color::Params& params,
             std::span<const color::AttributeParams> attributes, const color::Arrangement::Census& census,
             uint64_t dropped, const Run& run) {
  Json inputs = Json::array(), json = Json::result();
  for (const std::string& input : edit.inputs) inputs.push(std::string_view(input));
  json.set("tool", run.tool).set("version", version_text());
  json.set("input", edit.inputs.front()).set("inputs", std::move(inputs)).set("output", edit.output);
  json.set("dims", info.dims).set("voxel_format", name(info.format)).set("raw_bytes", raw_bytes(info));
  if (const auto bytes = file_bytes(edit.output)) json.set("file_bytes", *bytes);
  json.set("params", params_json(params));
  add_sizes(params, json);
  if (!attributes.empty()) json.set("attributes", attributes_json(attributes, params.leaf_voxels));
  json.set("shared_voxels", census.shared).set("differing_voxels", census.differing);
  json.set("dropped_voxels", dropped).set("cells_visited", census.cells);
  json.set("seconds", run.seconds())
      .set("peak_rss_bytes", peak_rss_bytes())
      .set("threads", run.options.threads);
  return json;
}

}  // namespace

Result<int> convert_surfaces(const SurfaceEdit& edit, Run& run) {
  VOX_CHECK(check_names(edit, run));
  run.stage("read");
  VOX_TRY(const Volumes volumes, open_all(edit, run));
  std::vector<VolumeInfo> infos;
  std::vector<color::Params> params;
  for (const auto& volume : volumes) {
    infos.push_back(volume->info());
    params.push_back(volume->params());
  }
  VOX_TRY(color::CommonGrid grid, color::common_grid(infos, edit.inputs));
  uint64_t dropped = 0;
  if (edit.translate) {
    for (Index3& at : grid.at) at += *edit.translate;
    VOX_TRY(dropped, left_out(volumes, grid));
  }
  if (edit.crop) VOX_CHECK(crop(grid, *edit.crop));
  std::vector<color::Placed> placed;
  for (size_t i = 0; i < volumes.size(); ++i) placed.push_back({volumes[i], grid.at[i]});
  color::Arrangement arrangement(std::move(placed), grid.info);
  color::Options options = color::exact_options(params);
  options.zstd = edit.zstd;

  VOX_TRY(const auto out, OutputFile::create(edit.output, run.options.force));
  run.stage("convert");
  VOX_TRY(const color::Report report,
          color::encode(
              arrangement, options, [&](auto bytes) { return out->write(bytes); }, run.ctx));
  if (report.most_error > 0 ||
      std::ranges::any_of(report.attributes, [](const auto& p) { return p.most_error > 0; }))
    return fail(ErrorCode::internal, edit.output, "colors did not stay what they were: nothing was written");
  VOX_CHECK(out->commit());

  const color::Arrangement::Census& census = arrangement.census();
  tell_what_was_done(edit, volumes, grid, census, dropped, run);
  run.note(fmt::format("{}: {} voxels in {} x {} x {}, colors {} ({:.4g} %), {} cells visited, in {:.2f} s",
                       edit.output, census.voxels, grid.info.dims.x, grid.info.dims.y, grid.info.dims.z,
                       color::part_codec(report.params.codec).name, color_percent(report.params),
                       census.cells, run.seconds()));
  if (run.options.json)
    VOX_CHECK(print(json_of(edit, grid.info, report.params, report.attributes, census, dropped, run).text()));
  return 0;
}

}  // namespace voxkit::cli
