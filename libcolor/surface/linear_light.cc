#include "libcolor/surface/linear_light.h"

#include <cmath>

#include "formats/lab.h"

namespace voxkit::color {
namespace {

LightTables make_tables() {
  LightTables tables;
  for (size_t i = 0; i < 256; ++i)
    tables.linear[i] =
        static_cast<uint16_t>(std::lrint(srgb_to_linear(static_cast<double>(i) / 255) * full_light));
  // A stored value is rounded up where it is past the middle between two.
  tables.stored.resize(full_light + 1);
  size_t stored = 0;
  for (size_t i = 0; i < tables.stored.size(); ++i) {
    while (stored < 255 &&
           srgb_to_linear((static_cast<double>(stored) + 0.5) / 255) * full_light <= static_cast<double>(i))
      ++stored;
    tables.stored[i] = static_cast<uint8_t>(stored);
  }
  return tables;
}

}  // namespace

const LightTables& light_tables() {
  static const LightTables tables = make_tables();
  return tables;
}

}  // namespace voxkit::color
