// One block of colours as a line between two of them: the best ends, and how far what is decoded is from what
// was.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "libcolor/blocks/block_kernel.h"
#include "libcolor/blocks/block_layout.h"

namespace voxkit::color {

/// The colours of a macro block as the encoder works on them.
class MacroColors {
 public:
  MacroColors() = default;
  explicit MacroColors(std::span<const Rgb> colors, ErrorSpace space = ErrorSpace::rgb) {
    assign(colors, space);
  }
  /// 1 to 16384 colours, whose distances will be measured in `space`.
  void assign(std::span<const Rgb> colors, ErrorSpace space);
  uint32_t size() const { return size_; }
  Rgb color(uint32_t i) const;

  /// Sums over colours: r, g, b, rr, gg, bb, rg, rb, gb.
  using Sums = std::array<uint32_t, 9>;
  Sums sums(uint32_t first, uint32_t last) const {
    Sums s;
    for (size_t k = 0; k < s.size(); ++k) s[k] = prefix_[last][k] - prefix_[first][k];
    return s;
  }
  /// Channel c of all colours, as whole numbers; whole vectors may be read from any of them.
  const float* channel(size_t c) const { return channels_[c].data(); }
  /// The same in CIELAB, times lab_scale, or as directions, of length direction_scale, if the space is that.
  const float* lab_channel(size_t c) const { return lab_[c].data(); }
  ErrorSpace space() const { return space_; }

 private:
  uint32_t size_ = 0;
  ErrorSpace space_ = ErrorSpace::rgb;
  std::array<std::vector<float>, 3> channels_, lab_;
  std::vector<Sums> prefix_;
};

/// What a run of colours is coded as.
struct Fit {
  bool feasible = false;       ///< no decoded colour is further than allowed
  Rgb a, b;                    ///< both ends, as decoded
  uint64_t squared_error = 0;  ///< sum of squared distances, where feasible
};

/// Fits runs of colours.
class Fitter {
 public:
  /// `allowed`: the greatest squared distance that any decoded colour may have, in the unit of a Fit.
  /// `effort`, 1 to 9: how many pairs of ends are tried.
  Fitter(const MacroColors& colors, Endpoints endpoints, uint32_t allowed, int effort);
  /// The colours first .. last, half open, with `bits` bits a weight, 0 to 4.
  Fit fit(uint32_t first, uint32_t last, int bits) const {
    Fit found;
    fit(first, last, bits, found);
    return found;
  }
  /// The same into `out`, which saves passing on the fits of millions of small runs.
  void fit(uint32_t first, uint32_t last, int bits, Fit& out) const;
  /// The greatest squared distance of a fit; in CIELAB times lab_scale^2. `out`: the weights, in order, with
  /// room for color_vector more.
  uint32_t weights(const Fit& fit, uint32_t first, uint32_t last, int bits, uint8_t* out) const;

 private:
  void fit_single(uint32_t first, uint32_t last, Fit& fit) const;
  Fit fit_line(uint32_t first, uint32_t last, int bits) const;
  Fit fit_lab_line(uint32_t first, uint32_t last, int bits, const LineTries& line) const;
  /// How far decoded colours are from what they were; `weights`: if not null, those that they get.
  Distances lab_distances(const Fit& fit, uint32_t first, uint32_t last, uint32_t most,
                          uint8_t* weights) const;
  Rgb quantised(const std::array<float, 3>& color) const;

  const MacroColors& colors_;
  const BlockKernels& kernels_ = block_kernels(true);
  Endpoints endpoints_;
  uint32_t allowed_;
  int tries_;
  double most_residual_;  ///< mean squared distance from a line beyond which none is feasible
};

}  // namespace voxkit::color
