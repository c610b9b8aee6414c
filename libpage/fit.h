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

/// Normal equations of all classes. Sums are of floats of up to 256 equations, then of doubles of an eighth
/// of the pages, in their order: threads change nothing.
class Fit {
 public:
  /// Samples are at most `greatest`; the quantiser's bound is `max_error`.
  Fit(Classes classes, uint32_t greatest, uint32_t max_error);
  /// One equation for each solid voxel; it counts the less, the further apart its taps are. What was added
  /// before counts half. `noise` is the variance that the quantiser will add to what is given as decoded
  /// (Wiener): 0 where that has it already. Parents have it already in any case.
  /// Errors: ErrorCode::interrupted.
  Status add(std::span<const FitPage> pages, double noise, const Context& ctx);
  /// The weights of least squared error for each class.
  std::array<Weights, most_classes> weights() const;

  static constexpr size_t row_width = 32;  ///< whole vectors

 private:
  template <class Real>
  using Row = std::array<Real, row_width>;
  /// In differences from the class's rest tap.
  /// Of tap i with tap j >= i, and, behind the taps, with the sample itself; others mean nothing.
  template <class Real>
  struct Sums {
    alignas(64) std::array<Row<Real>, tap_count> products{};
  };
  struct Equations : Sums<double> {
    double weight = 0;
  };
  struct Pending;
  /// The tap that others are given as differences from, -1: none; and of each tap all bits if there is one.
  struct ClassTaps {
    int rest = -1;
    std::array<int32_t, row_width> mask{};
  };
  template <bool parents>
  void add_page(const FitPage& page, int share, int turn, std::vector<Equations>& sums,
                std::vector<Pending>& pending) const;
  /// Pages with these numbers of all. Each sum is of its own, so that vectors change nothing.
  template <bool parents>
  void add_pages(std::span<const FitPage> all, size_t first, size_t last, std::vector<Equations>& sums) const;
  void add_pages_anywhere(std::span<const FitPage> all, size_t first, size_t last,
                          std::vector<Equations>& sums) const;
  void add_pages_avx2(std::span<const FitPage> all, size_t first, size_t last,
                      std::vector<Equations>& sums) const;
  Weights solve(const Equations& equations, int voxel_class) const;

  Classes classes_;
  int shift_;     ///< of samples
  double quiet_;  ///< the squared range of taps at which an equation counts half
  std::vector<Equations> equations_;
  std::array<ClassTaps, most_classes> class_taps_;
};

}  // namespace voxkit::page
