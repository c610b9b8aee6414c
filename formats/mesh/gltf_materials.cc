// Pictures and materials of glTF files.
#include "formats/mesh/gltf_json.h"

namespace voxkit::gltf {
namespace {

PictureWrap wrap_of(uint64_t value) {
  constexpr uint64_t clamp_to_edge = 33071, mirrored_repeat = 33648;
  return value == clamp_to_edge     ? PictureWrap::clamp
         : value == mirrored_repeat ? PictureWrap::mirror
                                    : PictureWrap::repeat;
}

Result<std::vector<Sampler>> read_samplers(const Json& file, const std::string& path) {
  std::vector<Sampler> samplers;
  for (const Json& json : list_of(file, "samplers")) {
    const Item item{json, "sampler", samplers.size(), path};
    constexpr uint64_t repeat = 10497, nearest = 9728, linear = 9729;
    const auto u = whole(item, "wrapS", repeat), v = whole(item, "wrapT", repeat),
               filter = whole(item, "magFilter", linear);
    if (!u || !v || !filter) return item.bad("expected numbers");
    samplers.push_back(
        {wrap_of(*u), wrap_of(*v), *filter == nearest ? PictureFilter::nearest : PictureFilter::linear});
  }
  return samplers;
}

Result<PictureInfo> read_info(const Item& owner, const char* name, const Document& document) {
  PictureInfo info;
  const Json* const json = owner.find(name);
  if (!json) return info;
  const Item item = owner.below(*json);
  VOX_TRY(info.picture, index_of(item, "index", document.pictures.size(), "texture"));
  if (info.picture == none) return item.bad(fmt::format("expected an index of its {}", name));
  auto channel = whole(item, "texCoord", 0);
  const Json* const transform = item.extension("KHR_texture_transform");
  if (transform) {
    const Item moved = item.below(*transform);
    double offset[2] = {0, 0}, scale[2] = {1, 1}, angle = 0;
    if (!numbers<2>(moved, "offset", offset) || !numbers<2>(moved, "scale", scale) ||
        !number(moved, "rotation", angle))
      return item.bad("expected numbers in its texture transform");
    channel = whole(moved, "texCoord", channel);
    const double c = std::cos(angle), s = std::sin(angle);
    if (offset[0] != 0 || offset[1] != 0 || scale[0] != 1 || scale[1] != 1 || angle != 0)
      info.transform = {{{c * scale[0], s * scale[1], offset[0]}, {-s * scale[0], c * scale[1], offset[1]}}};
  }
  if (!channel || *channel > 255) return item.bad("expected a texCoord below 256");
  info.channel = static_cast<uint32_t>(*channel);
  return info;
}

/// Roughness and metalness of the last material; gloss is the opposite of roughness, and no metal.
Status read_rm(const Item& item, const Json* rough, const Json* gloss, Document& document) {
  Material& out = document.materials.back();
  double roughness = 1, metalness = gloss ? 0 : 1;
  bool sound = true;
  if (gloss) {
    double factor = 1;
    sound = number(item.below(*gloss), "glossinessFactor", factor);
    roughness = 1 - factor;
  } else if (rough) {
    const Item part = item.below(*rough);
    sound = number(part, "roughnessFactor", roughness) && number(part, "metallicFactor", metalness);
    VOX_TRY(out.rm, read_info(part, "metallicRoughnessTexture", document));
  }
  if (!sound) return item.bad("expected numbers for its factors");
  out.material.roughness = static_cast<float>(roughness);
  out.material.metalness = static_cast<float>(metalness);
  return {};
}

Status read_material(const Item& item, Document& document, bool rm) {
  Material& out = document.materials.emplace_back();
  MeshMaterial& material = out.material;
  material.name = text_of(item, "name");
  material.number = static_cast<uint32_t>(item.index);
  if (material.name.empty()) material.name = std::to_string(item.index);
  const Json* const gloss = item.extension("KHR_materials_pbrSpecularGlossiness");
  const Json* const rough = item.find("pbrMetallicRoughness");
  bool sound = true;
  if (gloss) {
    const Item part = item.below(*gloss);
    sound &= numbers<4>(part, "diffuseFactor", material.color);
    VOX_TRY(out.color, read_info(part, "diffuseTexture", document));
  } else if (rough) {
    const Item part = item.below(*rough);
    sound &= numbers<4>(part, "baseColorFactor", material.color);
    VOX_TRY(out.color, read_info(part, "baseColorTexture", document));
  }
  if (rm) VOX_CHECK(read_rm(item, rough, gloss, document));
  sound &= numbers<3>(item, "emissiveFactor", material.emission);
  VOX_TRY(out.emission, read_info(item, "emissiveTexture", document));
  if (const Json* const more = item.extension("KHR_materials_emissive_strength")) {
    double strength = 1;
    sound &= number(item.below(*more), "emissiveStrength", strength);
    material.emission *= static_cast<float>(strength);
  }
  if (!material.emits()) out.emission = {};
  const std::string mode = item.find("alphaMode") ? text_of(item, "alphaMode") : "OPAQUE";
  if (mode != "OPAQUE" && mode != "MASK" && mode != "BLEND")
    return item.bad("expected the alphaMode OPAQUE, MASK or BLEND");
  material.alpha_mode = mode == "MASK"    ? AlphaMode::mask
                        : mode == "BLEND" ? AlphaMode::blend
                                          : AlphaMode::opaque;
  double cutoff = 0.5;
  sound &= number(item, "alphaCutoff", cutoff);
  material.alpha_cutoff = static_cast<float>(cutoff);
  if (!sound) return item.bad("expected numbers for its factors");

  const auto use = [&](const PictureInfo& info, PictureWrap& u, PictureWrap& v, PictureFilter& filter) {
    if (info.picture == none) return;
    const Sampler& sampler = document.pictures[info.picture].sampler;
    u = sampler.wrap_u, v = sampler.wrap_v, filter = sampler.filter;
  };
  use(out.color, material.wrap_u, material.wrap_v, material.filter);
  use(out.emission, material.emission_wrap_u, material.emission_wrap_v, material.emission_filter);
  use(out.rm, material.rm_wrap_u, material.rm_wrap_v, material.rm_filter);
  return {};
}

/// What of materials is no colour: named once for a file.
void note_materials(const Json& file, Document& document, bool rm) {
  const auto any = [&](const char* first, const char* second) {
    for (const Json& material : list_of(file, "materials")) {
      const auto at = material.is_object() ? material.find(first) : material.end();
      if (material.is_object() && at != material.end() &&
          (!second || (at->is_object() && at->contains(second))))
        return true;
    }
    return false;
  };
  // No metal and full roughness are what is left of a material that has nothing but its color.
  const auto says_other = [&](const char* factor, double of_color) {
    for (const Json& material : list_of(file, "materials")) {
      const auto at = material.is_object() ? material.find("pbrMetallicRoughness") : material.end();
      if (!material.is_object() || at == material.end() || !at->is_object()) continue;
      const auto value = at->find(factor);
      if (value != at->end() && !(value->is_number() && value->get<double>() == of_color)) return true;
    }
    return false;
  };
  std::string dropped;
  const auto add = [&](const char* what) { dropped += (dropped.empty() ? "" : ", ") + std::string(what); };
  if (any("normalTexture", nullptr)) add("normal maps");
  if (any("occlusionTexture", nullptr)) add("occlusion maps");
  if (!rm && any("pbrMetallicRoughness", "metallicRoughnessTexture")) add("maps of metal and roughness");
  if (!rm && (says_other("metallicFactor", 0) || says_other("roughnessFactor", 1)))
    add("metal and roughness");
  if (!dropped.empty()) document.notes.push_back(fmt::format("dropped: {}: only colors are kept", dropped));
}

}  // namespace

Status read_pictures(const Json& file, const std::string& path, Document& document) {
  VOX_TRY(const auto samplers, read_samplers(file, path));
  for (const Json& json : list_of(file, "textures")) {
    const Item item{json, "texture", document.pictures.size(), path};
    Picture picture;
    VOX_TRY(picture.image, index_of(item, "source", document.images.size(), "image"));
    if (const Json* const webp = item.extension("EXT_texture_webp")) {
      VOX_TRY(picture.webp, index_of(item.below(*webp), "source", document.images.size(), "image"));
    }
    VOX_TRY(const uint32_t sampler, index_of(item, "sampler", samplers.size(), "sampler"));
    if (sampler != none) picture.sampler = samplers[sampler];
    document.pictures.push_back(picture);
  }
  return {};
}

Status read_materials(const Json& file, const std::string& path, Document& document, bool rm) {
  size_t index = 0;
  for (const Json& json : list_of(file, "materials"))
    VOX_CHECK(read_material({json, "material", index++, path}, document, rm));
  note_materials(file, document, rm);
  return {};
}

}  // namespace voxkit::gltf
