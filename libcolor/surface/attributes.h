// What the voxels of a surface have beside their colours.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace voxkit::color {

/// Numbers are part of FORMAT.md.
enum class Attribute : uint8_t {
  emissive = 0,  ///< light that it gives: R, G, B as sRGB of 8 bits
  opacity = 1,   ///< how much of it is there: 0 nothing, 255 all
  normal = 2,    ///< where its surface looks: octahedral, 2 x 8 bits
  rm = 3,        ///< roughness and metalness: 0..255 for 0..1
  id = 4,        ///< number of its material or label, 32 bits, the lowest byte first
};

/// Names as users give them, and the bytes that a voxel has.
struct AttributeKind {
  std::string_view name;
  size_t bytes;
};
inline constexpr std::array<AttributeKind, 5> attribute_kinds{
    {{"emissive", 3}, {"opacity", 1}, {"normal", 2}, {"rm", 2}, {"id", 4}}};
constexpr const AttributeKind& kind_of(Attribute attribute) {
  return attribute_kinds[static_cast<size_t>(attribute)];
}

/// Of all of them.
inline constexpr size_t all_attribute_bytes = [] {
  size_t bytes = 0;
  for (const AttributeKind& kind : attribute_kinds) bytes += kind.bytes;
  return bytes;
}();

/// Which attributes the voxels of a surface have. Those of a voxel lie one after the other, by number.
class AttributeSet {
 public:
  constexpr bool has(Attribute a) const { return (bits_ >> static_cast<int>(a)) & 1; }
  constexpr bool empty() const { return bits_ == 0; }
  constexpr void add(Attribute a) { bits_ = static_cast<uint8_t>(bits_ | 1 << static_cast<int>(a)); }
  constexpr void remove(Attribute a) { bits_ = static_cast<uint8_t>(bits_ & ~(1 << static_cast<int>(a))); }
  /// Of a voxel, all together.
  constexpr size_t bytes() const { return bytes_below(attribute_kinds.size()); }
  /// Where those of one begin.
  constexpr size_t offset(Attribute a) const { return bytes_below(static_cast<size_t>(a)); }
  friend bool operator==(const AttributeSet&, const AttributeSet&) = default;

 private:
  constexpr size_t bytes_below(size_t end) const {
    size_t sum = 0;
    for (size_t i = 0; i < end; ++i)
      if ((bits_ >> i) & 1) sum += attribute_kinds[i].bytes;
    return sum;
  }
  uint8_t bits_ = 0;
};

}  // namespace voxkit::color
