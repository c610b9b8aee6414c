// Encodes and writes attributes in the order of colours, some parts at a time.
#pragma once

#include <vector>

#include "formats/container.h"
#include "formats/context.h"
#include "formats/reservation.h"
#include "libcolor/attributes/attribute_params.h"

namespace voxkit::color {

class AttributeWriter {
 public:
  /// The arguments must outlive the writer.
  AttributeWriter(AttributeSet set, const Options& options, ContainerWriter& container, Context& ctx);
  /// Takes the memory that it needs.
  Status begin();
  /// What some cells have, all attributes of each.
  Status add(std::span<const std::byte> values);
  /// Encodes what is left, and writes what the file says about its attributes.
  Status finish();

  const std::vector<AttributeParams>& params() const { return params_; }
  double seconds = 0;

 private:
  Status flush();

  AttributeSet set_;
  const Options& options_;
  ContainerWriter& container_;
  Context& ctx_;
  Reservation reservation_;
  std::vector<AttributeParams> params_;
  std::vector<std::byte> values_;
  std::vector<uint32_t> most_squared_;  ///< by attribute, of those in `params_`
  size_t cell_bytes_;
  uint64_t batch_ = 0, next_part_ = 0;  ///< parts
};

}  // namespace voxkit::color
