#include "tools/common/vq_report.h"

#include <fmt/format.h>

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
  json.set("seeding", !params.seeding ? "none" : *params.seeding == vq::Seeding::d2 ? "d2" : "furthest");
  return json;
}

void add_sizes(const vq::Params& params, Json& json) {
  json.set("unique_bricks", params.unique_bricks).set("codewords", params.codewords);
  json.set("mapping", name(params.mapping)).set("offset_bits", params.offset_bits);
  json.set("offset_bytes", params.offset_bytes).set("codebook_bytes", params.codebook_bytes);
}

std::string sizes_text(const vq::Volume& volume) {
  const vq::Params& p = volume.params();
  const Index3 bricks = volume.bricks();
  std::string text =
      fmt::format("codes       {} bits, value {:.10g} * code + {:.10g}, {}\n", p.bits, p.step, p.base,
                  p.max_error < 0    ? "no bound"
                  : p.max_error == 0 ? "lossless"
                                     : fmt::format("within {:.6g}", p.max_error));
  text +=
      fmt::format("bricks      {} x {} x {}, {} different\n", bricks.x, bricks.y, bricks.z, p.unique_bricks);
  text += fmt::format("offsets     {}, up to {} bits each, {} bytes\n", name(p.mapping), p.offset_bits,
                      p.offset_bytes);
  text +=
      fmt::format("codebook    {}, {} bricks, {} bytes\n", name(p.codebook), p.codewords, p.codebook_bytes);
  return text;
}

}  // namespace voxkit::cli
