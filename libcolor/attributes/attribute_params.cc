#include "libcolor/attributes/attribute_params.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/lab.h"
#include "formats/little_endian.h"
#include "libcolor/blocks/block_encode.h"
#include "libcolor/blocks/directions.h"

namespace voxkit::color {
namespace {

constexpr size_t chunk_bytes = 64;

/// Of an attribute whose bound is not said.
double default_threshold(Attribute attribute, const Options& options) {
  switch (attribute) {
    case Attribute::emissive:
      return has_threshold(options.codec) ? options.threshold : Options{}.threshold;
    case Attribute::opacity:
      return 4;
    case Attribute::normal:
      return 3;
    case Attribute::rm:
      return 8;
    case Attribute::id:
      break;
  }
  return 0;
}

Endpoints endpoints_of(Attribute attribute, double threshold, ErrorSpace space) {
  if (attribute == Attribute::emissive) return endpoints_for(threshold, space);
  return kind_of(attribute).bytes == 1 ? Endpoints::one : Endpoints::two;
}

Lab lab_of(uint32_t value) {
  const auto channel = [&](int i) { return srgb_to_linear((value >> 8 * i & 255) / 255.0); };
  return lab_of_linear(channel(0), channel(1), channel(2));
}

}  // namespace

AttributeParams attribute_plan(Attribute attribute, const Options& options) {
  AttributeParams p;
  p.attribute = attribute;
  if (attribute == Attribute::normal) p.space = ErrorSpace::angle;
  if (options.codec == ColorCodec::raw || attribute == Attribute::id) {
    p.codec = options.codec == ColorCodec::raw ? ColorCodec::raw : ColorCodec::palette;
    return p;
  }
  if (options.codec == ColorCodec::fws) {
    p.codec = ColorCodec::fws;
    p.weight_bits = options.weight_bits;
  }
  p.threshold = options.attribute_thresholds[static_cast<size_t>(attribute)].value_or(
      default_threshold(attribute, options));
  if (attribute == Attribute::emissive && has_threshold(options.codec)) p.space = options.space;
  p.endpoints = endpoints_of(attribute, p.threshold, p.space);
  return p;
}

double attribute_error(Attribute attribute, ErrorSpace space, uint32_t a, uint32_t b) {
  if (a == b) return 0;
  if (attribute == Attribute::id) return 1;
  if (space == ErrorSpace::angle) {
    const auto direction = [](uint32_t v) {
      return Octahedral{static_cast<uint8_t>(v & 255), static_cast<uint8_t>(v >> 8)};
    };
    return angle_between(direction(a), direction(b));
  }
  if (space == ErrorSpace::lab) return delta_e(lab_of(a), lab_of(b));
  int squared = 0;
  for (int i = 0; i < 3; ++i) {
    const int apart = static_cast<int>(a >> 8 * i & 255) - static_cast<int>(b >> 8 * i & 255);
    squared += apart * apart;
  }
  return std::sqrt(squared);
}

std::vector<std::byte> pack_attribute(const AttributeParams& p) {
  std::vector<std::byte> bytes(chunk_bytes);
  bytes[0] = static_cast<std::byte>(p.codec);
  if (makes_blocks(p.codec)) bytes[1] = static_cast<std::byte>(p.endpoints);
  bytes[2] = static_cast<std::byte>(p.weight_bits);
  bytes[3] = static_cast<std::byte>(p.space);
  store_le(&bytes[8], p.threshold);
  store_le(&bytes[16], p.most_error);
  store_le(&bytes[24], p.bytes);
  store_le(&bytes[32], p.blocks);
  return bytes;
}

Result<AttributeParams> unpack_attribute(Attribute attribute, std::span<const std::byte> bytes,
                                         const std::string& file) {
  const auto bad = [&](size_t at, const std::string& what) {
    return bad_input(file, fmt::format("chunk ATTP {}, byte {}: {}", static_cast<int>(attribute), at, what));
  };
  if (bytes.size() != chunk_bytes) return bad(bytes.size(), "ends here: expected 64 bytes");
  const auto field = [&](size_t at) { return std::to_integer<int>(bytes[at]); };
  AttributeParams p;
  p.attribute = attribute;
  p.codec = static_cast<ColorCodec>(field(0));
  const bool id = attribute == Attribute::id;
  if (p.codec != ColorCodec::raw && (id ? p.codec != ColorCodec::palette : !makes_blocks(p.codec)))
    return bad(0, fmt::format("codec {}: not one of {}", field(0), kind_of(attribute).name));
  if (makes_blocks(p.codec)) {
    p.endpoints = static_cast<Endpoints>(field(1));
    const size_t own = kind_of(attribute).bytes;
    if (field(1) < 1 || field(1) > static_cast<int>(Endpoints::two) || value_bytes(p.endpoints) != own)
      return bad(1, fmt::format("endpoints of kind {}: not of {} bytes", field(1), own));
  }
  p.weight_bits = field(2);
  if (attribute == Attribute::normal) p.space = ErrorSpace::angle;
  if (attribute == Attribute::emissive && field(3) == static_cast<int>(ErrorSpace::lab))
    p.space = ErrorSpace::lab;
  p.threshold = load_le<double>(&bytes[8]);
  p.most_error = load_le<double>(&bytes[16]);
  p.bytes = load_le<uint64_t>(&bytes[24]);
  p.blocks = load_le<uint64_t>(&bytes[32]);
  return p;
}

}  // namespace voxkit::color
