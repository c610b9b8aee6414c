#include "tools/common/svmm_report.h"

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

}  // namespace voxkit::cli
