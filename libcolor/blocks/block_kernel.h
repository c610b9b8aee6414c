// The inner loops over colours, for each kind of machine. All give the same results: whole numbers in floats.
#pragma once

#include <array>
#include <cstdint>

namespace voxkit::color {

/// A run of colours, one array a channel; whole vectors of 8 may be read past its end.
struct ColorRun {
  std::array<const float*, 3> channels;
  uint32_t size;
};
struct Extent {
  float least, most;
};
struct Distances {
  uint32_t most;  ///< greatest squared distance
  uint64_t sum;   ///< of squared distances
};

struct BlockKernels {
  /// The least and greatest product of a colour and an axis.
  Extent (*extent)(const ColorRun& run, const std::array<float, 3>& axis);
  /// Squared distances of colours from what they become: `most_weight` + 1 steps from a to b, whichever is
  /// nearest along the line. Ends early, with what has been seen, where one is above `allowed`. `weights`: if
  /// not null, the steps, with room for whole vectors.
  Distances (*distances)(const ColorRun& run, const std::array<float, 3>& a, const std::array<float, 3>& b,
                         int most_weight, uint32_t allowed, uint8_t* weights);
  /// The same for colours given as points, each of which becomes the nearest of `count` others, 1 to 16, of
  /// equally near ones the first; squared distances are rounded up.
  Distances (*nearest)(const ColorRun& run, const std::array<float, 3>* steps, int count, uint32_t allowed,
                       uint8_t* weights);
};

/// native: those for this machine, else the portable ones.
const BlockKernels& block_kernels(bool native);

}  // namespace voxkit::color
