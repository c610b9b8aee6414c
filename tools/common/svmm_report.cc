#include "tools/common/svmm_report.h"

#include <fmt/format.h>

#include <utility>

namespace voxkit::cli {

std::string_view name(svmm::Layout layout) {
  return layout == svmm::Layout::thesis ? "thesis" : "plain";
}
std::string_view name(svmm::Bound bound) {
  return bound == svmm::Bound::local ? "local" : "global";
}
std::string_view name(svmm::Base base) {
  static constexpr std::string_view names[] = {"", "raw", "bitmap", "alpha", "gray", "bc1"};
  return names[static_cast<size_t>(base)];
}

Json params_json(const svmm::Params& params) {
  Json widths = Json::array();
  for (const int w : params.blockwidths) widths.push(int64_t{w});
  Json json = Json::object();
  json.set("layout", name(params.layout)).set("base", name(params.base)).set("bound", name(params.bound));
  json.set("alpha_weight", params.alpha_weight)
      .set("blockwidths", std::move(widths))
      .set("rootwidth", params.rootwidth);
  json.set("quality", params.quality).set("delta", params.delta).set("full_scale", params.full_scale);
  return json;
}

Json levels_json(std::span<const svmm::Level> levels) {
  Json array = Json::array();
  int64_t index = 0;
  for (const svmm::Level& level : levels) {
    Json json = Json::object();
    json.set("index", index++).set("blockwidth", level.blockwidth).set("mip_factor", level.mip_factor);
    json.set("dims", level.dims).set("blocks", level.blocks).set("block_bytes", level.block_bytes);
    json.set("terminal_voxels", level.terminal_voxels);
    array.push(std::move(json));
  }
  return array;
}

namespace {

std::string_view name(svmm::CodeKind kind) {
  return kind == svmm::CodeKind::integers  ? "integers"
         : kind == svmm::CodeKind::ordered ? "ordered"
         : kind == svmm::CodeKind::colors  ? "colors"
         : kind == svmm::CodeKind::indexed ? "indexed"
                                           : "steps";
}

}  // namespace

Json params_json(const svmm::PackedParams& params) {
  Json json = Json::object();
  json.set("layout", "packed").set("page", params.page_side).set("levels", params.levels);
  json.set("max_error", params.max_error).set("codes", name(params.map.kind));
  if (params.map.colors) json.set("colors", params.map.colors->size());
  return json;
}

Json levels_json(const svmm::PackedVolume& volume) {
  Json array = Json::array();
  for (int64_t index = volume.finest(); index < volume.params().levels; ++index) {
    const svmm::PackedLevel& level = volume.levels()[static_cast<size_t>(index)];
    Json json = Json::object();
    json.set("index", index).set("blockwidth", volume.params().page_side);
    json.set("mip_factor", int64_t{1} << index).set("dims", level.dims);
    json.set("blocks", level.pages.x * level.pages.y * level.pages.z).set("block_bytes", level.page_bytes);
    json.set("end", level.end);
    array.push(std::move(json));
  }
  return array;
}

std::string levels_text(const svmm::PackedVolume& volume) {
  const svmm::PackedParams& p = volume.params();
  std::string text = fmt::format(
      "params      layout packed, pages of {0} x {0} x {0}, greatest error {1:.6g}{2}\n", p.page_side,
      p.max_error, p.map.colors ? fmt::format(", {} colors", p.map.colors->size()) : std::string());
  text += "level  factor  dims                     pages        bytes    ends at byte\n";
  for (int index = volume.finest(); index < p.levels; ++index) {
    const svmm::PackedLevel& l = volume.levels()[static_cast<size_t>(index)];
    text += fmt::format("{:>5}  {:>6}  {:<18}  {:>10}  {:>11}  {:>14}\n", index, int64_t{1} << index,
                        fmt::format("{} x {} x {}", l.dims.x, l.dims.y, l.dims.z),
                        l.pages.x * l.pages.y * l.pages.z, l.page_bytes, l.end);
  }
  return text;
}

}  // namespace voxkit::cli
