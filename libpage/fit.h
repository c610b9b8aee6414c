// Weights of the prediction from sample pages.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "libpage/model_data.h"

namespace voxkit::page {

/// A page to learn from: what is to be predicted, and what the decoder will have in its place.
struct FitPage {
  Extent extent;
  std::span<const uint32_t> samples;
  std::span<const uint32_t> decoded;
};

/// The weights of least squared error for each class; each equation counts the less, the further apart its
/// taps are. `noise` is the variance that the quantiser will add to the decoded samples (Wiener): 0 where
/// they have it already.
std::array<Weights, class_count> fit_weights(std::span<const FitPage> pages, double noise);

}  // namespace voxkit::page
