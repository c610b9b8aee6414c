// Light of the terrain: a sun with shadows and a sky that is hidden in part, computed once for the world.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "libcolor/surface/surface.h"
#include "libcolor/terrain/noise.h"

namespace voxkit::color::terrain {

class Ground;
struct House;
struct Forest;

/// The way to the sun: along x and z for one unit of height, in 1/256.
inline constexpr int32_t sun_x = -170, sun_z = 130;

/// A direction of unit length, in 1/256.
struct Normal {
  int32_t x = 0, y = 256, z = 0;
};
/// Of unit length, from a direction whose components are below 2^14.
Normal normalised(int32_t x, int32_t y, int32_t z);

/// The map of the sun has a height for each ray of the sun, by where it meets the floor of the world: what is
/// below is in the shadow. The maps of the sky are the heights around a place, in two sizes of
/// neighbourhoods: what is far below them sees little sky.
class Light {
 public:
  Light(const Ground& ground, const std::vector<House>& houses, const Forest& forest);
  static uint64_t bytes();

  /// How much of the sun, and of the sky, is seen from a place: 0..256.
  int32_t sun(int32_t x, int32_t y, int32_t z) const;
  int32_t sky(int32_t x, int32_t y, int32_t z) const;
  /// A surface of a colour in that light; `cavity`: more of what hides the sky, 0..256, 256 nothing.
  Rgb shade(Rgb albedo, const Normal& normal, int32_t x, int32_t y, int32_t z, int32_t cavity = 256) const;

 private:
  void raise_sun(int32_t x, int32_t y, int32_t z, int32_t reach);

  std::vector<uint16_t> sun_;  ///< in steps of 2^7 units
  std::array<std::vector<int32_t>, 2> sky_;
  std::array<uint16_t, 1024> root_;  ///< of light, 512 being 1, in 1/256
};

}  // namespace voxkit::color::terrain
