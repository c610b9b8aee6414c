// Fixed-width little-endian fields of files, on any host.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "formats/hd.h"

namespace voxkit {

static_assert(std::endian::native == std::endian::little, "voxkit is written for little-endian hosts");

template <class T>
VOX_HD T load_le(const std::byte* p) {
  T value;
  std::memcpy(&value, p, sizeof value);
  return value;
}
template <class T>
VOX_HD void store_le(std::byte* p, T value) {
  std::memcpy(p, &value, sizeof value);
}

}  // namespace voxkit
