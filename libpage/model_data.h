// What pages are coded with, laid out for coding.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "libpage/context.h"
#include "libpage/predictor.h"
#include "libpage/symbols.h"
#include "libpage/tables.h"

namespace voxkit::page {

/// The largest error bound: residuals of 32-bit samples stay within 64 bits.
inline constexpr uint32_t most_error = 0x7fffffff;

/// Entries of a palette.
inline constexpr size_t most_palette = 65536;

struct ModelData {
  uint32_t max_value = 0;         ///< of samples, or of numbers of palette entries
  uint32_t max_error = 0;         ///< E
  uint32_t background = 0;        ///< what an empty page stands for, and the prediction of the first voxel
  std::vector<uint32_t> palette;  ///< samples that numbers stand for, ascending; empty: none
  std::array<Weights, class_count> weights{};
  std::array<Frequencies, context_count> tables{};

  // From these:
  uint32_t half_steps = 0;  ///< 2^15 / step: turns a range into half its steps
  std::array<std::array<uint16_t, symbol_count>, context_count> starts{};
  std::vector<DecodingTable> decoding;

  uint64_t step() const { return 2 * uint64_t{max_error} + 1; }
  bool wide() const { return max_value > 0xffff; }
  /// Bytes of a page of one value.
  size_t value_bytes() const { return max_value > 0xffff ? 4 : max_value > 0xff ? 2 : 1; }
  void derive();
};

}  // namespace voxkit::page
