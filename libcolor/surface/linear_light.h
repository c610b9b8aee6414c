// Stored colours and linear light.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace voxkit::color {

/// Linear light in 16 bits.
inline constexpr int full_light = 65535;

/// The transfer function of sRGB (IEC 61966-2-1) in tables: 8 bits stored, 16 bits of linear light, both
/// rounded to nearest. What goes from 8 bits to 16 and back is the same again.
struct LightTables {
  std::array<uint16_t, 256> linear{};
  std::vector<uint8_t> stored;  ///< 65536 of them
};
const LightTables& light_tables();

}  // namespace voxkit::color
