#include "libcolor/terrain/light.h"

#include <algorithm>
#include <cmath>

#include "libcolor/terrain/ground.h"
#include "libcolor/terrain/tree.h"

namespace voxkit::color::terrain {
namespace {

// Rays of the sun through the world meet its floor up to this far outside of it.
constexpr int texel_bits = 13, height_bits = 7;
constexpr int32_t outside = 28 * metre;
constexpr int32_t texels = (side + 2 * outside) >> texel_bits;

constexpr int sky_bits = 15;
constexpr int32_t sky_side = side >> sky_bits;
constexpr std::array<int32_t, 2> sky_reach = {3, 13};
constexpr std::array<int32_t, 2> sky_depth = {2 * metre, 7 * metre};

constexpr int32_t along_ray(int32_t y, int32_t slope) {
  return static_cast<int32_t>(int64_t{y} * slope >> 8);
}

/// The mean of squares around each place, twice, rows and columns after each other.
void blur(std::vector<int32_t>& map, int32_t reach) {
  std::vector<int32_t> line(static_cast<size_t>(sky_side));
  const auto pass = [&](size_t begin, size_t stride) {
    const auto at = [&](int32_t i) -> int32_t& {
      return map[begin + static_cast<size_t>(std::clamp(i, 0, sky_side - 1)) * stride];
    };
    int64_t sum = 0;
    for (int32_t i = -reach; i <= reach; ++i) sum += at(i);
    for (int32_t i = 0; i < sky_side; ++i) {
      line[static_cast<size_t>(i)] = static_cast<int32_t>(sum / (2 * reach + 1));
      sum += at(i + reach + 1) - at(i - reach);
    }
    for (int32_t i = 0; i < sky_side; ++i) at(i) = line[static_cast<size_t>(i)];
  };
  for (int twice = 0; twice < 2; ++twice) {
    for (size_t row = 0; row < static_cast<size_t>(sky_side); ++row) pass(row * sky_side, 1);
    for (size_t column = 0; column < static_cast<size_t>(sky_side); ++column) pass(column, sky_side);
  }
}

}  // namespace

Normal normalised(int32_t x, int32_t y, int32_t z) {
  const int64_t squares = int64_t{x} * x + int64_t{y} * y + int64_t{z} * z;
  if (squares == 0) return {};
  const double scale = 256 / std::sqrt(static_cast<double>(squares));
  const auto scaled = [scale](int32_t v) { return static_cast<int32_t>(v * scale); };
  return {scaled(x), scaled(y), scaled(z)};
}

uint64_t Light::bytes() {
  return uint64_t{texels} * texels * 2 + 3 * uint64_t{sky_side} * sky_side * 4;
}

void Light::raise_sun(int32_t x, int32_t y, int32_t z, int32_t reach) {
  const int32_t u = x - along_ray(y, sun_x) + outside, v = z - along_ray(y, sun_z) + outside;
  const auto height = static_cast<uint16_t>(std::min(y >> height_bits, int32_t{UINT16_MAX}));
  const int32_t u1 = std::min((u + reach) >> texel_bits, texels - 1),
                v1 = std::min((v + reach) >> texel_bits, texels - 1);
  for (int32_t j = std::max((v - reach) >> texel_bits, 0); j <= v1; ++j)
    for (int32_t i = std::max((u - reach) >> texel_bits, 0); i <= u1; ++i) {
      uint16_t& texel = sun_[static_cast<size_t>(j) * texels + static_cast<size_t>(i)];
      texel = std::max(texel, height);
    }
}

Light::Light(const Ground& ground, const std::vector<House>& houses, const Forest& forest)
    : sun_(static_cast<size_t>(texels) * texels) {
  for (size_t i = 0; i < root_.size(); ++i)
    root_[i] = static_cast<uint16_t>(std::sqrt(static_cast<double>(i * 128)));
  constexpr auto sky_cells = static_cast<size_t>(sky_side) * sky_side;
  std::vector<int32_t> low(sky_cells), high(sky_cells, 0);
  const auto sky_cell = [](int32_t x, int32_t z) {
    return static_cast<size_t>(std::clamp(z >> sky_bits, 0, sky_side - 1)) * sky_side +
           static_cast<size_t>(std::clamp(x >> sky_bits, 0, sky_side - 1));
  };

  constexpr int32_t ground_step = 1 << texel_bits;
  for (int32_t z = 0; z < side; z += ground_step)
    for (int32_t x = 0; x < side; x += ground_step) {
      const int32_t h = ground.height(x, z);
      raise_sun(x, h, z, ground_step / 2);
      low[sky_cell(x, z)] = h;
    }
  for (const Tree& tree : forest.trees) {
    const TreeModel& model = forest.model(tree);
    for (const Leaf& leaf : model.leaves) {
      if (leaf.length == 0) continue;
      const int32_t x = tree.x + tree.mirror_x * leaf.x, y = tree.y + leaf.y,
                    z = tree.z + tree.mirror_z * leaf.z;
      raise_sun(x, y, z, cm(6));
      int32_t& top = high[sky_cell(x, z)];
      top = std::max(top, y);
    }
    for (int32_t y = 0; y < model.trunk_height; y += cm(5))
      raise_sun(tree.x, tree.y + y, tree.z, model.trunk_radius);
  }
  // The sky comes through leaves in part.
  for (size_t i = 0; i < sky_cells; ++i) high[i] = std::max(low[i], low[i] + (high[i] - low[i]) * 9 / 16);
  for (const House& house : houses) {
    const int32_t reach = house.reach();
    for (int32_t z = house.z - reach; z < house.z + reach; z += 1 << sky_bits)
      for (int32_t x = house.x - reach; x < house.x + reach; x += 1 << sky_bits) {
        const House::Parts parts = house.column(x, z);
        int32_t& top = high[sky_cell(x, z)];
        for (int i = 0; i < parts.solids; ++i) top = std::max(top, parts.solid[static_cast<size_t>(i)].hi);
      }
    const auto first = [](int32_t at, int32_t height, int32_t slope) {
      return (at - std::max(along_ray(height, slope), 0) + outside) >> texel_bits;
    };
    const auto last = [](int32_t at, int32_t height, int32_t slope) {
      return (at - std::min(along_ray(height, slope), 0) + outside) >> texel_bits;
    };
    for (int32_t j = first(house.z - reach, house.top(), sun_z);
         j <= last(house.z + reach, house.top(), sun_z); ++j)
      for (int32_t i = first(house.x - reach, house.top(), sun_x);
           i <= last(house.x + reach, house.top(), sun_x); ++i) {
        if (i < 0 || j < 0 || i >= texels || j >= texels) continue;
        const int32_t middle = 1 << (texel_bits - 1);
        const int32_t y =
            house.shadow((i << texel_bits) + middle - outside, (j << texel_bits) + middle - outside);
        uint16_t& texel = sun_[static_cast<size_t>(j) * texels + static_cast<size_t>(i)];
        if (y > 0)
          texel = std::max(texel, static_cast<uint16_t>(std::min(y >> height_bits, int32_t{UINT16_MAX})));
      }
  }
  for (size_t i = 0; i < 2; ++i) {
    sky_[i] = high;
    blur(sky_[i], sky_reach[i]);
  }
}

int32_t Light::sun(int32_t x, int32_t y, int32_t z) const {
  const int32_t half = 1 << (texel_bits - 1);
  const int32_t u = x - along_ray(y, sun_x) + outside - half, v = z - along_ray(y, sun_z) + outside - half;
  const int32_t i = u >> texel_bits, j = v >> texel_bits;
  if (i < 0 || j < 0 || i + 1 >= texels || j + 1 >= texels) return 256;
  const int32_t fu = u >> (texel_bits - 8) & 255, fv = v >> (texel_bits - 8) & 255;
  const uint16_t* const at = &sun_[static_cast<size_t>(j) * texels + static_cast<size_t>(i)];
  // What is less than 12 cm below is not in the shadow of itself.
  const int32_t own = (y + cm(24)) >> height_bits;
  const auto seen = [&](uint16_t height) {
    return std::clamp((own - height) * 256 / (cm(12) >> height_bits), 0, 256);
  };
  const int32_t near = seen(at[0]) * (256 - fu) + seen(at[1]) * fu;
  const int32_t far = seen(at[texels]) * (256 - fu) + seen(at[texels + 1]) * fu;
  return (near * (256 - fv) + far * fv) >> 16;
}

int32_t Light::sky(int32_t x, int32_t y, int32_t z) const {
  const int32_t half = 1 << (sky_bits - 1);
  const int32_t u = std::clamp(x - half, 0, side - (2 << sky_bits)),
                v = std::clamp(z - half, 0, side - (2 << sky_bits));
  const size_t at = static_cast<size_t>(v >> sky_bits) * sky_side + static_cast<size_t>(u >> sky_bits);
  const int32_t fu = (u & ((1 << sky_bits) - 1)) >> (sky_bits - 12),
                fv = (v & ((1 << sky_bits) - 1)) >> (sky_bits - 12);
  int32_t seen = 256;
  for (size_t i = 0; i < 2; ++i) {
    const int32_t* const map = &sky_[i][at];
    const int32_t around = blend(blend(map[0], map[1], fu), blend(map[sky_side], map[sky_side + 1], fu), fv);
    const int64_t depth = std::clamp<int64_t>(around - y, 0, sky_depth[i]);
    seen = seen * (256 - static_cast<int32_t>(depth * 150 / sky_depth[i])) >> 8;
  }
  return seen;
}

Rgb Light::shade(Rgb albedo, const Normal& normal, int32_t x, int32_t y, int32_t z, int32_t cavity) const {
  static const Normal to_sun = normalised(sun_x, 256, sun_z);
  const int32_t facing = (normal.x * to_sun.x + normal.y * to_sun.y + normal.z * to_sun.z) >> 8;
  const int32_t direct = facing > 0 ? facing * sun(x, y, z) >> 8 : 0;
  // More sky for what looks up; some light comes from the ground.
  const int32_t open = sky(x, y, z) * cavity >> 8;
  const int32_t above = (open * (208 + (normal.y * 48 >> 8))) >> 8;
  const auto channel = [&](uint8_t stored, int32_t of_sun, int32_t of_sky) {
    const int32_t light = (direct * of_sun + above * of_sky) >> 7;  // 512 is 1
    return static_cast<uint8_t>(
        std::min<int32_t>(stored * root_[static_cast<size_t>(std::clamp(light, 0, 1023))] >> 8, 255));
  };
  return {channel(albedo.r, 352, 92), channel(albedo.g, 326, 108), channel(albedo.b, 272, 136)};
}

}  // namespace voxkit::color::terrain
