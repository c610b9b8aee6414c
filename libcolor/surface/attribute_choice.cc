#include "libcolor/surface/attribute_choice.h"

#include <fmt/format.h>

#include <string>

namespace voxkit::color {

Result<AttributeSet> choose_attributes(const std::optional<AttributeSet>& wanted, AttributeSet can,
                                       AttributeSet by_itself) {
  if (!wanted) return by_itself;
  std::string lacks, has = "color";
  for (size_t i = 0; i < attribute_kinds.size(); ++i) {
    const auto attribute = static_cast<Attribute>(i);
    if (can.has(attribute)) has += fmt::format(", {}", attribute_kinds[i].name);
    if (wanted->has(attribute) && !can.has(attribute))
      lacks += fmt::format("{}{}", lacks.empty() ? "" : ", ", attribute_kinds[i].name);
  }
  if (!lacks.empty())
    return bad_usage(fmt::format("attributes: it has no {}: expected some of {}", lacks, has));
  return *wanted;
}

}  // namespace voxkit::color
