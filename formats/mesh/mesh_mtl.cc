// Materials of .obj files.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <vector>

#include "formats/lab.h"
#include "formats/mapped_file.h"
#include "formats/mesh/mesh_obj.h"
#include "formats/mesh/text_statements.h"

namespace voxkit {
namespace {

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

/// Words of the options and the name of a map.
struct MapWords {
  PictureReference picture;
  MapTransform transform;
  PictureWrap wrap = PictureWrap::repeat;
};

class MtlReader {
 public:
  MtlReader(std::span<const std::byte> bytes, const std::string& path, MaterialLibrary& library)
      : lines_(bytes), path_(path), library_(library) {}

  Status read() {
    while (lines_.next()) {
      const std::string keyword = lower(lines_.word());
      if (keyword == "newmtl") {
        const std::string name(lines_.rest());
        // The first of a name counts, as with those who write libraries for many files.
        const auto [at, is_new] = library_.materials.try_emplace(name);
        if (!is_new) unused_ = {};
        now_ = is_new ? &at->second : &unused_;
        now_->material.name = name;
        now_->maps.alpha_from_picture = true;
        dissolved_ = false;
      } else if (now_) {
        VOX_CHECK(read_property(keyword));
      } else if (!keyword.empty()) {
        return bad(fmt::format("{}: expected newmtl before", keyword));
      }
    }
    return {};
  }

  /// Opacity lies on the picture of colours: as that does.
  Status join_opacity() {
    for (const auto& [material, transform, wrap] : opacity_) {
      if (!material->maps.color.used()) {
        material->color = transform;
        material->material.wrap_u = material->material.wrap_v = wrap;
      } else if (!(material->color == transform) || material->material.wrap_u != wrap) {
        return bad_input(path_,
                         fmt::format("material {}: map_d has other options than map_Kd: expected the same",
                                     material->material.name));
      }
    }
    return {};
  }

 private:
  tl::unexpected<Error> bad(const std::string& what) const {
    return bad_input(path_, fmt::format("corrupt MTL file: line {}: {}", lines_.line(), what));
  }

  Status read_property(const std::string& keyword) {
    MeshMaterial& material = now_->material;
    if (keyword == "kd") {
      VOX_TRY(const glm::vec3 color, read_color(keyword));
      material.color = glm::vec4(color, material.color.a);
    } else if (keyword == "ke") {
      VOX_TRY(material.emission, read_color(keyword));
    } else if (keyword == "d" || keyword == "tr") {
      std::string_view word = lines_.word();
      if (word == "-halo") {
        library_.dropped.insert("-halo of opacity");
        word = lines_.word();
      }
      const auto value = number_of(word);
      if (!value || !(std::abs(*value) < 1e30))
        return bad(fmt::format("{} {}: expected a number", keyword, word));
      if (keyword == "tr" && dissolved_) return {};
      dissolved_ = keyword == "d";
      material.color.a = static_cast<float>(dissolved_ ? *value : 1 - *value);
      material.alpha_mode = material.color.a < 1 ? AlphaMode::blend : AlphaMode::opaque;
    } else if (keyword == "map_kd") {
      VOX_TRY(const MapWords map, read_map());
      now_->maps.color = map.picture;
      now_->color = map.transform;
      material.wrap_u = material.wrap_v = map.wrap;
    } else if (keyword == "map_ke") {
      VOX_TRY(const MapWords map, read_map());
      now_->maps.emission = map.picture;
      now_->emission = map.transform;
      material.emission_wrap_u = material.emission_wrap_v = map.wrap;
      // A map alone is seen: it is multiplied by 1.
      if (!material.emits()) material.emission = glm::vec3(1);
    } else if (keyword == "map_d") {
      VOX_TRY(const MapWords map, read_map());
      now_->maps.opacity = map.picture;
      if (now_ != &unused_) opacity_.push_back({now_, map.transform, map.wrap});
    } else if (is_any(keyword, {"map_ks", "map_ns", "map_bump", "bump", "norm", "disp", "map_disp", "decal",
                                "refl", "map_pr", "map_pm", "map_ps", "map_tr", "map_refl"})) {
      library_.dropped.insert(keyword);
    } else if (library_.rm && (keyword == "pr" || keyword == "pm")) {
      const std::string_view word = lines_.word();
      const auto value = number_of(word);
      if (!value || !(std::abs(*value) < 1e30))
        return bad(fmt::format("{} {}: expected a number", keyword, word));
      (keyword == "pr" ? material.roughness : material.metalness) = static_cast<float>(*value);
    } else if (is_any(keyword, {"ks", "pr", "pm", "ps", "pc", "tf"})) {
      // Highlights, metal, sheen and tinted glass; programs write "Ks 0 0 0" into every material.
      const auto value = number_of(lines_.word());
      if (value && *value != (keyword == "tf" ? 1 : 0)) library_.dropped.insert(keyword);
    }
    return {};
  }
  static bool is_any(const std::string& word, std::initializer_list<const char*> list) {
    return std::find(list.begin(), list.end(), word) != list.end();
  }

  /// One number stands for all three.
  Result<glm::vec3> read_color(const std::string& keyword) {
    glm::vec3 color(0);
    for (int c = 0; c < 3; ++c) {
      const std::string_view word = lines_.word();
      const auto value = number_of(word);
      if (!value && c == 1 && word.empty()) return glm::vec3(color.r);
      if (!value) return bad(fmt::format("{} {}: expected red, green and blue", keyword, word));
      color[c] = static_cast<float>(srgb_to_linear(static_cast<float>(*value)));
    }
    return color;
  }

  /// Options, then the name, which may have spaces.
  Result<MapWords> read_map() {
    MapWords out;
    std::string_view left = lines_.rest();
    const auto next = [&] {
      const size_t end = std::min(left.find_first_of(" \t"), left.size());
      const std::string_view word = left.substr(0, end);
      left.remove_prefix(std::min(left.find_first_not_of(" \t", end), left.size()));
      return word;
    };
    // Up to three numbers; what is last is the name.
    const auto numbers = [&](double* to, int most) {
      int count = 0;
      while (count < most) {
        const std::string_view before = left;
        const auto value = number_of(next());
        if (!value || left.empty()) {
          left = before;
          break;
        }
        to[count++] = *value;
      }
      return count;
    };
    while (left.starts_with('-')) {
      const std::string_view before = left;
      const std::string option = lower(next());
      double values[3] = {0, 0, 0};
      if (option == "-s" || option == "-o" || option == "-t") {
        const int count = numbers(values, 3);
        if (count == 0) return bad(fmt::format("{}: expected numbers", option));
        for (int i = 0; i < std::min(count, 2) && option != "-t"; ++i)
          (option == "-s" ? out.transform.scale : out.transform.offset)[i] = values[i];
        if (option == "-t" && (values[0] != 0 || values[1] != 0)) library_.dropped.insert("-t of maps");
        if (!(std::abs(values[0]) < 1e30 && std::abs(values[1]) < 1e30))
          return bad(fmt::format("{}: expected finite numbers", option));
      } else if (option == "-mm") {
        if (numbers(values, 2) != 2 || !(std::abs(values[0]) < 1e6 && std::abs(values[1]) < 1e6))
          return bad("-mm: expected two numbers");
        out.picture.base = static_cast<float>(values[0]);
        out.picture.gain = static_cast<float>(values[1]);
      } else if (option == "-clamp") {
        out.wrap = lower(next()) == "on" ? PictureWrap::clamp : PictureWrap::repeat;
      } else if (option == "-imfchan") {
        const std::string channel = lower(next());
        if (channel.size() == 1 && std::string_view("rgbml").find(channel[0]) != std::string_view::npos)
          out.picture.channel = channel[0];
        else
          return bad(fmt::format("-imfchan {}: expected r, g, b, m or l", channel));
      } else if (is_any(option, {"-blendu", "-blendv", "-boost", "-bm", "-cc", "-texres", "-type"})) {
        next();  // of how it is filtered, and of other maps
      } else {
        left = before;  // a name
        break;
      }
    }
    if (left.size() > 1 && left.front() == '"' && left.back() == '"') left = left.substr(1, left.size() - 2);
    if (left.empty()) return bad("a map without the name of its file");
    out.picture.name = left;
    out.picture.library = path_;
    return out;
  }

  struct Opacity {
    ObjMaterial* material;
    MapTransform transform;
    PictureWrap wrap;
  };
  TextStatements lines_;
  const std::string& path_;
  MaterialLibrary& library_;
  ObjMaterial* now_ = nullptr;
  ObjMaterial unused_;
  bool dissolved_ = false;  ///< by d
  std::vector<Opacity> opacity_;
};

}  // namespace

Status read_mtl(const std::string& path, MaterialLibrary& library) {
  VOX_TRY(const auto file, MappedFile::open(path));
  MtlReader reader(file->bytes(), path, library);
  VOX_CHECK(reader.read());
  return reader.join_opacity();
}

}  // namespace voxkit
