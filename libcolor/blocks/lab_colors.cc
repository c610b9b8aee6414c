#include "libcolor/blocks/lab_colors.h"

#include "formats/lab.h"

namespace voxkit::color {

LabColors::LabColors() {
  for (size_t i = 0; i < light_.size(); ++i) light_[i] = srgb_to_linear(static_cast<double>(i) / 255);
  for (size_t i = 0; i < 3; ++i)
    for (size_t k = 0; k < 3; ++k) shares_[i][k] = steps * lab_shares[i][k];
  // White may come out above 1, by rounding.
  for (int i = 0; i <= steps + 1; ++i) curve_.push_back(lab_curve(static_cast<double>(i) / steps));
}

const LabColors& lab_colors() {
  static const LabColors colors;
  return colors;
}

}  // namespace voxkit::color
