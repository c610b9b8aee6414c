// Weights of the prediction from sample pages, by least squares.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "libpage/model_data.h"
#include "libpage/page.h"

namespace voxkit::page {

/// A page to learn from: what is to be predicted, and what the decoder has in its place.
struct FitPage {
  Extent extent;
  std::span<const uint32_t> samples;
  std::span<const uint32_t> decoded;
  Parent<uint32_t> parent{};   ///< of models with parents
  const Mask* mask = nullptr;  ///< none: all voxels are solid
};

/// Normal equations of all classes. Sums are of doubles, in the order of pages and voxels: nothing else
/// changes them.
class Fit {
 public:
  /// Samples are at most `greatest`; the quantiser's bound is `max_error`.
  Fit(Classes classes, uint32_t greatest, uint32_t max_error);
  /// One equation for each solid voxel; it counts the less, the further apart its taps are. What was added
  /// before counts half. `noise` is the variance that the quantiser will add to what is given as decoded
  /// (Wiener): 0 where that has it already. Parents have it already in any case.
  void add(std::span<const FitPage> pages, double noise);
  /// The weights of least squared error for each class.
  std::array<Weights, most_classes> weights() const;

  static constexpr size_t row_width = 32;  ///< whole vectors

 private:
  using Row = std::array<double, row_width>;
  /// In differences from the class's rest tap.
  struct Equations {
    alignas(64) std::array<Row, tap_count> products{};  ///< of taps i <= j; others mean nothing
    Row targets{};
    double weight = 0;
  };
  struct Batch;
  /// The tap that others are given as differences from, -1: none; and of each tap all bits if there is one.
  struct ClassTaps {
    int rest = -1;
    std::array<int32_t, row_width> mask{};
  };
  void add_page(const FitPage& page, int share, int turn, std::vector<Equations>& sums,
                std::vector<Batch>& batches) const;
  // Each sum is of its own, so that vectors change nothing.
  void add_pages(std::span<const FitPage> pages, std::vector<Equations>& sums,
                 std::vector<Batch>& batches) const;
  void add_pages_anywhere(std::span<const FitPage> pages, std::vector<Equations>& sums,
                          std::vector<Batch>& batches) const;
  void add_pages_avx2(std::span<const FitPage> pages, std::vector<Equations>& sums,
                      std::vector<Batch>& batches) const;
  Weights solve(const Equations& equations, int voxel_class) const;

  Classes classes_;
  int shift_;     ///< of samples
  double quiet_;  ///< the squared range of taps at which an equation counts half
  std::vector<Equations> equations_;
  std::array<ClassTaps, most_classes> class_taps_;
};

}  // namespace voxkit::page
