#include "libcolor/attributes/attribute_encode.h"

#include <algorithm>
#include <cmath>

#include "formats/little_endian.h"
#include "libcolor/blocks/block_encode.h"
#include "libcolor/blocks/directions.h"
#include "libcolor/blocks/lab_colors.h"
#include "libcolor/palette/palette_encode.h"

namespace voxkit::color {
namespace {

using Values = std::span<const std::byte>;

EncodedPart as_they_are(Values values) {
  EncodedPart part;
  part.bytes.assign(values.begin(), values.end());
  return part;
}

EncodedPart encode_blocks(Values values, const AttributeParams& p, int effort) {
  const size_t bytes = kind_of(p.attribute).bytes;
  std::vector<Rgb> colors(values.size() / bytes);
  for (size_t i = 0; i < colors.size(); ++i) {
    const uint32_t v = value_at(&values[i * bytes], bytes);
    colors[i] = {static_cast<uint8_t>(v & 255), static_cast<uint8_t>(v >> 8 & 255),
                 static_cast<uint8_t>(v >> 16)};
  }
  const int weight_bits = p.codec == ColorCodec::fws ? p.weight_bits : 0;
  return encode_part(colors, p.endpoints, {p.threshold, weight_bits, effort, p.space});
}

EncodedPart encode_ids(Values values, int effort) {
  const size_t bytes = kind_of(Attribute::id).bytes, count = values.size() / bytes;
  std::vector<uint32_t> all(count), ids;
  for (size_t i = 0; i < count; ++i) all[i] = value_at(&values[i * bytes], bytes);
  ids = all;
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  EncodedPart part;
  if (ids.size() <= most_palette_colors) {
    std::vector<uint16_t> numbers(count);
    for (size_t i = 0; i < count; ++i)
      numbers[i] =
          i > 0 && all[i] == all[i - 1]
              ? numbers[i - 1]
              : static_cast<uint16_t>(std::lower_bound(ids.begin(), ids.end(), all[i]) - ids.begin());
    encode_palette_numbers(numbers, static_cast<uint32_t>(ids.size()), effort, part);
    std::vector<std::byte> head(bytes * (ids.size() + 1));
    store_le(head.data(), static_cast<uint32_t>(ids.size()));
    for (size_t i = 0; i < ids.size(); ++i) store_le(&head[bytes * (i + 1)], ids[i]);
    part.bytes.insert(part.bytes.begin(), head.begin(), head.end());
  }
  if (part.bytes.empty() || part.bytes.size() > values.size() + bytes) {
    part.blocks = 0;
    part.bytes.assign(bytes, std::byte{0});
    part.bytes.insert(part.bytes.end(), values.begin(), values.end());
  }
  return part;
}

}  // namespace

EncodedPart encode_attribute_part(Values values, const AttributeParams& params, int effort) {
  const size_t bytes = kind_of(params.attribute).bytes;
  if (std::equal(values.begin() + static_cast<std::ptrdiff_t>(bytes), values.end(), values.begin()))
    return as_they_are(values.first(bytes));
  if (params.codec == ColorCodec::raw) return as_they_are(values);
  return params.codec == ColorCodec::palette ? encode_ids(values, effort)
                                             : encode_blocks(values, params, effort);
}

double most_error_of(uint32_t most_squared, ErrorSpace space) {
  if (space == ErrorSpace::angle) return chord_angle(most_squared);
  const double error = std::sqrt(static_cast<double>(most_squared));
  return space == ErrorSpace::lab ? error / lab_scale : error;
}

}  // namespace voxkit::color
