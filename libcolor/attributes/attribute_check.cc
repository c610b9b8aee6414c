#include <fmt/format.h>

#include "libcolor/attributes/attribute_encode.h"
#include "libcolor/attributes/attribute_part.h"
#include "libcolor/blocks/block_check.h"
#include "libcolor/palette/palette_check.h"

namespace voxkit::color {

std::string check_attribute_part(std::span<const std::byte> part, const AttributeParams& params,
                                 uint32_t count) {
  const AttributePart view(part.data(), part.size(), count, AttributeStorage(params));
  switch (view.way()) {
    case AttributePart::Way::none:
      return fmt::format("{} bytes: not those that its {} values take", part.size(), count);
    case AttributePart::Way::blocks: {
      Params blocks;
      blocks.endpoints = params.endpoints;
      return check_block_part(part, blocks, count);
    }
    case AttributePart::Way::ids:
      for (uint32_t i = 1; i < view.ids(); ++i)
        if (view.id(i - 1) >= view.id(i)) return "ids out of order";
      return check_palette_part(view.numbers(), view.ids());
    default:
      return {};
  }
}

}  // namespace voxkit::color
