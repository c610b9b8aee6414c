#include "tools/common/vq_report.h"

namespace voxkit::cli {

std::string_view name(vq::Codebook codebook) {
  return codebook == vq::Codebook::rbuc ? "rbuc" : "packed";
}
std::string_view name(vq::Mapping mapping) {
  return mapping == vq::Mapping::direct ? "direct" : "indirect";
}

Json params_json(const vq::Params& params) {
  Json json = Json::object();
  json.set("codebook", name(params.codebook)).set("bits", params.bits);
  json.set("base", params.base).set("step", params.step).set("max_error", params.max_error);
  return json;
}

void add_sizes(const vq::Params& params, Json& json) {
  json.set("unique_bricks", params.unique_bricks).set("codewords", params.codewords);
  json.set("mapping", name(params.mapping)).set("offset_bits", params.offset_bits);
  json.set("offset_bytes", params.offset_bytes).set("codebook_bytes", params.codebook_bytes);
}

}  // namespace voxkit::cli
