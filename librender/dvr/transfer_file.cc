// Transfer functions from JSON files.
#include <fmt/core.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "formats/mapped_file.h"
#include "librender/dvr/transfer.h"

namespace voxkit::render {
namespace {

using Json = nlohmann::json;

constexpr size_t largest_file = size_t{1} << 20;
constexpr const char* form = "{\"points\": [{\"value\": v, \"rgba\": [r, g, b, a]}, ...]}";

}  // namespace

Result<std::vector<TransferPoint>> read_transfer_file(const std::string& path) {
  VOX_TRY(const auto file, MappedFile::open(path));
  const auto bytes = file->bytes();
  if (bytes.size() > largest_file)
    return bad_input(path, fmt::format("a transfer function of {} bytes: expected at most {}", bytes.size(),
                                       largest_file));
  const char* const text = reinterpret_cast<const char*>(bytes.data());
  // A file that deep nesting makes expensive is stopped where no transfer function goes.
  constexpr int deepest = 4;
  const Json json = Json::parse(
      text, text + bytes.size(), [](int depth, Json::parse_event_t, Json&) { return depth <= deepest; },
      false);
  if (json.is_discarded() || !json.is_object() || json.size() != 1 || !json.contains("points") ||
      !json["points"].is_array() || json["points"].empty())
    return bad_input(path, fmt::format("not a transfer function: expected {}", form));
  std::vector<TransferPoint> points;
  for (const Json& item : json["points"]) {
    const auto wrong = [&](const std::string& what) {
      return bad_input(path, fmt::format("points[{}]: {}", points.size(), what));
    };
    if (!item.is_object() || item.size() != 2 || !item.contains("value") || !item.contains("rgba"))
      return wrong("expected {\"value\": v, \"rgba\": [r, g, b, a]}");
    const Json &value = item["value"], &rgba = item["rgba"];
    if (!value.is_number() || !(std::abs(value.get<double>()) <= 0x1.fffffep127))
      return wrong("\"value\": expected a number, within 3.4e38 of 0");
    if (!rgba.is_array() || rgba.size() != 4) return wrong("\"rgba\": expected 4 numbers from 0 to 1");
    TransferPoint point{value.get<double>(), {}};
    for (size_t k = 0; k < 4; ++k) {
      if (!rgba[k].is_number() || !(rgba[k].get<double>() >= 0 && rgba[k].get<double>() <= 1))
        return wrong("\"rgba\": expected 4 numbers from 0 to 1");
      point.rgba[k] = rgba[k].get<double>();
    }
    if (!points.empty() && !(point.value >= points.back().value))
      return wrong(fmt::format("\"value\" is {}: expected at least {}, that of the point before", point.value,
                               points.back().value));
    points.push_back(point);
  }
  return points;
}

}  // namespace voxkit::render
