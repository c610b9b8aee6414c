// The colours that stand for all those of a scene: its global palette, by quantisation.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/context.h"
#include "formats/reservation.h"
#include "libcolor/surface/surface.h"

namespace voxkit::color {

/// Bits of a number of a palette's colours, of which there are 1 to 2^16: 0 to 16.
constexpr uint32_t palette_bits(uint32_t colors) {
  uint32_t bits = 0;
  while (uint32_t{1} << bits < colors) ++bits;
  return bits;
}

class Palette {
 public:
  /// At most `most` colours, 1 to 2^16, for those given: each once, in the order of R, G and B. Where there
  /// are no more different ones these are all; else by splitting the set of colours where that lessens the
  /// squared error most, then k-means, `effort`, 1 to 9, times eight rounds at most. Does not depend on
  /// ctx.threads. Memory: 4 bytes for each of the 2^24 colours there are, and some for each that comes.
  static Result<Palette> choose(std::span<const Rgb> colors, uint32_t most, int effort, Context& ctx);

  std::span<const Rgb> colors() const { return colors_; }
  /// The number of the palette's colour nearest to one of those that it was chosen for.
  uint16_t index_of(Rgb color) const { return static_cast<uint16_t>(table_[code(color)]); }

 private:
  static uint32_t code(Rgb c) { return static_cast<uint32_t>(c.r << 16 | c.g << 8 | c.b); }

  Reservation reservation_;
  std::vector<Rgb> colors_;
  std::vector<uint32_t> table_;  ///< by code: how often a colour comes, then its number
};

}  // namespace voxkit::color
