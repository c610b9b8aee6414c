#include "formats/mesh/voxel_grid.h"

#include <cmath>

#include "formats/mesh/gltf_json.h"

namespace voxkit {
namespace {

using gltf::Json;
constexpr uint64_t most_side = uint64_t{1} << 21;
constexpr size_t most_text = size_t{1} << 16, most_description = 4096;

/// A list of three, each of which `read` takes; false where it is none.
template <class Read>
bool three(const Json& object, const char* name, const Read& read) {
  const auto list = object.find(name);
  if (list == object.end() || !list->is_array() || list->size() != 3) return false;
  for (size_t i = 0; i < 3; ++i)
    if (!read(i, (*list)[i])) return false;
  return true;
}
bool finite(const Json& value, double& to) {
  if (!value.is_number()) return false;
  to = value.get<double>();
  return std::isfinite(to);
}
std::string words(const Json& object, const char* name) {
  const auto value = object.find(name);
  return value != object.end() && value->is_string() ? value->get<std::string>() : std::string();
}

}  // namespace

std::string voxel_grid_text(const VolumeInfo& info) {
  nlohmann::ordered_json grid;
  grid["dims"] = {info.dims.x, info.dims.y, info.dims.z};
  grid["axes"] = info.affine.axes;
  grid["origin"] = info.affine.origin;
  if (info.world != World::unknown) grid["world"] = name(info.world);
  if (info.unit != Unit::unknown) grid["unit"] = name(info.unit);
  if (info.space_code != 0) grid["space_code"] = info.space_code;
  if (!info.description.empty()) grid["description"] = info.description;
  return grid.dump(-1, ' ', /*ensure_ascii=*/true, Json::error_handler_t::replace);
}

std::optional<VolumeInfo> parse_voxel_grid(std::string_view text) {
  if (text.size() > most_text) return std::nullopt;
  return gltf::voxel_grid_of(Json::parse(text.begin(), text.end(), nullptr, /*allow_exceptions=*/false));
}

std::optional<VolumeInfo> gltf::voxel_grid_of(const Json& grid) {
  if (!grid.is_object()) return std::nullopt;
  VolumeInfo info;
  info.format = VoxelFormat::rgba32;
  const bool sides = three(grid, "dims", [&](size_t i, const Json& value) {
    if (!value.is_number_unsigned() || value.get<uint64_t>() < 1 || value.get<uint64_t>() > most_side)
      return false;
    info.dims[static_cast<Index3::length_type>(i)] = value.get<int64_t>();
    return true;
  });
  const bool axes = three(grid, "axes", [&](size_t i, const Json& axis) {
    if (!axis.is_array() || axis.size() != 3) return false;
    for (size_t c = 0; c < 3; ++c)
      if (!finite(axis[c], info.affine.axes[i][c])) return false;
    return true;
  });
  const bool origin = three(
      grid, "origin", [&](size_t c, const Json& value) { return finite(value, info.affine.origin[c]); });
  if (!sides || !axes || !origin || !info.affine.is_valid() || !checked_voxels(info.dims))
    return std::nullopt;
  const std::string world = words(grid, "world");
  for (int w = 0; w <= static_cast<int>(World::left_handed); ++w)
    if (name(static_cast<World>(w)) == world) info.world = static_cast<World>(w);
  info.unit = parse_unit(words(grid, "unit")).value_or(Unit::unknown);
  if (const auto code = grid.find("space_code");
      code != grid.end() && code->is_number_unsigned() && code->get<uint64_t>() <= 4)
    info.space_code = static_cast<uint8_t>(code->get<uint64_t>());
  // One line of what it may be.
  info.description = words(grid, "description");
  for (char& c : info.description)
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = ' ';
  if (info.description.size() > most_description) info.description.clear();
  return info;
}

}  // namespace voxkit
