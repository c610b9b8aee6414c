#include "tools/common/color_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "libcolor/part_codecs.h"

namespace voxkit::cli {
std::string_view name(color::ImageCurve curve) {
  return curve == color::ImageCurve::morton ? "morton" : "hilbert";
}
std::string_view name(color::Geometry geometry) {
  constexpr std::array<std::string_view, 3> names = {"dag", "ssvdag", "octree"};
  return names[static_cast<size_t>(geometry)];
}
std::string_view name(color::Curve curve) {
  return curve == color::Curve::morton ? "morton" : "hilbert";
}

Json params_json(const color::Params& p) {
  Json json = Json::object();
  json.set("codec", color::part_codec(p.codec).name);
  if (color::has_threshold(p.codec)) {
    json.set("threshold", p.threshold);
    json.set("space", p.space == color::ErrorSpace::lab ? "lab" : "srgb");
    if (color::makes_blocks(p.codec))
      json.set("endpoints", p.endpoints == color::Endpoints::rgb565 ? "565" : "888");
  }
  if (p.codec == color::ColorCodec::fws) json.set("weight_bits", p.weight_bits);
  if (p.codec == color::ColorCodec::palette) json.set("palette", p.palette_colors);
  if (color::makes_textures(p.codec)) {
    json.set("image_curve", name(p.image_curve));
    json.set("block", fmt::format("{}x{}", p.block_size.width, p.block_size.height));
  }
  if (color::makes_images(p.codec)) json.set("image_curve", name(p.image_curve));
  json.set("curve", name(p.curve));
  json.set("colors", p.colors == color::Colors::leaf ? "leaf" : "all");
  json.set("counts", p.counts == color::Counts::node ? "node" : "pointer");
  json.set("geometry", name(p.geometry));
  if (p.simplify > 0) json.set("simplify", p.simplify);
  return json;
}

void add_sizes(const color::Params& p, Json& json) {
  json.set("leaf_voxels", p.leaf_voxels).set("dag_nodes", p.dag_nodes).set("dag_bytes", p.dag_bytes);
  json.set("color_count", p.color_count).set("color_bytes", p.color_bytes);
  json.set("macro_blocks", p.macro_blocks).set("blocks", p.blocks);
  if (p.simplify > 0) json.set("hausdorff_distance", p.hausdorff);
}

double color_percent(const color::Params& p) {
  return 100 * static_cast<double>(p.color_bytes) /
         (3 * static_cast<double>(std::max<uint64_t>(p.color_count, 1)));
}

std::string sizes_text(const color::Params& p) {
  std::string text = fmt::format(
      "surface     {} voxels, {} nodes of {}, {} bytes ({:.4g} bits a voxel)\n", p.leaf_voxels, p.dag_nodes,
      p.geometry == color::Geometry::octree   ? "an octree"
      : p.geometry == color::Geometry::ssvdag ? "a DAG with symmetry"
                                              : "a DAG",
      p.dag_bytes,
      8 * static_cast<double>(p.dag_bytes) / static_cast<double>(std::max<uint64_t>(p.leaf_voxels, 1)));
  if (p.simplify > 0)
    text += fmt::format("simplified  within {:.6g} voxels: {:.6g} off\n", p.simplify, p.hausdorff);
  text += fmt::format("colors      {}, {} of {}, {} bytes ({:.4g} % of 24 bits), error {:.4g} a channel\n",
                      color::part_codec(p.codec).name, p.color_count,
                      p.colors == color::Colors::leaf ? "voxels" : "voxels and nodes", p.color_bytes,
                      color_percent(p), p.grmse);
  if (color::makes_textures(p.codec))
    text += fmt::format("images      {} blocks of {} x {}, along a {} curve\n", p.blocks, p.block_size.width,
                        p.block_size.height, name(p.image_curve));
  if (p.codec == color::ColorCodec::palette)
    text += fmt::format("palette     {} colors, {} blocks in {} macro blocks\n", p.palette_colors, p.blocks,
                        p.macro_blocks);
  if (color::makes_images(p.codec))
    text += fmt::format("images      {}, along a {} curve\n",
                        (p.color_count + color::part_colors - 1) / color::part_colors, name(p.image_curve));
  if (p.codec == color::ColorCodec::predicted)
    text += p.threshold < 1 ? "predicted   lossless\n"
                            : fmt::format("predicted   threshold {:.6g}\n", p.threshold);
  if (color::makes_blocks(p.codec))
    text += fmt::format("blocks      {} in {} macro blocks, threshold {:.6g}{}\n", p.blocks, p.macro_blocks,
                        p.threshold, p.space == color::ErrorSpace::lab ? " in CIELAB" : "");
  return text;
}

}  // namespace voxkit::cli
