// Labels: values that are names of things. A voxel mostly has the name of one of those around it; which one
// is decided name by name, each in the context of where else around the voxel it is.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "libpage/decision.h"
#include "libpage/extent.h"
#include "libpage/page.h"
#include "libpage/rans.h"

namespace voxkit::page {

/// Contexts of a model without and with parents.
constexpr size_t label_contexts(bool parents) {
  return parents ? 16384 : 8192;
}

/// What labels of a level are coded with.
struct LabelTables {
  bool parents = false;
  uint32_t max_value = 0;        ///< at most 65535
  std::vector<uint8_t> numbers;  ///< of the part that a name has, by context
};

/// Parents as 32-bit values, which are put in `room`.
template <class T>
Parent<uint32_t> widened(const Parent<T>& parent, std::vector<uint32_t>& room) {
  room.assign(parent.samples.begin(), parent.samples.end());
  return {room, parent.extent, parent.x, parent.y, parent.z};
}

/// Counts decisions of sample pages, of values to `tables.max_value`, into one for each context.
void count_labels(const LabelTables& tables, std::span<const uint32_t> values, Extent extent,
                  const Parent<uint32_t>& parent, std::span<DecisionCounts> counts);

/// Appends the page, of more than `least` bytes.
void encode_labels(const LabelTables& tables, std::span<const uint32_t> values, Extent extent,
                   const Parent<uint32_t>& parent, std::vector<std::byte>& out, size_t least);

/// Decodes a page of more bytes than its model's values. False: it does not end where its voxels end. Values
/// are at most `tables.max_value` in any case.
bool decode_labels(const LabelTables& tables, std::span<const std::byte> page, Extent extent,
                   const Parent<uint32_t>& parent, std::span<uint32_t> values);

}  // namespace voxkit::page
