// From values of an attribute to a part of them.
#pragma once

#include "libcolor/attributes/attribute_params.h"
#include "libcolor/encoded_part.h"

namespace voxkit::color {

/// Encodes 1 to 2^20 values, each with the bytes that its kind has. `effort`, 1 to 9, as of colours. Errors
/// of what comes of it are in the space of `params`.
EncodedPart encode_attribute_part(std::span<const std::byte> values, const AttributeParams& params,
                                  int effort);

/// The greatest error of parts that were encoded so, of the most squared one, in the unit of the threshold.
double most_error_of(uint32_t most_squared, ErrorSpace space);

/// What in a part of so many values is not as FORMAT.md says, in words; empty if nothing is.
std::string check_attribute_part(std::span<const std::byte> part, const AttributeParams& params,
                                 uint32_t count);

}  // namespace voxkit::color
