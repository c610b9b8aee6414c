#include "libcolor/terrain/house.h"

#include <algorithm>
#include <cstdlib>
#include <optional>

namespace voxkit::color::terrain {
namespace {

constexpr int32_t cos_of[16] = {65536,  60547,  46341,  25080,  0, -25080, -46341, -60547,
                                -65536, -60547, -46341, -25080, 0, 25080,  46341,  60547};
constexpr int32_t cosine(int32_t turn) {
  return cos_of[turn & 15];
}
constexpr int32_t sine(int32_t turn) {
  return cos_of[(turn + 12) & 15];
}

constexpr int32_t pitch = 250;  ///< of roofs, in 1/256
constexpr int32_t overhang = cm(55), gable_overhang = cm(40), roof_depth = cm(22);
constexpr int32_t plinth = cm(9), plinth_height = cm(55);
constexpr int32_t reveal = cm(6), glass_depth = cm(14);
constexpr int32_t tile_length = cm(34), tile_width = cm(24);

struct Style {
  Rgb plaster, roof, wood;
  bool timber;
};
constexpr std::array<Style, 6> styles{{{{226, 214, 188}, {150, 74, 52}, {92, 62, 40}, true},
                                       {{218, 190, 140}, {128, 66, 48}, {74, 96, 70}, false},
                                       {{232, 228, 218}, {92, 92, 98}, {70, 88, 112}, false},
                                       {{214, 204, 184}, {164, 88, 58}, {70, 48, 34}, true},
                                       {{206, 160, 132}, {120, 60, 46}, {96, 50, 40}, false},
                                       {{224, 220, 204}, {112, 72, 54}, {84, 58, 38}, true}}};

/// Walls: 0 and 1 are the long ones, at b = +width and -width; 2 and 3 the gables.
struct OnWall {
  int wall;
  int32_t along, depth;  ///< along the wall from its middle; how far inside
};

struct Opening {
  bool door;
  int32_t along, half, lo, hi;  ///< middle along the wall, half the width, heights above the floor
};

/// The window or door nearest to a place along a wall, on the floor that a height belongs to.
std::optional<Opening> opening_at(const House& house, int wall, int32_t along, int32_t above) {
  const int32_t half = wall < 2 ? house.length : house.width;
  const int32_t count = std::max((2 * half - cm(100)) / cm(230), 1), gap = 2 * half / count;
  const int32_t which = std::clamp((along + half) / gap, 0, count - 1);
  const int32_t middle = which * gap + gap / 2 - half;
  if (above > house.walls - cm(30)) {
    // One window in the gable.
    if (wall < 2) return std::nullopt;
    return Opening{false, 0, cm(42), house.walls + cm(30), house.walls + cm(130)};
  }
  if (wall == 0 && which == count / 2 && above < cm(260))
    return Opening{true, middle, cm(55), -cm(10), cm(215)};
  if (above > cm(280)) {
    if (house.walls < cm(480)) return std::nullopt;
    return Opening{false, middle, cm(48), cm(355), cm(465)};
  }
  return Opening{false, middle, cm(50), cm(95), cm(220)};
}

/// Of a window: whether a place in it is glass, not frame.
bool is_glass(const Opening& o, int32_t along, int32_t above) {
  const int32_t x = std::abs(along - o.along), y = above - o.lo, height = o.hi - o.lo;
  constexpr int32_t border = cm(7), bar = cm(3);
  return x < o.half - border && x > bar && y > border && y < height - border &&
         std::abs(y - height * 5 / 8) > bar;
}

Rgb scaled(Rgb c, int32_t light) {
  const auto channel = [&](uint8_t v) { return static_cast<uint8_t>(std::clamp(v * light >> 8, 0, 255)); };
  return {channel(c.r), channel(c.g), channel(c.b)};
}

int32_t grain(int32_t x, int32_t y, int32_t z) {
  return 248 + static_cast<int32_t>(hash(x, y, z) & 15);
}

/// v modulo m, and the number of the period, also of what is negative.
struct Period {
  int32_t number, place;
};
constexpr Period period(int32_t v, int32_t m) {
  const int32_t q = v >= 0 ? v / m : -1 - (-1 - v) / m;
  return {q, v - q * m};
}

struct Chimney {
  int32_t a, b, half_a = cm(45), half_b = cm(38);
};
Chimney chimney_of(const House& house) {
  return {house.length / 2, -house.width / 4};
}
bool in_chimney(const House& house, House::Local at, int32_t margin) {
  const Chimney c = chimney_of(house);
  return std::abs(at.a - c.a) <= c.half_a + margin && std::abs(at.b - c.b) <= c.half_b + margin;
}
int32_t chimney_top(const House& house) {
  return house.under_roof(0) + cm(110);
}

/// Rows of tiles, counted from the ridge, and how high they lie on each other.
struct Tile {
  int32_t row, column, down, across;
};
Tile tile_at(House::Local at) {
  const Period row = period(std::abs(at.b) * 3 / 2, tile_length);
  const Period column = period(at.a + (row.number & 1) * (tile_width / 2), tile_width);
  return {row.number, column.number, row.place, std::abs(column.place - tile_width / 2)};
}
int32_t tile_relief(House::Local at) {
  const Tile t = tile_at(at);
  const int32_t ridge = std::abs(at.b) < cm(14) ? cm(6) : 0;
  return ridge + t.down / 12 - t.across / 6;
}

}  // namespace

House::Local House::local(int32_t px, int32_t pz) const {
  const int64_t dx = px - x, dz = pz - z, c = cosine(turn), s = sine(turn);
  return {static_cast<int32_t>((dx * c + dz * s) >> 16), static_cast<int32_t>((dz * c - dx * s) >> 16)};
}

int32_t House::under_roof(int32_t b) const {
  return base + walls + static_cast<int32_t>(int64_t{width - std::abs(b)} * pitch >> 8);
}

int32_t House::top() const {
  return chimney_top(*this) + cm(20);
}

int32_t House::reach() const {
  return length + width + cm(200);
}

House::Parts House::column(int32_t px, int32_t pz) const {
  Parts parts;
  const Local at = local(px, pz);
  const int32_t a = std::abs(at.a), b = std::abs(at.b);
  const auto add = [&](int32_t lo, int32_t hi) {
    parts.solid[static_cast<size_t>(parts.solids++)] = {lo, hi};
  };
  const auto take = [&](int32_t lo, int32_t hi) {
    parts.hollow[static_cast<size_t>(parts.hollows++)] = {lo, hi - 1};
  };
  if (a > length + cm(120) || b > width + cm(120)) return parts;
  const int32_t foot = base - metre, under = under_roof(at.b);
  if (a <= length && b <= width) {
    add(foot, under);
    const std::array<OnWall, 4> on{{{0, at.a, width - at.b},
                                    {1, at.a, width + at.b},
                                    {2, at.b, length - at.a},
                                    {3, at.b, length + at.a}}};
    for (const OnWall& w : on) {
      if (w.depth > glass_depth) continue;
      // One opening on each floor, and one in the gable.
      for (const int32_t above : {cm(150), cm(400), walls + cm(60)}) {
        if (above > cm(300) && above < cm(450) && walls < cm(480)) continue;
        const auto o = opening_at(*this, w.wall, w.along, above);
        if (!o || std::abs(w.along - o->along) >= o->half || parts.hollows + 4 > 10) continue;
        if (w.depth <= reveal || o->door) {
          take(base + o->lo, base + o->hi);
          continue;
        }
        const int32_t height = o->hi - o->lo, bar = height * 5 / 8;
        if (is_glass(*o, w.along, o->lo + bar / 2)) {
          take(base + o->lo + cm(7), base + o->lo + bar - cm(3));
          take(base + o->lo + bar + cm(3), base + o->hi - cm(7));
        }
      }
    }
  }
  if (a <= length + plinth && b <= width + plinth) add(foot, base + plinth_height);
  // The step before the door.
  if (at.b > 0 && b <= width + cm(80) && b > width) {
    const auto door = opening_at(*this, 0, at.a, cm(100));
    if (door && door->door && std::abs(at.a - door->along) < cm(85)) add(foot, base + cm(18));
  }
  if (a <= length + gable_overhang && b <= width + overhang)
    add(under - cm(2), under + roof_depth + tile_relief(at));
  const bool cap = in_chimney(*this, at, cm(7));
  if (in_chimney(*this, at, 0)) add(base + walls, chimney_top(*this));
  if (cap) add(chimney_top(*this) - cm(18), chimney_top(*this));
  return parts;
}

Rgb House::color(int32_t px, int32_t py, int32_t pz, int32_t edge, const Light& light) const {
  const Style& look = styles[static_cast<size_t>(style) % styles.size()];
  const Local at = local(px, pz);
  const int32_t a = std::abs(at.a), b = std::abs(at.b), above = py - base;
  const int32_t c = cosine(turn) >> 8, s = sine(turn) >> 8;
  // From the house's directions to the world's.
  const auto facing = [&](int32_t na, int32_t ny, int32_t nb) {
    return normalised((na * c - nb * s) >> 4, ny << 4, (na * s + nb * c) >> 4);
  };
  const auto lit = [&](Rgb albedo, int32_t na, int32_t ny, int32_t nb, int32_t cavity = 256) {
    // Looked at from a little outside, so that it is not in the shadow of itself.
    const Normal n = facing(na, ny, nb);
    const int32_t out = cm(10) >> 8;
    return light.shade(albedo, n, px + n.x * out, py + edge / 2 + n.y * out, pz + n.z * out, cavity);
  };
  const int32_t side_b = at.b >= 0 ? 256 : -256, side_a = at.a >= 0 ? 256 : -256;
  const int32_t under = under_roof(at.b), slack = std::max(edge, cm(3));

  if (in_chimney(*this, at, cm(7) + slack) && py > under + roof_depth + cm(8)) {
    const Chimney ch = chimney_of(*this);
    const int32_t ca = at.a - ch.a, cb = at.b - ch.b;
    const bool by_a = std::abs(ca) - ch.half_a > std::abs(cb) - ch.half_b;
    const Period row = period(py, cm(8)),
                 brick = period((by_a ? cb : ca) + (row.number & 1) * cm(11), cm(22));
    const bool joint = edge < cm(4) && (row.place < cm(1) || brick.place < cm(1));
    const Rgb brick_color =
        scaled({146, 82, 62}, 232 + static_cast<int32_t>(hash(row.number, brick.number, 3) & 47));
    const Rgb albedo = joint ? Rgb{150, 140, 128} : brick_color;
    if (py > chimney_top(*this) - edge) return lit({120, 112, 104}, 0, 256, 0);
    return by_a ? lit(albedo, ca > 0 ? 256 : -256, 0, 0) : lit(albedo, 0, 0, cb > 0 ? 256 : -256);
  }
  if (py > under - slack && (py + edge > under + roof_depth || a > length + slack || b > width + slack)) {
    // The underside and the edges of the roof are of wood.
    const int32_t top = under + roof_depth + tile_relief(at);
    const bool at_edge = a > length + gable_overhang - slack || b > width + overhang - slack;
    if (py < top - std::max(2 * edge, cm(14)) - edge && (a > length || b > width)) {
      const Rgb wood = scaled(look.wood, grain(px >> 13, py >> 11, pz >> 13));
      return at_edge ? lit(wood, b - width > a - length ? 0 : side_a, 0, b - width > a - length ? side_b : 0)
                     : lit(wood, 0, -256, 0, 150);
    }
    const Tile t = tile_at(at);
    const uint32_t h = hash(t.row * 2 + (at.b > 0), t.column, style + x);
    int32_t tone = 222 + static_cast<int32_t>(h & 63);
    if (edge < cm(10) && t.down > tile_length - cm(4)) tone = tone * 3 / 4;
    if (edge < cm(5) && t.across > tile_width / 2 - cm(1)) tone = tone * 3 / 4;
    Rgb roof = scaled(look.roof, tone * grain(px, py, pz) >> 8);
    if ((h >> 8 & 15) == 0) roof = scaled(roof, 208);
    // Moss towards the eaves.
    if (static_cast<int32_t>(h >> 12 & 7) * 5 + 10 < b * 32 / width) {
      roof = {static_cast<uint8_t>((roof.r + 70) / 2), static_cast<uint8_t>((roof.g + 92) / 2),
              static_cast<uint8_t>((roof.b + 44) / 2)};
    }
    const Normal n = facing(0, 256, at.b >= 0 ? pitch : -pitch);
    return light.shade(roof, n, px, std::max(py, under + roof_depth) + cm(8), pz);
  }

  const bool long_wall = b - width >= a - length;
  const int wall = long_wall ? (at.b > 0 ? 0 : 1) : (at.a > 0 ? 2 : 3);
  const int32_t along = long_wall ? at.a : at.b, depth = long_wall ? width - b : length - a;
  const int32_t na = long_wall ? 0 : side_a, nb = long_wall ? side_b : 0;
  const auto on_wall = [&](Rgb albedo, int32_t cavity = 256) { return lit(albedo, na, 0, nb, cavity); };

  if (depth < -plinth - slack)
    return lit(scaled({132, 126, 116}, grain(px >> 10, py >> 10, pz >> 10)), 0, 256, 0);  // the step
  const auto o = opening_at(*this, wall, along, above);
  if (o && above >= o->lo && above <= o->hi && depth < glass_depth + 2 * slack) {
    const int32_t from = std::abs(along - o->along);
    if (from < o->half) {
      if (o->door) {
        const int32_t plank = period(along, cm(16)).place;
        const bool joint = edge < cm(3) && plank < cm(1);
        const bool pane = from < cm(28) && above > cm(140) && above < cm(190) && from > cm(3);
        if (pane) return on_wall({48, 56, 62});
        return on_wall(scaled(look.wood, joint ? 120 : grain(period(along, cm(16)).number, 5, 7)), 220);
      }
      if (is_glass(*o, along, above) && depth > reveal - slack) {
        // The sky in the glass, a curtain behind it.
        const int32_t sky = std::clamp((above - o->lo) * 256 / (o->hi - o->lo), 0, 255);
        const bool curtain = from > o->half * 5 / 8;
        const Rgb pane = curtain ? Rgb{168, 160, 150}
                                 : Rgb{static_cast<uint8_t>(44 + sky / 5), static_cast<uint8_t>(58 + sky / 4),
                                       static_cast<uint8_t>(74 + sky / 3)};
        return on_wall(pane);
      }
      return on_wall({236, 234, 228});
    }
    // Shutters, painted beside windows of the lower floors.
    if (above < walls && !o->door && from < o->half * 2 - cm(6) && from > o->half + cm(3)) {
      const int32_t slat = period(above, cm(7)).place;
      return on_wall(scaled(look.wood, edge < cm(3) && slat < cm(2) ? 170 : 290));
    }
  }
  if (o && above >= o->lo - cm(9) && above <= o->hi + cm(9) && std::abs(along - o->along) < o->half + cm(9))
    return on_wall(look.timber ? scaled(look.wood, grain(along >> 12, above >> 14, 9)) : Rgb{208, 200, 184});
  if (above < plinth_height + slack) {
    const Period row = period(py, cm(22)),
                 stone = period(along + (row.number & 1) * cm(19) + (row.number & 2) * cm(5), cm(38));
    const bool joint = edge < cm(6) && (row.place < cm(2) || stone.place < cm(2));
    const Rgb albedo = joint ? Rgb{96, 90, 82}
                             : scaled({138, 132, 122},
                                      224 + static_cast<int32_t>(hash(row.number, stone.number, wall) & 63));
    return on_wall(scaled(albedo, grain(px, py, pz)));
  }
  if (look.timber) {
    const Period panel = period(along + cm(1600), cm(125));
    const int32_t half_floor = cm(125), level = period(above - plinth_height, half_floor).place;
    const int32_t braced = static_cast<int32_t>(hash(panel.number, wall, x) & 3);
    const int32_t rise = above - plinth_height - (above > cm(305) ? cm(250) : 0);
    const bool brace =
        above < walls && (braced == 0 ? std::abs(panel.place * 2 - rise) < cm(17)
                                      : braced == 1 && std::abs((cm(125) - panel.place) * 2 - rise) < cm(17));
    if (panel.place < cm(15) || level < cm(14) || above > walls - cm(12) * (long_wall ? 1 : 0) || brace) {
      // Beams, and boards in the gable.
      const int32_t board = above > walls ? along / cm(17) : along >> 11;
      const int32_t fibre = static_cast<int32_t>(hash(board, above > walls ? 0 : above >> 14, 13) & 47);
      return on_wall(scaled(look.wood, 224 + fibre));
    }
  }
  // Plaster: rain has darkened it at the foot.
  const int32_t damp = step(cm(55), cm(150), above);
  const int32_t spots = static_cast<int32_t>(hash(along >> 14, above >> 14, wall) & 7);
  return on_wall(scaled(look.plaster, (blend(226, 252, damp) + spots) * grain(px, py, pz) >> 8));
}

int32_t House::shadow(int32_t u, int32_t v) const {
  // Along the ray the place is (u + sun_x y, y, v + sun_z y): every bound of a part is linear in y.
  const Local from = local(u, v);
  const int64_t c = cosine(turn), s = sine(turn);
  const int64_t rate_a = (sun_x * c + sun_z * s) >> 8, rate_b = (sun_z * c - sun_x * s) >> 8;  // in 2^-16
  struct Ray {
    int64_t lo, hi;
    /// rate y <= bound, the rate in 2^-16.
    void cut(int64_t rate, int64_t bound) {
      if (rate > 0) {
        hi = std::min(hi, (bound << 16) / rate);
      } else if (rate < 0) {
        lo = std::max(lo, (bound << 16) / rate);
      } else if (bound < 0) {
        hi = -1;
      }
    }
  };
  const auto box = [&](int32_t mid_a, int32_t mid_b, int32_t half_a, int32_t half_b, int32_t lo, int32_t hi) {
    Ray ray{lo, hi};
    ray.cut(rate_a, half_a + mid_a - from.a), ray.cut(-rate_a, half_a - mid_a + from.a);
    ray.cut(rate_b, half_b + mid_b - from.b), ray.cut(-rate_b, half_b - mid_b + from.b);
    return ray;
  };
  // On one side of the ridge, y + pitch |b| is at most `most` and at least `least`.
  const int64_t slope = rate_b * pitch >> 8, start = int64_t{from.b} * pitch >> 8;
  const auto below = [&](Ray& ray, int way, int64_t most) {
    ray.cut(65536 + way * slope, most - way * start);
  };
  const auto above = [&](Ray& ray, int way, int64_t least) {
    ray.cut(-65536 - way * slope, way * start - least);
  };
  const int64_t ridge = under_roof(0);
  int64_t highest = -1;
  const auto meet = [&](const Ray& ray) {
    if (ray.lo <= ray.hi) highest = std::max(highest, ray.hi);
  };
  Ray body = box(0, 0, length, width, base - metre, top());
  below(body, 1, ridge);
  below(body, -1, ridge);
  meet(body);
  const int32_t half = (width + overhang) / 2;
  for (const int way : {1, -1}) {
    Ray roof = box(0, way * half, length + gable_overhang, half, base, top());
    below(roof, way, ridge + roof_depth);
    above(roof, way, ridge);
    meet(roof);
  }
  const Chimney ch = chimney_of(*this);
  meet(box(ch.a, ch.b, ch.half_a, ch.half_b, base + walls, chimney_top(*this)));
  return static_cast<int32_t>(highest);
}

std::span<const House> planned_houses() {
  constexpr auto at = [](int32_t x, int32_t z, int32_t turn, int64_t length, int64_t width, int64_t walls,
                         int32_t style) {
    return House{x * metre, z * metre, turn, cm(length), cm(width), cm(walls), style};
  };
  // Beside the road and the lane, fronts towards them: the front is the wall at +b.
  static constexpr std::array houses{
      at(20, 57, 15, 560, 390, 500, 0), at(36, 46, 14, 480, 360, 300, 1), at(28, 76, 7, 620, 410, 520, 3),
      at(46, 72, 9, 500, 370, 310, 2),  at(64, 80, 8, 700, 430, 540, 5),  at(84, 81, 7, 540, 380, 300, 4),
      at(78, 59, 15, 600, 400, 520, 0), at(98, 49, 14, 500, 370, 300, 2), at(104, 66, 6, 580, 390, 500, 3),
      at(47, 48, 12, 440, 340, 290, 4), at(74, 42, 5, 520, 370, 500, 5),  at(56, 26, 13, 460, 350, 300, 1),
      at(118, 54, 6, 440, 340, 290, 1)};
  return houses;
}

}  // namespace voxkit::color::terrain
