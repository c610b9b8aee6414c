// Members of JSON objects, checked, as part of the reader of glTF.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "formats/mesh/gltf_document.h"

namespace voxkit::gltf {

using Json = nlohmann::json;

/// Something of a file, and how errors call it: "accessor 3".
struct Item {
  const Json& json;
  const char* kind;
  size_t index;
  const std::string& path;

  tl::unexpected<Error> bad(std::string_view rule) const {
    return bad_input(path, fmt::format("corrupt glTF file: {} {}: {}", kind, index, rule));
  }
  /// An object below, called the same; null where it is not there.
  const Json* find(const char* name) const {
    const auto at = json.is_object() ? json.find(name) : json.end();
    return json.is_object() && at != json.end() ? &*at : nullptr;
  }
  Item below(const Json& part) const { return {part, kind, index, path}; }
  /// An extension of it; null where it is not there.
  const Json* extension(const char* name) const {
    const Json* const all = find("extensions");
    return all ? below(*all).find(name) : nullptr;
  }
};

/// A list of the file or of an object; empty where it is not there, or is none.
inline const Json& list_of(const Json& object, const char* name) {
  static const Json empty = Json::array();
  const auto at = object.is_object() ? object.find(name) : object.end();
  return object.is_object() && at != object.end() && at->is_array() ? *at : empty;
}

/// A whole number; nothing where it is something else; `otherwise` where it is not said.
inline std::optional<uint64_t> whole(const Item& item, const char* name,
                                     std::optional<uint64_t> otherwise = {}) {
  const Json* const at = item.find(name);
  if (!at) return otherwise;
  // 3.0 is a whole number, too.
  if (at->is_number_float() && at->get<double>() >= 0 && at->get<double>() <= 9007199254740992.0 &&
      at->get<double>() == std::floor(at->get<double>()))
    return static_cast<uint64_t>(at->get<double>());
  if (!at->is_number_unsigned() || at->get<uint64_t>() > uint64_t{1} << 53) return std::nullopt;
  return at->get<uint64_t>();
}

/// The number of something in a list of `count`; `none` where it is not said.
inline Result<uint32_t> index_of(const Item& item, const char* name, size_t count, const char* what) {
  if (!item.find(name)) return none;
  const auto value = whole(item, name);
  if (!value || *value >= count)
    return item.bad(fmt::format("expected the number of a {} in {}", what, name));
  return static_cast<uint32_t>(*value);
}

inline bool is_finite_number(const Json& value) {
  return value.is_number() && std::isfinite(value.get<double>());
}
/// Numbers of a list of that length into `to`, which stay where it is not there. False where it is none.
template <size_t n, class To>
bool numbers(const Item& item, const char* name, To& to) {
  const Json* const at = item.find(name);
  if (!at) return true;
  if (!at->is_array() || at->size() != n) return false;
  for (size_t i = 0; i < n; ++i) {
    if (!is_finite_number((*at)[i])) return false;
    to[static_cast<int>(i)] = static_cast<std::decay_t<decltype(to[0])>>((*at)[i].get<double>());
  }
  return true;
}
inline bool number(const Item& item, const char* name, double& to) {
  const Json* const at = item.find(name);
  if (!at) return true;
  if (!is_finite_number(*at)) return false;
  to = at->get<double>();
  return true;
}
inline std::string text_of(const Item& item, const char* name) {
  const Json* const at = item.find(name);
  return at && at->is_string() ? at->get<std::string>() : std::string();
}

/// Pictures and materials: gltf_materials.cc. `document` has images already.
Status read_pictures(const Json& file, const std::string& path, Document& document);
Status read_materials(const Json& file, const std::string& path, Document& document, bool rm);
/// What parse_voxel_grid makes of such an object: voxel_grid.cc.
std::optional<VolumeInfo> voxel_grid_of(const Json& grid);

}  // namespace voxkit::gltf
