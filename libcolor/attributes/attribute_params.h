// What a file says about each of its attributes, and which codec and bound an attribute gets. FORMAT.md,
// section 4.11.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/container.h"
#include "libcolor/params.h"
#include "libcolor/surface/attributes.h"

namespace voxkit::color {

inline constexpr uint32_t attribute_params_kind = chunk_kind("ATTP");  ///< index: the attribute
inline constexpr uint32_t attribute_values_kind = chunk_kind("ATTR");  ///< the same, by part

struct AttributeParams {
  Attribute attribute = Attribute::emissive;
  ColorCodec codec = ColorCodec::vws;       ///< raw, fws, vws or palette
  Endpoints endpoints = Endpoints::rgb888;  ///< of fws and vws
  // For the reader's information.
  int weight_bits = 0;                 ///< of fws
  ErrorSpace space = ErrorSpace::rgb;  ///< of the threshold and the error
  double threshold = 0;                ///< of fws and vws: greatest error of a value
  double most_error = 0;               ///< the greatest that there is
  uint64_t bytes = 0, blocks = 0;      ///< of all parts
};

/// How an attribute is stored with these options: ids with palettes, others as colours are where these are
/// raw or fws, else vws.
AttributeParams attribute_plan(Attribute attribute, const Options& options);

/// How far a value is from another one, where the space says: of emission as colours are, degrees of normals,
/// a distance of bytes; of ids 0, or 1 where they differ.
double attribute_error(Attribute attribute, ErrorSpace space, uint32_t a, uint32_t b);

/// Those of a value as they lie in memory and in files, as a number, and back: the lowest byte first.
inline uint32_t value_at(const std::byte* bytes, size_t count) {
  uint32_t value = 0;
  for (size_t i = 0; i < count; ++i) value |= std::to_integer<uint32_t>(bytes[i]) << 8 * i;
  return value;
}
inline void put_value(uint32_t value, size_t count, std::byte* bytes) {
  for (size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::byte>(value >> 8 * i & 0xff);
}

/// The chunk 'ATTP'.
std::vector<std::byte> pack_attribute(const AttributeParams& params);
/// Its contents, each field as FORMAT.md allows it.
Result<AttributeParams> unpack_attribute(Attribute attribute, std::span<const std::byte> bytes,
                                         const std::string& file);

}  // namespace voxkit::color
