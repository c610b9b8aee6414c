// Which attributes an input delivers.
#pragma once

#include <optional>

#include "formats/result.h"
#include "libcolor/surface/attributes.h"

namespace voxkit::color {

/// Those that are wanted, of those that an input `can` have; where nothing is said, what it has `by itself`.
/// ErrorCode::usage where one is wanted that it cannot have.
Result<AttributeSet> choose_attributes(const std::optional<AttributeSet>& wanted, AttributeSet can,
                                       AttributeSet by_itself);

/// Adds where a condition holds.
inline void add_if(AttributeSet& set, Attribute attribute, bool holds) {
  if (holds) set.add(attribute);
}

}  // namespace voxkit::color
