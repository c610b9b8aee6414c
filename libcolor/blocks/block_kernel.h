// The inner loops over colours, for each kind of machine. All give the same results: whole numbers in floats.
#pragma once

#include <array>
#include <cstdint>

#include "libcolor/params.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// Colours that loops go through at once.
inline constexpr uint32_t color_vector = 8;

/// A run of colours, one array a channel; whole vectors may be read past its end.
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

/// Where ends of a block are tried on a line, of length 1 along `axis`: from the outermost colours inwards.
struct LineTries {
  std::array<float, 3> mean, axis;
  float center;  ///< the mean along the axis
  Endpoints endpoints;
  int tries;  ///< 1 to most_line_tries
};
inline constexpr int most_line_tries = 12;
/// How far inwards, in half cells, of both ends, the last ones negative; four tries at a time. 1 gives the
/// least greatest error where colours lie anywhere between the ends, 0 where they lie near these.
inline constexpr float line_insets[2 * most_line_tries] = {
    1,     0,    0.5f, 0.75f, -1,     -0,    -0.5f, -0.75f,  //
    0.25f, 1,    0.5f, 1.4f,  -0.25f, -0.5f, -1,    -1.4f,   //
    0,     0.5f, 1,    0,     -0.5f,  -0,    -0,    -0};
/// The first that is feasible, as it is decoded.
struct LineFit {
  bool feasible = false;
  Rgb a, b;
  uint64_t squared_error = 0;  ///< sum of squared distances
};

struct BlockKernels {
  /// The least and greatest product of a colour and an axis.
  Extent (*extent)(const ColorRun& run, const std::array<float, 3>& axis);
  /// Squared distances of colours from what they become: `most_weight` + 1 steps from a to b, whichever is
  /// nearest along the line. Ends early, with what has been seen, where one is above `allowed`. `weights`: if
  /// not null, the steps, with room for whole vectors.
  Distances (*distances)(const ColorRun& run, const std::array<float, 3>& a, const std::array<float, 3>& b,
                         int most_weight, uint32_t allowed, uint8_t* weights);
  /// Whether no squared distance from a colour, in whole numbers, is above `allowed`.
  bool (*within)(const ColorRun& run, const std::array<float, 3>& color, uint32_t allowed);
  /// The first ends on a line with which none is above `allowed`, if there are any.
  LineFit (*line)(const ColorRun& run, const LineTries& line, int most_weight, uint32_t allowed);
  /// Like `distances`, for colours given as points, each of which becomes the nearest of `count` others, 1 to
  /// 16, of equally near ones the first; squared distances are rounded up.
  Distances (*nearest)(const ColorRun& run, const std::array<float, 3>* steps, int count, uint32_t allowed,
                       uint8_t* weights);
};

/// native: those for this machine, else the portable ones.
const BlockKernels& block_kernels(bool native);

}  // namespace voxkit::color
