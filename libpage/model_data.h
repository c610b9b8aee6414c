// What pages are coded with, laid out for coding.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "libpage/context.h"
#include "libpage/label.h"
#include "libpage/mask.h"
#include "libpage/predictor.h"
#include "libpage/symbols.h"
#include "libpage/tables.h"
#include "libpage/tap_sums.h"

namespace voxkit::page {

/// The largest error bound: a prediction and 2^31 steps, which damaged pages may have, are within 64 bits.
inline constexpr uint32_t most_error = 0x7ffffffe;

/// Entries of a palette.
inline constexpr size_t most_palette = size_t{1} << 18;

/// The weight of each tap for each voxel of a row.
using RowWeights = std::array<std::array<int16_t, max_side>, tap_count>;

struct ModelData {
  uint32_t max_value = 0;         ///< of samples, or of numbers of palette entries
  uint32_t max_error = 0;         ///< E
  uint32_t background = 0;        ///< what an empty page stands for, and the prediction of the first voxel
  std::vector<uint32_t> palette;  ///< samples that numbers stand for, ascending; empty: none
  Classes classes;                ///< whether its pages have parents
  std::array<Weights, most_classes> weights{};
  std::array<Frequencies, most_contexts> tables{};
  /// In place of weights and tables, of labels.
  std::optional<LabelTables> labels;

  // From these:
  uint32_t half_steps = 0;  ///< 2^15 / step: turns a range into half its steps
  std::array<std::array<uint16_t, symbol_count>, most_contexts> starts{};
  std::vector<DecodingTable> decoding;
  /// Of a palette of up to 16 bits: the number of the entry next to each sample up to the greatest.
  std::vector<uint16_t> numbers;
  /// With parents: weights of rows by class along y and z, of 16 voxels.
  std::array<RowWeights, most_classes / 4> rows{};
  /// Of narrow models: those of the taps in earlier rows and of parents two by two, for the same rows;
  /// without parents of voxels that are neither first nor last.
  std::array<std::array<WeightPairs, row_taps(true) / 2>, most_classes / 4> pairs{};

  int contexts() const { return context_count(classes.parents); }
  /// Of parents, where there is a palette: the number of the entry next to a sample, the lower one of two.
  uint32_t nearest(uint32_t sample) const;
  uint64_t step() const { return 2 * uint64_t{max_error} + 1; }
  bool wide() const { return max_value > 0xffff; }
  /// Bytes of a page of one value.
  size_t value_bytes() const { return max_value > 0xffff ? 4 : max_value > 0xff ? 2 : 1; }
  /// The value of a page of at most so many; nothing where it has none so.
  std::optional<uint32_t> value_of(std::span<const std::byte> page) const;
  void set_palette(std::vector<uint32_t> ascending);
  /// The numbers that samples have in the palette, or themselves where there is none. False: one is missing.
  bool number(std::span<uint32_t> samples) const;
  /// What follows from weights and tables.
  void derive();
  void set_weights(const std::array<Weights, most_classes>& fitted);
};

template <class T>
T sample_of(const ModelData& model, uint32_t value) {
  return static_cast<T>(model.palette.empty() ? value : model.palette[value]);
}

}  // namespace voxkit::page
