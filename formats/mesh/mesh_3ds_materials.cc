// Materials of 3DS files.
#include <algorithm>
#include <cmath>

#include "formats/lab.h"
#include "formats/mesh/mesh_3ds_parts.h"

namespace voxkit::studio {
namespace {

/// Maps that are no colour.
const char* name_of_map(uint16_t id) {
  switch (id) {
    case 0xa204:
      return "maps of highlights";
    case 0xa33c:
      return "maps of shininess";
    case 0xa230:
      return "bump maps";
    case 0xa220:
      return "maps of reflections";
    case 0xa33d:
      return "maps of self-illumination";
    case 0xa33a:
      return "second textures";
    case 0xa33e:
    case 0xa340:
    case 0xa342:
    case 0xa344:
    case 0xa346:
    case 0xa348:
    case 0xa34a:
    case 0xa34c:
      return "masks of maps";
    default:
      return nullptr;
  }
}

/// Linear light; a linear colour is taken where there is no other.
Result<glm::vec3> read_color(Body body) {
  glm::vec3 color(0);
  bool found = false;
  while (body.has_chunk()) {
    VOX_TRY(Body::Chunk chunk, body.chunk());
    const bool linear = chunk.id == lin_color_24 || chunk.id == lin_color_f,
               floats = chunk.id == color_f || chunk.id == lin_color_f;
    if ((!linear && !floats && chunk.id != color_24) || (linear && found)) continue;
    for (int c = 0; c < 3; ++c) {
      double stored = 0;
      if (floats) {
        VOX_TRY(stored, chunk.body.number<float>());
      } else {
        VOX_TRY(const auto byte, chunk.body.number<uint8_t>());
        stored = byte / 255.0;
      }
      stored = stored > 0 ? std::min(stored, 1.0) : 0;  // and of a NaN 0
      color[c] = static_cast<float>(linear ? stored : srgb_to_linear(stored));
    }
    found |= !linear;
  }
  return color;
}

/// 0 to 1; `otherwise` where none is said.
Result<double> read_share(Body body, double otherwise) {
  double share = otherwise;
  while (body.has_chunk()) {
    VOX_TRY(Body::Chunk chunk, body.chunk());
    if (chunk.id == int_percentage) {
      VOX_TRY(const auto percent, chunk.body.number<int16_t>());
      share = percent / 100.0;
    } else if (chunk.id == float_percentage) {
      VOX_TRY(share, chunk.body.number<float>());
    }
  }
  return share > 0 ? std::min(share, 1.0) : 0;
}

struct Map {
  PictureReference picture;
  double amount = 1;
  PictureWrap wrap = PictureWrap::repeat;
  glm::dvec2 scale{1, 1}, offset{0, 0};
  bool is_like(const Map& other) const {
    return scale == other.scale && offset == other.offset && wrap == other.wrap;
  }
};

Result<Map> read_map(Body body, std::set<std::string>& dropped) {
  Map map;
  VOX_TRY(map.amount, read_share(body, 1));
  while (body.has_chunk()) {
    VOX_TRY(Body::Chunk chunk, body.chunk());
    const auto number = [&]() -> Result<double> {
      VOX_TRY(const auto value, chunk.body.number<float>());
      if (!(std::abs(value) < 1e30f)) return body.bad(chunk.body.at() - 4, "expected a finite number");
      return value;
    };
    switch (chunk.id) {
      case mat_mapname: {
        VOX_TRY(map.picture.name, chunk.body.text());
        break;
      }
      case mat_map_tiling: {
        constexpr uint16_t mirror = 2, negate = 4, once = 16, tints = 0x280, from_alpha = 0x40;
        VOX_TRY(const auto flags, chunk.body.number<uint16_t>());
        if (flags & negate) map.picture.base = 1, map.picture.gain = -1;
        if (flags & once) {
          map.wrap = PictureWrap::clamp;
          dropped.insert("that textures are not repeated: their edges are");
        } else if (flags & mirror) {
          map.wrap = PictureWrap::mirror;
        }
        if (flags & tints) dropped.insert("tints of textures");
        if (flags & from_alpha) dropped.insert("that maps are alpha");
        break;
      }
      case mat_map_uscale: {
        VOX_TRY(map.scale.x, number());
        break;
      }
      case mat_map_vscale: {
        VOX_TRY(map.scale.y, number());
        break;
      }
      case mat_map_uoffset: {
        VOX_TRY(map.offset.x, number());
        break;
      }
      case mat_map_voffset: {
        VOX_TRY(map.offset.y, number());
        break;
      }
      case mat_map_ang: {
        VOX_TRY(const double angle, number());
        if (angle != 0) dropped.insert("angles of textures");
        break;
      }
      default:
        break;
    }
  }
  // As programs take it: no scale was set.
  for (int a = 0; a < 2; ++a)
    if (map.scale[a] == 0) map.scale[a] = 1;
  return map;
}

}  // namespace

Result<Material> read_material(Body body, std::set<std::string>& dropped) {
  Material out;
  Map texture, opacity;
  double clear = 0;
  while (body.has_chunk()) {
    VOX_TRY(Body::Chunk chunk, body.chunk());
    switch (chunk.id) {
      case mat_name: {
        VOX_TRY(out.material.name, chunk.body.text());
        break;
      }
      case mat_diffuse: {
        VOX_TRY(const glm::vec3 color, read_color(chunk.body));
        out.plain = glm::vec4(color, 1);
        break;
      }
      case mat_specular: {
        VOX_TRY(const glm::vec3 color, read_color(chunk.body));
        if (color != glm::vec3(0)) dropped.insert("highlights");
        break;
      }
      case mat_transparency: {
        VOX_TRY(clear, read_share(chunk.body, 0));
        break;
      }
      case mat_self_illum: {
        // A mark, or, as some programs write it, a colour.
        VOX_TRY(const glm::vec3 color, read_color(chunk.body));
        if (chunk.body.left() == 0 || color != glm::vec3(0)) dropped.insert("self-illumination");
        break;
      }
      case mat_self_ilpct: {
        VOX_TRY(const double share, read_share(chunk.body, 0));
        if (share > 0) dropped.insert("self-illumination");
        break;
      }
      case mat_texmap: {
        VOX_TRY(texture, read_map(chunk.body, dropped));
        break;
      }
      case mat_opacmap: {
        VOX_TRY(opacity, read_map(chunk.body, dropped));
        break;
      }
      default:
        if (const char* name = name_of_map(chunk.id)) dropped.insert(name);
    }
  }
  out.plain.a = static_cast<float>(1 - clear);
  out.material.color = out.plain;
  if (clear > 0) out.material.alpha_mode = AlphaMode::blend;
  const bool has_texture = texture.picture.used() && texture.amount > 0;
  if (has_texture) {
    if (texture.amount < 1) dropped.insert("amounts of textures below 100 %");
    out.material.color = glm::vec4(1, 1, 1, out.plain.a);
    out.maps.color = texture.picture;
  }
  if (opacity.picture.used() && opacity.amount > 0) {
    if (has_texture && !opacity.is_like(texture))
      dropped.insert("that opacity maps lie otherwise than their textures");
    opacity.picture.channel = 'l';
    out.maps.opacity = opacity.picture;
    out.maps.alpha_from_picture = true;
  }
  const Map& first = has_texture ? texture : opacity;
  out.material.wrap_u = out.material.wrap_v = first.wrap;
  out.scale = first.scale;
  out.offset = first.offset;
  return out;
}

}  // namespace voxkit::studio
