// Rays through 4 x 2 neighbouring pixels, side by side, each lane a ray; all at the same depth, as the
// paper's warps are. Nothing here allocates.
#pragma once

#include "librender/brick_cache.h"
#include "librender/cast_kernel.h"
#include "librender/dvr_kernel.h"
#include "librender/transfer.h"

namespace voxkit::render {

/// What all rays of a picture share. Sample k of any ray is at depth (k + middle) * step.
struct DvrParams {
  CastParams cast;
  double step;      ///< depth from sample to sample, world units
  double middle;    ///< sample 0, about where the volume is
  float length;     ///< the same step in smallest voxel edges, along the camera's axis
  float margin;     ///< more than a sample's place is off by rounding, in voxels
  float edge[3];    ///< smallest edge of a voxel by its edge along each axis
  double voxel[3];  ///< edges of a voxel in the world
  float light[3];   ///< unit vector towards the light, world
  float flat;       ///< gradients of less than this are none, values an edge
  bool lit;         ///< not with DvrGradient::none
  float modulate;   ///< opacity is multiplied by this times the gradient's length, up to 1; 0: it is not
  const TransferFunction::Entry* table;
  float first, scale;
  const uint8_t* distances;  ///< of bricks to those that can be seen; null: all are looked at
  int32_t row, slice;
};

/// Where gradients come from; none: nothing asks for them.
enum class DvrGradient { none, analytic, neighbour };

constexpr int packet_width = 4, packet_height = 2;

/// Voxels as they are in memory, all of them within 2^31 voxels, at least two along each axis, with
/// DenseView's read_slack.
template <class T>
class DenseSampler {
 public:
  VOX_HD DenseSampler(const std::byte* voxels, const int64_t (&dims)[3])
      : voxels_(voxels),
        row_(static_cast<int32_t>(dims[0])),
        slice_(static_cast<int32_t>(dims[0] * dims[1])) {}
  VOX_HD_HOT void begin() {}

  /// The corners of each lane's cell, where the lane is wanted.
  template <class Lanes>
  VOX_HD_HOT void fetch(const Ints (&cell)[3], const Ints (&brick)[3], const Ints& place, const Ints& wanted,
                        Floats (&v)[8]) {
    (void)brick, (void)place;
    const Ints at = ((cell[2] * slice_ + cell[1] * row_) + cell[0]) | ~wanted;
    const Ints offset[4] = {at, (at + row_) | ~wanted, (at + slice_) | ~wanted,
                            (at + (row_ + slice_)) | ~wanted};
    for (int i = 0; i < 4; ++i) {
      if constexpr (sizeof(T) == 4) {
        v[2 * i] = bits_as_float(Lanes::template gather<4>(voxels_, offset[i]));
        v[2 * i + 1] = bits_as_float(Lanes::template gather<4>(voxels_, (offset[i] + 1) | ~wanted));
      } else {
        constexpr int bits = 8 * sizeof(T);
        const Ints pair = Lanes::template gather<sizeof(T)>(voxels_, offset[i]);
        v[2 * i] = to_float(pair & ((1 << bits) - 1));
        v[2 * i + 1] = to_float((pair >> bits) & ((1 << bits) - 1));
      }
    }
  }

 private:
  const std::byte* voxels_;
  int32_t row_, slice_;
};

/// Voxels of decoded bricks.
template <class T>
class BrickSampler {
 public:
  explicit BrickSampler(BrickCache<T>& cache) : cache_(cache) {}
  /// A packet begins: no lane holds a brick.
  VOX_HD_HOT void begin() { held_ = place_ = all(-1); }

  template <class Lanes>
  VOX_HD_HOT void fetch(const Ints (&cell)[3], const Ints (&brick)[3], const Ints& place, const Ints& wanted,
                        Floats (&v)[8]) {
    unsigned moved = Lanes::bits((place != place_) & wanted);
    if (moved != 0) hold(moved, brick, place);
    const auto within = [&](int a) { return cell[a] & (dvr_brick - 1); };
    constexpr int row = slot_edge, slice = slot_edge * slot_edge;
    const Ints at = (held_ * slot_values + (within(2) * slice + (within(1) * row + within(0)))) | ~wanted;
    const T* const values = cache_.values();
    constexpr int step[4] = {0, row, slice, row + slice};
    for (int i = 0; i < 4; ++i) {
      if constexpr (sizeof(T) == 4) {
        v[2 * i] = bits_as_float(Lanes::template gather<4>(values + step[i], at));
        v[2 * i + 1] = bits_as_float(Lanes::template gather<4>(values + step[i] + 1, at));
      } else {
        const Ints pair = Lanes::template gather<2>(values + step[i], at);
        v[2 * i] = to_float(pair & 0xffff);
        v[2 * i + 1] = to_float((pair >> 16) & 0xffff);
      }
    }
  }

 private:
  void hold(unsigned moved, const Ints (&brick)[3], const Ints& place) {
    for (; moved != 0; moved &= moved - 1) {
      const int lane = __builtin_ctz(moved);
      // Often the lane before has come to the same brick.
      int same = -1;
      for (int i = 0; i < dvr_lanes; ++i)
        if (place_[i] == place[lane] && held_[i] >= 0) same = i;
      held_[lane] = same >= 0 ? held_[same]
                              : cache_.find(place[lane], static_cast<uint32_t>(brick[0][lane]),
                                            static_cast<uint32_t>(brick[1][lane]),
                                            static_cast<uint32_t>(brick[2][lane]), lane, held_);
      place_[lane] = place[lane];
    }
  }
  BrickCache<T>& cache_;
  Ints held_ = all(-1), place_ = all(-1);
};

/// What a packet found, lane i being pixel (x + i % 4, y + i / 4).
struct DvrPixels {
  Floats colour[3] = {};       ///< light gathered
  Floats through = all(1.0f);  ///< what is still let through
  Ints hit = {};               ///< -1: something was seen
  Ints first = {};             ///< the first sample that was
  Ints samples = {};           ///< how many were taken
  uint64_t bricks = 0;         ///< places that were looked at, to see whether they can be skipped
};

/// The rays of a packet.
struct DvrRays {
  Floats at[3], step[3];    ///< where sample 0 is, from the middle of voxel 0 on, and the way to the next one
  Ints first, last;         ///< samples within the volume; last < first: none
  Floats length;            ///< from sample to sample in smallest edges
  Vec<Floats> ahead, half;  ///< for light_sample
};

/// Sets up the rays of the packet whose upper left pixel is (x, y).
VOX_HD_HOT void begin_rays(const DvrParams& params, int x, int y, DvrRays& rays) {
  for (int i = 0; i < dvr_lanes; ++i) {
    const int px = x + i % packet_width, py = y + i / packet_width;
    const PixelRay ray = ray_through(params.cast, px, py);
    const double length = world_length(params.cast, px, py);
    double t0 = 0, t1 = 1e300;
    bool misses = px >= params.cast.right || py >= params.cast.bottom;
    for (int a = 0; a < 3; ++a) {
      const double o = params.cast.origin[a], d = ray.direction[a],
                   side = static_cast<double>(params.cast.dims[a]);
      misses |= d == 0 && (o < 0 || o > side);
      const double near = (d < 0 ? side - o : -o) / d, far = (d < 0 ? -o : side - o) / d;
      if (d != 0 && near > t0) t0 = near;
      if (d != 0 && far < t1) t1 = far;
      rays.at[a][i] = static_cast<float>(o + d * (params.middle * params.step) - 0.5);
      rays.step[a][i] = static_cast<float>(d * params.step);
    }
    misses |= !(t0 <= t1);
    rays.first[i] = misses ? 1 : static_cast<int32_t>(std::ceil(t0 / params.step) - params.middle);
    rays.last[i] = misses ? 0 : static_cast<int32_t>(std::floor(t1 / params.step) - params.middle);
    rays.length[i] = static_cast<float>(static_cast<double>(params.length) * length);
    double ahead[3], half[3], square = 0;
    for (int a = 0; a < 3; ++a) {
      ahead[a] = ray.direction[a] * params.voxel[a] / length;
      half[a] = static_cast<double>(params.light[a]) - ahead[a];
      square += half[a] * half[a];
    }
    const double scale = square > 0 ? 1 / std::sqrt(square) : 0;
    rays.ahead.x[i] = static_cast<float>(ahead[0]), rays.half.x[i] = static_cast<float>(half[0] * scale);
    rays.ahead.y[i] = static_cast<float>(ahead[1]), rays.half.y[i] = static_cast<float>(half[1] * scale);
    rays.ahead.z[i] = static_cast<float>(ahead[2]), rays.half.z[i] = static_cast<float>(half[2] * scale);
  }
}

/// Where the samples of a depth are.
struct DvrPlaces {
  Floats at[3];  ///< from the middle of voxel 0 on, not clamped
  Vec<Floats> clamped;
  Ints cell[3], brick[3];
  Ints place;     ///< of the brick in the map of distances
  Ints distance;  ///< to bricks that can be seen
};
template <class Lanes>
VOX_HD_HOT void locate(const DvrParams& params, const DvrRays& rays, const Floats& k, DvrPlaces& found) {
  Floats* const clamped[3] = {&found.clamped.x, &found.clamped.y, &found.clamped.z};
  for (int a = 0; a < 3; ++a) {
    const int64_t side = params.cast.dims[a];
    found.at[a] = rays.at[a] + rays.step[a] * k;
    *clamped[a] = Lanes::least(Lanes::greatest(found.at[a], all(0.0f)), all(static_cast<float>(side - 1)));
    const Ints cell = to_int(*clamped[a]), most = all(static_cast<int32_t>(side > 1 ? side - 2 : 0));
    found.cell[a] = cell > most ? most : cell;
    found.brick[a] = found.cell[a] >> dvr_brick_log2;
  }
  found.place = (found.brick[2] * params.slice + found.brick[1] * params.row) + found.brick[0];
}
/// How many samples more of each lane are certainly in bricks that cannot be seen, where `distance` > 0.
template <class Lanes>
VOX_HD_HOT Floats unseen(const DvrParams& params, const DvrRays& rays, const Floats (&inverse)[3],
                         const DvrPlaces& found) {
  Floats least = all(16777216.0f);
  for (int a = 0; a < 3; ++a) {
    const Ints lo = (found.brick[a] - found.distance + 1) << dvr_brick_log2,
               hi = (found.brick[a] + found.distance) << dvr_brick_log2;
    const Floats plane = rays.step[a] < 0.0f ? to_float(lo) + params.margin : to_float(hi) - params.margin;
    least = Lanes::least((plane - found.at[a]) * inverse[a], least);
  }
  return Lanes::greatest(least, all(0.0f));
}

/// The value of lane i ^ 1, and of lane i ^ 4.
VOX_HD_HOT Floats beside(const Floats& x) {
  return __builtin_shufflevector(x, x, 1, 0, 3, 2, 5, 4, 7, 6);
}
VOX_HD_HOT Floats below(const Floats& x) {
  return __builtin_shufflevector(x, x, 4, 5, 6, 7, 0, 1, 2, 3);
}
VOX_HD_HOT Ints beside(const Ints& x) {
  return __builtin_shufflevector(x, x, 1, 0, 3, 2, 5, 4, 7, 6);
}
VOX_HD_HOT Ints below(const Ints& x) {
  return __builtin_shufflevector(x, x, 4, 5, 6, 7, 0, 1, 2, 3);
}

/// A sample of each lane.
struct DvrSamples {
  DvrPlaces place;
  Interpolated<Floats> here;
  Ints inside;  ///< the lane's ray is in the volume
  Ints taken;   ///< and not yet opaque, and in a brick that can be seen
};

/// Replaces gradients by those from neighbouring rays, and the other depth, where these determine one.
template <class Lanes>
VOX_HD_HOT void use_neighbours(DvrSamples& sample, const DvrSamples& other) {
  const Vec<Floats>& at = sample.place.clamped;
  const Floats& value = sample.here.value;
  const Vec<Floats> way[3] = {Vec<Floats>{beside(at.x), beside(at.y), beside(at.z)} - at,
                              Vec<Floats>{below(at.x), below(at.y), below(at.z)} - at,
                              other.place.clamped - at};
  const Floats difference[3] = {beside(value) - value, below(value) - value, other.here.value - value};
  const Solved<Floats> solved = solve_gradient<Lanes>(way, difference);
  const Ints accepted =
      solved.accepted & beside(sample.inside) & below(sample.inside) & sample.inside & other.inside;
  Vec<Floats>& gradient = sample.here.gradient;
  gradient.x = accepted ? solved.gradient.x : gradient.x;
  gradient.y = accepted ? solved.gradient.y : gradient.y;
  gradient.z = accepted ? solved.gradient.z : gradient.z;
}

/// Classifies, lights and blends a sample of each lane.
template <class Lanes, DvrGradient kind>
VOX_HD_HOT void blend_samples(const DvrParams& params, const DvrRays& rays, const DvrSamples& sample,
                              int32_t k, DvrPixels& pixels) {
  constexpr float last = TransferFunction::entries - 1;
  const Floats& value = sample.here.value;
  const Floats entry =
      Lanes::least(Lanes::greatest((value - params.first) * params.scale, all(0.0f)), all(last));
  const Ints wanted = sample.taken & (value == value);
  const Ints at = (to_int(entry) << 2) | ~wanted;
  const float* const table = params.table->rgb;
  Floats density = bits_as_float(Lanes::template gather<4>(table + 3, at));
  const Ints seen = density > 0.0f;
  if (Lanes::bits(seen) == 0) return;
  const Ints colour_at = at | ~seen;
  Floats colour[3];
  for (int i = 0; i < 3; ++i) colour[i] = bits_as_float(Lanes::template gather<4>(table + i, colour_at));
  Vec<Floats> gradient;
  if constexpr (kind != DvrGradient::none)
    gradient = {sample.here.gradient.x * params.edge[0], sample.here.gradient.y * params.edge[1],
                sample.here.gradient.z * params.edge[2]};
  if (kind != DvrGradient::none && params.modulate > 0) {
    const Floats share = Lanes::least(Lanes::root(dot(gradient, gradient)) * params.modulate, all(1.0f));
    const Floats opacity = (1.0f - exp2_of_density<Lanes>(-density)) * share;
    density = -log2_of_share(Lanes::greatest(1.0f - opacity, all(0x1p-126f)));
    density = seen ? density : all(0.0f);
  }
  if (kind != DvrGradient::none && params.lit) {
    const Vec<float> light{params.light[0], params.light[1], params.light[2]};
    const Lit<Floats> lit = light_sample<Lanes>(gradient, light, rays.half, rays.ahead, params.flat);
    for (Floats& c : colour) c = c * lit.diffuse + lit.specular;
  }
  const Floats through = pixels.through * exp2_of_density<Lanes>(-density * rays.length);
  const Floats weight = pixels.through - through;
  for (int i = 0; i < 3; ++i) {
    const Floats more = pixels.colour[i] + weight * colour[i];
    pixels.colour[i] = seen ? more : pixels.colour[i];
  }
  pixels.through = seen ? through : pixels.through;
  pixels.first = pixels.hit < 0 ? pixels.first : all(k);
  pixels.hit |= density > 0.0f;
}

/// Follows the rays of a packet until all have left the volume or are opaque; `pixels` is as it is made.
template <class Lanes, class Sampler, DvrGradient kind>
VOX_HD_HOT void march(const DvrParams& params, Sampler& sampler, int x, int y, DvrPixels& pixels) {
  // Neighbouring depths come in pairs, as a gradient needs both.
  constexpr int depths = kind == DvrGradient::neighbour ? 2 : 1;
  constexpr bool with_gradient = kind != DvrGradient::none;
  constexpr float transparent = 1 - opaque;
  DvrRays rays;
  begin_rays(params, x, y, rays);
  sampler.begin();
  Ints alive = rays.first <= rays.last;
  if (Lanes::bits(alive) == 0) return;
  Floats inverse[3];
  for (int a = 0; a < 3; ++a) {
    const Floats tiny = all(1e-12f), way = rays.step[a];
    inverse[a] = 1.0f / (way < 0.0f ? Lanes::least(way, -tiny) : Lanes::greatest(way, tiny));
  }
  const Ints never = all(INT32_MAX);
  int32_t k = least_lane(alive ? rays.first : never) & -depths;
  for (;;) {
    DvrSamples samples[depths];
    Ints wanted{};
    for (int i = 0; i < depths; ++i) {
      DvrSamples& s = samples[i];
      s.inside = (rays.first <= k + i) & (rays.last >= k + i);
      locate<Lanes>(params, rays, all(static_cast<float>(k + i)), s.place);
      s.taken = alive & s.inside;
      if (params.distances != nullptr) {
        s.place.distance = Lanes::template gather<1>(params.distances, s.place.place | ~s.taken) & 255;
        s.taken &= s.place.distance == 0;
      }
      wanted |= s.taken;
    }
    pixels.bricks += depths;
    if (Lanes::bits(wanted) == 0) {
      // On to where a ray enters, or may see something.
      const DvrSamples& s = samples[depths - 1];
      const int32_t here = k + depths - 1;
      Ints next = all(here) + 1;
      if (params.distances != nullptr)
        next = s.inside ? next + to_int(unseen<Lanes>(params, rays, inverse, s.place)) : next;
      next = rays.first > here ? rays.first : next;
      next = alive & (rays.last >= next) ? next : never;
      const int32_t to = least_lane(next);
      if (to == INT32_MAX) return;
      k = to & -depths;
      continue;
    }
    for (int i = 0; i < depths; ++i) {
      DvrSamples& s = samples[i];
      Floats corners[8];
      const DvrPlaces& p = s.place;
      sampler.template fetch<Lanes>(p.cell, p.brick, p.place, depths > 1 ? s.inside : s.taken, corners);
      const Vec<Floats> within = {p.clamped.x - to_float(p.cell[0]), p.clamped.y - to_float(p.cell[1]),
                                  p.clamped.z - to_float(p.cell[2])};
      s.here = interpolate<with_gradient>(corners, within);
    }
    if constexpr (depths > 1) {
      const Interpolated<Floats> first = samples[0].here;
      use_neighbours<Lanes>(samples[0], samples[1]);
      use_neighbours<Lanes>(samples[1], DvrSamples{samples[0].place, first, samples[0].inside, {}});
    }
    for (int i = 0; i < depths; ++i) {
      DvrSamples& s = samples[i];
      if (i > 0) s.taken &= alive;
      pixels.samples -= s.taken;
      blend_samples<Lanes, kind>(params, rays, s, k + i, pixels);
      alive &= pixels.through > transparent;
    }
    k += depths;
  }
}

}  // namespace voxkit::render
