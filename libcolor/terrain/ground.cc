#include "libcolor/terrain/ground.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/parallel.h"

namespace voxkit::color::terrain {
namespace {

struct Point {
  int32_t x, z;
};

/// The road through the hamlet and a lane up the hill, in metres; corners are cut twice.
constexpr Point road_points[] = {Point{-4, 74}, {18, 68}, {38, 58},  {54, 62},
                                 {72, 72},      {92, 64}, {112, 46}, {132, 40}};
constexpr Point lane_points[] = {Point{58, 64}, {58, 48}, {68, 34}, {66, 20}, {76, 6}, {80, -4}};

/// Chaikin's corner cutting.
std::vector<Point> cut_corners(std::vector<Point> line, int times) {
  for (; times > 0; --times) {
    std::vector<Point> cut{line.front()};
    for (size_t i = 0; i + 1 < line.size(); ++i) {
      const Point a = line[i], b = line[i + 1];
      cut.push_back({(3 * a.x + b.x) / 4, (3 * a.z + b.z) / 4});
      cut.push_back({(a.x + 3 * b.x) / 4, (a.z + 3 * b.z) / 4});
    }
    cut.push_back(line.back());
    line = std::move(cut);
  }
  return line;
}

std::vector<Point> line_of(std::span<const Point> points) {
  std::vector<Point> line;
  for (const Point& p : points) line.push_back({p.x * metre, p.z * metre});
  return cut_corners(std::move(line), 2);
}

/// The square root, rounded down; IEEE 754 rounds that of a double correctly.
int64_t root(int64_t v) {
  return static_cast<int64_t>(std::sqrt(static_cast<double>(v)));
}

int64_t distance(std::span<const Point> line, int32_t x, int32_t z) {
  int64_t nearest = INT64_MAX;
  for (size_t i = 0; i + 1 < line.size(); ++i) {
    // No nearer than the box around it.
    const int64_t bx =
        std::max({std::min(line[i].x, line[i + 1].x) - x, x - std::max(line[i].x, line[i + 1].x), 0});
    const int64_t bz =
        std::max({std::min(line[i].z, line[i + 1].z) - z, z - std::max(line[i].z, line[i + 1].z), 0});
    if (bx * bx + bz * bz >= nearest) continue;
    const int64_t dx = line[i + 1].x - line[i].x, dz = line[i + 1].z - line[i].z;
    const int64_t px = x - line[i].x, pz = z - line[i].z;
    const int64_t along =
        std::clamp<int64_t>(((px * dx + pz * dz) >> 12) / ((dx * dx + dz * dz) >> 24), 0, 4096);
    const int64_t rx = px - (dx * along >> 12), rz = pz - (dz * along >> 12);
    nearest = std::min(nearest, rx * rx + rz * rz);
  }
  return root(nearest);
}

/// Octaves of gradient noise, from squares of 2^bits units down, each half as high; 4096 is the first's
/// height.
int64_t octaves(int32_t x, int32_t z, int bits, int count, int32_t seed) {
  int64_t sum = 0;
  for (int i = 0; i < count; ++i) sum += gradient_noise(x, z, bits - i, seed + i) * 2 >> i;
  return sum;
}

/// The same of ridges: sharp above, round below.
int64_t ridges(int32_t x, int32_t z, int bits, int count, int32_t seed) {
  int64_t sum = 0;
  for (int i = 0; i < count; ++i)
    sum += (700 - std::abs(gradient_noise(x, z, bits - i, seed + i)) * 2) * 2 >> i;
  return sum;
}

/// Adds an octave of value noise, of squares of 2^bits units, to the detail of points at all xs and zs.
void add_octave(std::span<const int32_t> xs, std::span<const int32_t> zs, int bits, GroundPoint* out) {
  const auto eased = [bits](int32_t v) {
    const int32_t low = v & ((1 << bits) - 1);
    return ease(bits >= 12 ? low >> (bits - 12) : low << (12 - bits));
  };
  // Squares are at least two voxels wide, so there are fewer than xs.
  std::array<int32_t, most_across> near{}, far{}, edge{};
  std::array<int32_t, most_across> t{};
  std::array<uint8_t, most_across> square{};
  const int32_t first = xs.front() >> bits;
  const auto squares = static_cast<size_t>((xs.back() >> bits) - first + 2);
  for (size_t n = 0; n < xs.size(); ++n) {
    t[n] = eased(xs[n]);
    square[n] = static_cast<uint8_t>((xs[n] >> bits) - first);
  }
  const auto corners = [&](std::array<int32_t, most_across>& row, int32_t z) {
    for (size_t i = 0; i < squares; ++i) row[i] = value_noise(first + static_cast<int32_t>(i), z, 61 + bits);
  };
  int32_t known = INT32_MIN;
  for (size_t m = 0; m < zs.size(); ++m) {
    if (const int32_t z = zs[m] >> bits; z != known) {
      corners(near, z);
      corners(far, z + 1);
      known = z;
    }
    const int32_t tz = eased(zs[m]);
    for (size_t i = 0; i < squares; ++i) edge[i] = near[i] + ((far[i] - near[i]) * tz >> 12);
    for (size_t n = 0; n < xs.size(); ++n) {
      const int32_t left = edge[square[n]], right = edge[square[n] + size_t{1}];
      out[m * xs.size() + n].detail += (left + ((right - left) * t[n] >> 12)) * (1 << bits) >> 16;
    }
  }
}

/// Weights of a uniform cubic B-spline at t of 0..4095; their sum is 4096.
std::array<int32_t, 4> spline(int32_t t) {
  const int64_t u = t, v = 4096 - u;
  const auto a = static_cast<int32_t>(v * v * v / 6 >> 24), d = static_cast<int32_t>(u * u * u / 6 >> 24);
  const auto c = static_cast<int32_t>(
      (4096 * (int64_t{4096} * 4096 + 3 * u * 4096 + 3 * u * u) - 3 * u * u * u) / 6 >> 24);
  return {a, 4096 - a - c - d, c, d};
}

struct Shape {
  int32_t height;
  int64_t road;
  int32_t rock, tint;
};

/// The ground without houses.
Shape shape_at(std::span<const Point> road, std::span<const Point> lane, int32_t x, int32_t z) {
  Shape s{};
  const int64_t to_road = distance(road, x, z), to_lane = distance(lane, x, z);
  s.road = std::min(to_road, to_lane + cm(60));
  // A valley along the road, hills beside it.
  const int32_t valley = step(10 * metre, 58 * metre, std::min(to_road, to_lane * 2));
  int64_t low = 15 * metre / 2 + (int64_t{valley} * 11 * metre >> 12);
  low += octaves(x + 917 * metre, z, 22, 2, 11) * cm(170) >> 12;
  const int64_t high = octaves(x, z, 20, 5, 21) * cm(75) >> 12;
  const int32_t calm = step(2 * metre, 14 * metre, s.road);
  // Rock breaks through on the hills, in steps.
  const int64_t rough = octaves(x, z + 77 * metre, 21, 6, 31);
  const int32_t rock =
      blend(0, step(-400, 1700, rough + valley / 2 - 1500), step(9 * metre, 20 * metre, s.road));
  const int64_t cliff = ridges(x, z, 20, 4, 41) * cm(150) >> 12;
  low += (int64_t{rock} * 3 * metre >> 12) + (rock * cliff >> 12) + (high * (1024 + calm * 3 / 4) >> 12);
  // The road is worn in.
  low -= int64_t{4096 - step(cm(120), cm(320), s.road)} * cm(18) >> 12;
  s.height = static_cast<int32_t>(std::clamp<int64_t>(low, 6 * metre, 27 * metre));
  s.rock = std::min(rock >> 4, 255);
  s.tint = static_cast<int32_t>(std::clamp<int64_t>(132 + octaves(x, z, 21, 5, 51) / 40, 0, 255));
  return s;
}

}  // namespace

uint64_t Ground::bytes() {
  return uint64_t{stride} * stride * sizeof(Cell);
}

Result<Ground> Ground::make(std::span<House> houses, Context& ctx) {
  Ground ground;
  ground.cells_.resize(static_cast<size_t>(stride) * stride);
  const auto road = line_of(road_points), lane = line_of(lane_points);
  for (House& house : houses) house.base = shape_at(road, lane, house.x, house.z).height + cm(15);
  VOX_CHECK(parallel_for(ctx, stride, [&](int64_t row) -> Status {
    const int32_t z = (static_cast<int32_t>(row) - border) * (1 << cell_bits);
    for (int32_t i = 0; i < stride; ++i) {
      const int32_t x = (i - border) * (1 << cell_bits);
      Shape s = shape_at(road, lane, x, z);
      for (const House& house : houses) {
        if (std::abs(house.x - x) > 14 * metre || std::abs(house.z - z) > 14 * metre) continue;
        const House::Local at = house.local(x, z);
        const int64_t a = std::max(std::abs(at.a) - house.length, 0),
                      b = std::max(std::abs(at.b) - house.width, 0);
        const int64_t away = root(a * a + b * b);
        s.height = blend(house.base - cm(15), s.height, step(cm(80), 5 * metre, away));
        // Trodden earth along the walls.
        s.tint = blend(20, s.tint, step(cm(20), cm(160), away));
        s.rock = blend(0, s.rock, step(cm(80), 5 * metre, away));
      }
      ground.cells_[static_cast<size_t>(row) * stride + static_cast<size_t>(i)] = {
          s.height, static_cast<uint16_t>(std::min<int64_t>(s.road >> 8, UINT16_MAX)),
          static_cast<uint8_t>(s.rock), static_cast<uint8_t>(s.tint)};
    }
    return {};
  }));
  return ground;
}

int32_t Ground::height(int32_t x, int32_t z) const {
  const int32_t i = x >> cell_bits, k = z >> cell_bits;
  const auto wx = spline((x & ((1 << cell_bits) - 1)) >> (cell_bits - 12));
  const auto wz = spline((z & ((1 << cell_bits) - 1)) >> (cell_bits - 12));
  int64_t sum = 0;
  for (int32_t dz = 0; dz < 4; ++dz) {
    int64_t across = 0;
    for (int32_t dx = 0; dx < 4; ++dx)
      across += int64_t{wx[static_cast<size_t>(dx)]} * cell(i + dx - 1, k + dz - 1).height;
    sum += (across >> 12) * wz[static_cast<size_t>(dz)];
  }
  return static_cast<int32_t>(sum >> 12);
}

void Ground::patch(std::span<const int32_t> xs, std::span<const int32_t> zs, int32_t edge,
                   GroundPoint* out) const {
  constexpr int fraction_bits = cell_bits - 12;
  const auto fraction = [](int32_t v) { return (v & ((1 << cell_bits) - 1)) >> fraction_bits; };
  std::array<std::array<int32_t, 4>, most_across> weights;
  for (size_t n = 0; n < xs.size(); ++n) weights[n] = spline(fraction(xs[n]));
  for (size_t m = 0; m < zs.size(); ++m) {
    const int32_t k = zs[m] >> cell_bits, tz = fraction(zs[m]);
    const auto wz = spline(tz);
    int32_t known = INT32_MIN;
    std::array<int64_t, 4> across{};
    std::array<int32_t, 2> road{}, rock{}, tint{};
    for (size_t n = 0; n < xs.size(); ++n) {
      const int32_t i = xs[n] >> cell_bits;
      if (i != known) {
        known = i;
        for (int32_t dx = 0; dx < 4; ++dx) {
          int64_t sum = 0;
          for (int32_t dz = 0; dz < 4; ++dz)
            sum += int64_t{wz[static_cast<size_t>(dz)]} * cell(i + dx - 1, k + dz - 1).height;
          across[static_cast<size_t>(dx)] = sum >> 12;
        }
        for (int32_t dx = 0; dx < 2; ++dx) {
          const Cell &near = cell(i + dx, k), &far = cell(i + dx, k + 1);
          road[static_cast<size_t>(dx)] = blend(near.road, far.road, tz);
          rock[static_cast<size_t>(dx)] = blend(near.rock, far.rock, tz);
          tint[static_cast<size_t>(dx)] = blend(near.tint, far.tint, tz);
        }
      }
      const int32_t tx = fraction(xs[n]);
      int64_t sum = 0;
      for (size_t dx = 0; dx < 4; ++dx) sum += weights[n][dx] * across[dx];
      out[m * xs.size() + n] = {static_cast<int32_t>(sum >> 12), blend(road[0], road[1], tx) << 8,
                                blend(rock[0], rock[1], tx), blend(tint[0], tint[1], tx), 0};
    }
  }
  // What is smaller, as far down as voxels can show it: tufts, stones, sand.
  for (int bits = 16; bits >= 2 && 1 << bits >= 2 * edge; --bits) add_octave(xs, zs, bits, out);
  for (GroundPoint& p : std::span(out, xs.size() * zs.size())) {
    p.detail = std::clamp(p.detail, -2047, 2047);
    // 5 cm of meadow, 9 cm of rock, 1 cm of the road.
    const int32_t wild = step(cm(110), cm(200), p.road);
    const int32_t roughness = blend(cm(1), cm(5) + (cm(4) * p.rock >> 8), wild);
    p.height += static_cast<int32_t>(int64_t{p.detail} * roughness >> 11);
  }
}

Ground::Range Ground::range(int32_t i, int32_t k) const {
  constexpr int32_t per_side = 1 << (range_bits - cell_bits);
  Range range{INT32_MAX, INT32_MIN};
  for (int32_t dk = -1; dk <= per_side + 1; ++dk)
    for (int32_t di = -1; di <= per_side + 1; ++di) {
      const int32_t h = cell(i * per_side + di, k * per_side + dk).height;
      range.lo = std::min(range.lo, h - most_detail);
      range.hi = std::max(range.hi, h + most_detail);
    }
  return range;
}

namespace {

struct Paint {
  int32_t r, g, b;
};
Paint mix(const Paint& p, const Paint& q, int32_t t) {
  return {blend(p.r, q.r, t), blend(p.g, q.g, t), blend(p.b, q.b, t)};
}
Rgb stored(const Paint& p, int32_t light) {
  const auto channel = [&](int32_t v) { return static_cast<uint8_t>(std::clamp(v * light >> 8, 0, 255)); };
  return {channel(p.r), channel(p.g), channel(p.b)};
}

/// Flowers, each in a square of its own.
bool flower(int32_t x, int32_t z, int32_t edge, Paint& paint) {
  constexpr int bits = 15;
  const int32_t i = x >> bits, k = z >> bits;
  const uint32_t h = hash(i, k, 71);
  if ((h & 15) != 0) return false;
  const int32_t dx = (x & 32767) - 8192 - static_cast<int32_t>(h >> 8 & 16383),
                dz = (z & 32767) - 8192 - static_cast<int32_t>(h >> 18);
  const int64_t radius = std::max(cm(3), edge / 2), from = int64_t{dx} * dx + int64_t{dz} * dz;
  if (from > radius * radius) return false;
  constexpr Paint colors[] = {{232, 224, 120}, {236, 232, 228}, {190, 96, 168}, {214, 78, 66}};
  paint = from * 9 < radius * radius ? Paint{226, 186, 40} : colors[hash(i >> 4, k >> 4, 72) & 3];
  return true;
}

/// Cobbles: the nearest of points in squares of 25 cm, and how much further the second is.
Paint cobbles(int32_t x, int32_t z) {
  constexpr int bits = 15;
  const int32_t i = x >> bits, k = z >> bits;
  int64_t first = INT64_MAX, second = INT64_MAX;
  uint32_t which = 0;
  for (int32_t dk = -1; dk <= 1; ++dk)
    for (int32_t di = -1; di <= 1; ++di) {
      const uint32_t h = hash(i + di, k + dk, 81);
      const int64_t px =
          (int64_t{i + di} << bits) + 6000 + static_cast<int32_t>(h & 0x3fff) + (h >> 30) * 1000 - x;
      const int64_t pz = (int64_t{k + dk} << bits) + 6000 + static_cast<int32_t>(h >> 14 & 0x3fff) - z;
      const int64_t d = px * px + pz * pz;
      if (d < first) {
        second = first, first = d, which = h;
      } else if (d < second) {
        second = d;
      }
    }
  const int32_t joint = step(20 << 20, 90 << 20, second - first);
  const auto light = static_cast<int32_t>(which >> 8 & 63);
  return mix({92, 80, 64}, {138 + light, 128 + light, 114 + light * 7 / 8}, joint);
}

}  // namespace

Rgb Ground::albedo(const GroundPoint& p, int32_t x, int32_t z, int32_t slope, int32_t edge) {
  // What is small, by all the detail there is, and by the grain of the voxel's own size.
  const int32_t grain = static_cast<int32_t>(hash(x, z, 91) & 31) - 16;
  const int32_t light = 256 + p.detail / 16 + grain;
  const int32_t edge_noise = p.detail * (cm(40) >> 11);
  const int32_t verge = step(cm(150), cm(210), p.road + edge_noise);
  if (verge == 0) {
    const Paint sand = mix({166, 146, 112}, {132, 110, 80}, step(cm(20), cm(70), std::abs(p.road - cm(75))));
    if (p.tint > 116) return stored(mix(cobbles(x, z), sand, step(cm(80), cm(150), p.road)), light);
    return stored(sand, light);
  }
  const Paint dry{142, 140, 78}, green{102, 122, 58}, lush{78, 106, 50}, earth{124, 104, 76};
  Paint paint = p.tint < 128 ? mix(dry, green, step(40, 128, p.tint + p.detail / 48))
                             : mix(green, lush, step(128, 215, p.tint + p.detail / 48));
  paint = mix(earth, paint, step(18, 70, p.tint + p.detail / 40));
  const int32_t stone = step(70, 150, p.rock + p.detail / 24 + slope);
  if (stone > 0) {
    // Layers of the rock show on its sides.
    const int32_t band = (p.height >> 13 & 31) * 2;
    const Paint rock = mix({128 + band / 4, 122 + band / 4, 112}, {98, 94, 90},
                           step(-900, 900, p.detail * 2 + (band - 32) * 24));
    paint = mix(paint, rock, stone);
  } else if (p.tint > 120 && p.rock < 60 && p.road > cm(300)) {
    Paint petals;
    if (flower(x, z, edge, petals)) return stored(petals, 256);
  }
  return stored(mix({128, 108, 78}, paint, verge), light);
}

Rgb Ground::strata(int32_t x, int32_t y, int32_t z, int32_t depth) {
  // Along the cut, and down.
  const int32_t warp = gradient_noise(x + z, y / 4, 19, 101) * (cm(60) >> 11) +
                       gradient_noise(x + z, y * 2, 15, 102) * (cm(14) >> 11);
  const int32_t d = depth + warp;
  const int32_t grain = 244 + static_cast<int32_t>(hash(x, y, z) & 31);
  if (d < cm(70)) return stored(mix({74, 92, 44}, {84, 62, 42}, step(cm(8), cm(22), depth)), grain);
  const int32_t layer = (y + warp * 3) / cm(90);
  const auto light = static_cast<int32_t>(hash(layer, 7, 103) & 31);
  const Paint clay{138 + light, 106 + light, 76 + light / 2}, stone{118 + light, 110 + light, 100 + light};
  return stored(mix(clay, stone, step(cm(300), cm(500), d)), grain);
}

}  // namespace voxkit::color::terrain
