// Rays through neighbouring pixels, side by side, each lane a ray; all at the same depth, as the paper's
// warps are. `Lanes` says what a lane is: VectorLanes (dvr_lanes.h), or Warp (dvr_warp.h) for threads of a
// device. Nothing here allocates.
#pragma once

#include "librender/cast/cast_kernel.h"
#include "librender/dvr/brick_ranges.h"
#include "librender/dvr/dvr_kernel.h"
#include "librender/dvr/transfer.h"

namespace voxkit::render {

/// What all rays of a picture share. Sample k of any ray is at depth (k + middle) * step.
struct DvrParams {
  CastParams cast;
  double step;     ///< depth from sample to sample, world units
  double middle;   ///< sample 0, about where the volume is
  float length;    ///< the same step in smallest voxel edges, along the camera's axis
  float margin;    ///< more than a sample's place is off by rounding, in voxels
  float shortest;  ///< way to a sample beside from which a gradient can be had in spite of that
  float slope[3]
             [3];  ///< from gradients in the grid to those in the world, a smallest edge of a voxel being 1
                   ///< there, times the unit of gradients where these are not from neighbours; rows: world
  float unit;      ///< of gradients, where these come from neighbours
  double reach[3][3];  ///< from directions in the grid to those in the world; rows: world
  float light[3];      ///< unit vector towards the light, world
  float flat;          ///< gradients of less than this are none, units an edge
  bool lit;            ///< not with DvrGradient::none
  float modulate;      ///< opacity is multiplied by this times the gradient's length, up to 1; 0: it is not
  const TransferFunction::Entry* table;
  float first, scale;
  const uint8_t* distances;  ///< of bricks to those that can be seen; null: all are looked at
  int32_t row, slice;
};

/// Where gradients come from; none: nothing asks for them.
enum class DvrGradient { none, analytic, neighbour };

/// What a packet found, lane i being pixel (x + i % width, y + i / width).
template <class Lanes>
struct DvrPixels {
  using Real = typename Lanes::Real;
  Real color[3] = {};                ///< light gathered
  Real through = Lanes::all(1.0f);   ///< what is still let through
  typename Lanes::Mask hit = {};     ///< whether something was seen
  typename Lanes::Int first = {};    ///< the first sample that was
  typename Lanes::Int samples = {};  ///< how many were taken
  uint64_t bricks = 0;               ///< places that were looked at, to see whether they can be skipped
};

/// The rays of a packet.
template <class Lanes>
struct DvrRays {
  using Real = typename Lanes::Real;
  Real at[3], step[3];  ///< where sample 0 is, from the middle of voxel 0 on, and the way to the next one
  typename Lanes::Int first, last;  ///< samples within the volume; last < first: none
  Real length;                      ///< from sample to sample in smallest edges
  Vec<Real> ahead, half;            ///< for light_sample
};

/// A gradient of the grid in the world, see DvrParams::slope.
template <class Real>
VOX_HD_HOT Vec<Real> to_world(const DvrParams& params, const Vec<Real>& g) {
  const auto component = [&](const float(&row)[3]) { return g.x * row[0] + g.y * row[1] + g.z * row[2]; };
  return {component(params.slope[0]), component(params.slope[1]), component(params.slope[2])};
}

/// Sets up the rays of the packet whose upper left pixel is (x, y). Loops over lanes are such that compilers
/// make vectors of them.
template <class Lanes>
VOX_HD_HOT void begin_rays(const DvrParams& params, int x, int y, DvrRays<Lanes>& rays) {
  constexpr int n = Lanes::held;
  const CastParams& cast = params.cast;
  double u[n], v[n], length[n], way[3][n], ahead[3][n], half[3][n], square[n], near[n], far[n];
  double missed[n];  // 1: the ray misses the volume
  for (int i = 0; i < n; ++i) {
    const int lane = Lanes::first() + i, px = x + lane % Lanes::width, py = y + lane / Lanes::width;
    missed[i] = px >= cast.right || py >= cast.bottom ? 1 : 0;
    length[i] = world_length(cast, px, py);
    u[i] = px + 0.5, v[i] = py + 0.5;
    near[i] = 0, far[i] = 1e300, square[i] = 0;
  }
  float at[3][n], step[3][n];
  for (int a = 0; a < 3; ++a) {
    const double o = cast.origin[a], side = static_cast<double>(cast.dims[a]);
    const double outside = o < 0 || o > side ? 1 : 0;
    for (int i = 0; i < n; ++i) {
      const double d = cast.corner[a] + (cast.across[a] * u[i] + cast.down[a] * v[i]);  // as ray_through
      // Where the ray does not move along the axis, these mean nothing.
      const double p = (d < 0 ? side - o : -o) / d, q = (d < 0 ? -o : side - o) / d;
      const double from = d == 0 ? 0 : p, to = d == 0 ? 1e300 : q;
      missed[i] = d == 0 && outside > missed[i] ? outside : missed[i];
      near[i] = from > near[i] ? from : near[i];
      far[i] = to < far[i] ? to : far[i];
      at[a][i] = static_cast<float>(o + d * (params.middle * params.step) - 0.5);
      step[a][i] = static_cast<float>(d * params.step);
      way[a][i] = d;
    }
    rays.at[a] = Lanes::load(at[a]);
    rays.step[a] = Lanes::load(step[a]);
  }
  for (int a = 0; a < 3; ++a) {
    const double(&reach)[3] = params.reach[a];
    for (int i = 0; i < n; ++i) {
      const double d = reach[0] * way[0][i] + reach[1] * way[1][i] + reach[2] * way[2][i];
      ahead[a][i] = d / length[i];
      half[a][i] = static_cast<double>(params.light[a]) - ahead[a][i];
      square[i] += half[a][i] * half[a][i];
    }
  }
  int32_t first[n], last[n];
  float lengths[n], unit[3][n], between[3][n];
  for (int i = 0; i < n; ++i) {
    const bool inside = missed[i] == 0 && near[i] <= far[i];
    const double k0 = inside ? std::ceil(near[i] / params.step) - params.middle : 1,
                 k1 = inside ? std::floor(far[i] / params.step) - params.middle : 0;
    first[i] = static_cast<int32_t>(k0), last[i] = static_cast<int32_t>(k1);
    lengths[i] = static_cast<float>(static_cast<double>(params.length) * length[i]);
  }
  for (int i = 0; i < n; ++i) {
    const double scale = square[i] > 0 ? 1 / std::sqrt(square[i]) : 0;
    for (int a = 0; a < 3; ++a) {
      unit[a][i] = static_cast<float>(ahead[a][i]);
      between[a][i] = static_cast<float>(half[a][i] * scale);
    }
  }
  rays.first = Lanes::load(first), rays.last = Lanes::load(last);
  rays.length = Lanes::load(lengths);
  rays.ahead = {Lanes::load(unit[0]), Lanes::load(unit[1]), Lanes::load(unit[2])};
  rays.half = {Lanes::load(between[0]), Lanes::load(between[1]), Lanes::load(between[2])};
}

/// Where the samples of a depth are.
template <class Lanes>
struct DvrPlaces {
  using Real = typename Lanes::Real;
  using Int = typename Lanes::Int;
  Real at[3];  ///< from the middle of voxel 0 on, not clamped
  Vec<Real> clamped;
  Int cell[3], brick[3];
  Int place;          ///< of the brick in the map of distances
  Int distance = {};  ///< to bricks that can be seen
};
template <class Lanes>
VOX_HD_HOT void locate(const DvrParams& params, const DvrRays<Lanes>& rays, float k,
                       DvrPlaces<Lanes>& found) {
  using Real = typename Lanes::Real;
  using Int = typename Lanes::Int;
  Real* const clamped[3] = {&found.clamped.x, &found.clamped.y, &found.clamped.z};
  for (int a = 0; a < 3; ++a) {
    const int64_t side = params.cast.dims[a];
    found.at[a] = rays.at[a] + rays.step[a] * k;
    *clamped[a] = Lanes::least(Lanes::greatest(found.at[a], Lanes::all(0.0f)),
                               Lanes::all(static_cast<float>(side - 1)));
    const Int cell = Lanes::to_int(*clamped[a]),
              most = Lanes::all(static_cast<int32_t>(side > 1 ? side - 2 : 0));
    found.cell[a] = cell > most ? most : cell;
    found.brick[a] = found.cell[a] >> dvr_brick_log2;
  }
  found.place = (found.brick[2] * params.slice + found.brick[1] * params.row) + found.brick[0];
}
/// How many samples more of each lane are certainly in bricks that cannot be seen, where `distance` > 0.
template <class Lanes>
VOX_HD_HOT auto unseen(const DvrParams& params, const DvrRays<Lanes>& rays,
                       const typename Lanes::Real (&inverse)[3], const DvrPlaces<Lanes>& found) {
  using Real = typename Lanes::Real;
  using Int = typename Lanes::Int;
  Real least = Lanes::all(16777216.0f);
  for (int a = 0; a < 3; ++a) {
    const Int lo = (found.brick[a] - found.distance + 1) << dvr_brick_log2,
              hi = (found.brick[a] + found.distance) << dvr_brick_log2;
    const Real plane =
        rays.step[a] < 0.0f ? Lanes::to_float(lo) + params.margin : Lanes::to_float(hi) - params.margin;
    least = Lanes::least((plane - found.at[a]) * inverse[a], least);
  }
  return Lanes::greatest(least, Lanes::all(0.0f));
}

/// A sample of each lane.
template <class Lanes>
struct DvrSamples {
  using Mask = typename Lanes::Mask;
  DvrPlaces<Lanes> place;
  Interpolated<typename Lanes::Real> here;
  Mask inside;  ///< the lane's ray is in the volume
  Mask taken;   ///< and not yet opaque, and in a brick that can be seen
};

/// Replaces gradients by those from neighbouring rays, and the other depth, where these determine one that is
/// not against that of the cell: a normal is never turned round. All gradients are times `unit` then, a power
/// of two.
template <class Lanes>
VOX_HD_HOT void use_neighbours(float shortest, float unit, DvrSamples<Lanes>& sample,
                               const DvrSamples<Lanes>& other) {
  using Real = typename Lanes::Real;
  const Vec<Real>& at = sample.place.clamped;
  const Real& value = sample.here.value;
  const auto beside = [](const auto& x) { return Lanes::beside(x); };
  const auto below = [](const auto& x) { return Lanes::below(x); };
  const Vec<Real> way[3] = {Vec<Real>{beside(at.x), beside(at.y), beside(at.z)} - at,
                            Vec<Real>{below(at.x), below(at.y), below(at.z)} - at, other.place.clamped - at};
  const Real difference[3] = {(beside(value) - value) * unit, (below(value) - value) * unit,
                              (other.here.value - value) * unit};
  const Solved<Real> solved = solve_gradient<Lanes>(way, difference, shortest);
  Vec<Real>& gradient = sample.here.gradient;
  gradient = {gradient.x * unit, gradient.y * unit, gradient.z * unit};
  const typename Lanes::Mask accepted = solved.accepted & (dot(solved.gradient, gradient) > 0.0f) &
                                        beside(sample.inside) & below(sample.inside) & sample.inside &
                                        other.inside;
  gradient.x = accepted ? solved.gradient.x : gradient.x;
  gradient.y = accepted ? solved.gradient.y : gradient.y;
  gradient.z = accepted ? solved.gradient.z : gradient.z;
}

/// Classifies, lights and blends a sample of each lane.
template <class Lanes, DvrGradient kind>
VOX_HD_HOT void blend_samples(const DvrParams& params, const DvrRays<Lanes>& rays,
                              const DvrSamples<Lanes>& sample, int32_t k, DvrPixels<Lanes>& pixels) {
  using Real = typename Lanes::Real;
  using Int = typename Lanes::Int;
  using Mask = typename Lanes::Mask;
  constexpr float last = TransferFunction::entries - 1;
  const Real& value = sample.here.value;
  const Real entry = Lanes::least(Lanes::greatest((value - params.first) * params.scale, Lanes::all(0.0f)),
                                  Lanes::all(last));
  const Mask wanted = sample.taken & (value - value == 0.0f);  // not NaN, nor infinite
  const Int at = Lanes::to_int(entry) << 2;
  const float* const table = params.table->rgb;
  Real density = Lanes::gather(table + 3, at, wanted);
  const Mask seen = density > 0.0f;
  if (Lanes::bits(seen) == 0) return;
  Real color[3];
  for (int i = 0; i < 3; ++i) color[i] = Lanes::gather(table + i, at, seen);
  Vec<Real> gradient;
  if constexpr (kind != DvrGradient::none) gradient = to_world(params, sample.here.gradient);
  if (kind != DvrGradient::none && params.modulate > 0) {
    const Real share = Lanes::least(Lanes::root(dot(gradient, gradient)) * params.modulate, Lanes::all(1.0f));
    const Real opacity = (1.0f - exp2_of_density<Lanes>(-density)) * share;
    density = -log2_of_share<Lanes>(Lanes::greatest(1.0f - opacity, Lanes::all(0x1p-126f)));
    density = seen ? density : Lanes::all(0.0f);
  }
  if (kind != DvrGradient::none && params.lit) {
    const Vec<float> light{params.light[0], params.light[1], params.light[2]};
    const Lit<Real> lit = light_sample<Lanes>(gradient, light, rays.half, rays.ahead, params.flat);
    for (Real& c : color) c = c * lit.diffuse + lit.specular;
  }
  const Real through = pixels.through * exp2_of_density<Lanes>(-density * rays.length);
  const Real weight = pixels.through - through;
  for (int i = 0; i < 3; ++i) {
    const Real more = pixels.color[i] + weight * color[i];
    pixels.color[i] = seen ? more : pixels.color[i];
  }
  pixels.through = seen ? through : pixels.through;
  const Mask shown = density > 0.0f;
  pixels.first = pixels.hit ? pixels.first : Lanes::all(k);
  pixels.hit = pixels.hit | shown;
}

/// Follows the rays of a packet until all have left the volume or are opaque; `pixels` is as it is made.
/// `sampler` has the voxels around samples, and is told when a packet begins.
template <class Lanes, class Sampler, DvrGradient kind>
VOX_HD_HOT void march(const DvrParams& params, Sampler& sampler, int x, int y, DvrPixels<Lanes>& pixels) {
  using Real = typename Lanes::Real;
  using Int = typename Lanes::Int;
  using Mask = typename Lanes::Mask;
  // Neighbouring depths come in pairs, as a gradient needs both.
  constexpr int depths = kind == DvrGradient::neighbour ? 2 : 1;
  constexpr bool with_gradient = kind != DvrGradient::none;
  constexpr float transparent = 1 - opaque;
  DvrRays<Lanes> rays;
  begin_rays(params, x, y, rays);
  sampler.begin();
  Mask alive = rays.first <= rays.last;
  if (Lanes::bits(alive) == 0) return;
  Real inverse[3];
  for (int a = 0; a < 3; ++a) {
    const Real tiny = Lanes::all(1e-12f), way = rays.step[a];
    inverse[a] = 1.0f / (way < 0.0f ? Lanes::least(way, -tiny) : Lanes::greatest(way, tiny));
  }
  const Int never = Lanes::all(INT32_MAX);
  // Samples are fetched for rays that were not opaque a step earlier, so that no step waits for the one
  // before it.
  Mask awaited = alive;
  int32_t k = Lanes::least_lane(alive ? rays.first : never) & -depths;
  for (;;) {
    DvrSamples<Lanes> samples[depths];
    Mask wanted = {};
    for (int i = 0; i < depths; ++i) {
      DvrSamples<Lanes>& s = samples[i];
      s.inside = (rays.first <= k + i) & (rays.last >= k + i);
      locate<Lanes>(params, rays, static_cast<float>(k + i), s.place);
      s.taken = awaited & s.inside;
      if (params.distances != nullptr) {
        s.place.distance = Lanes::gather(params.distances, s.place.place, s.taken);
        s.taken = s.taken & (s.place.distance == 0);
      }
      wanted = wanted | s.taken;
    }
    pixels.bricks += depths;
    if (Lanes::bits(wanted) == 0) {
      // On to where a ray enters, or may see something.
      const DvrSamples<Lanes>& s = samples[depths - 1];
      const int32_t here = k + depths - 1;
      Int next = Lanes::all(here + 1);
      if (params.distances != nullptr)
        next = s.inside ? next + Lanes::to_int(unseen<Lanes>(params, rays, inverse, s.place)) : next;
      next = rays.first > here ? rays.first : next;
      const Mask goes_on = alive & (rays.last >= next);
      const int32_t to = Lanes::least_lane(goes_on ? next : never);
      if (to == INT32_MAX) return;
      k = to & -depths;
      awaited = alive;
      continue;
    }
    for (int i = 0; i < depths; ++i) {
      DvrSamples<Lanes>& s = samples[i];
      Real corners[8];
      const DvrPlaces<Lanes>& p = s.place;
      sampler.template fetch<Lanes>(p, depths > 1 ? s.inside : s.taken, corners);
      const Vec<Real> within = {p.clamped.x - Lanes::to_float(p.cell[0]),
                                p.clamped.y - Lanes::to_float(p.cell[1]),
                                p.clamped.z - Lanes::to_float(p.cell[2])};
      s.here = interpolate<with_gradient>(corners, within);
    }
    if constexpr (depths > 1) {
      const DvrSamples<Lanes> first = samples[0];
      use_neighbours<Lanes>(params.shortest, params.unit, samples[0], samples[1]);
      use_neighbours<Lanes>(params.shortest, params.unit, samples[1], first);
    }
    awaited = alive;
    for (int i = 0; i < depths; ++i) {
      DvrSamples<Lanes>& s = samples[i];
      s.taken = s.taken & alive;
      pixels.samples = s.taken ? pixels.samples + 1 : pixels.samples;
      blend_samples<Lanes, kind>(params, rays, s, k + i, pixels);
      alive = alive & (pixels.through > transparent);
    }
    k += depths;
  }
}

/// What lane i of this thread, the pixel (x, y), found. `detail`: the samples, and where the first one that
/// was seen is if that is asked for and there is one.
template <class Lanes>
VOX_HD_HOT void finish_pixel(const DvrParams& params, const DvrPixels<Lanes>& found, int i, int x, int y,
                             bool where, Pixel& pixel, PixelDetail& detail) {
  for (int c = 0; c < 3; ++c) pixel.color[c] = Lanes::get(found.color[c], i);
  pixel.color[3] = 1 - Lanes::get(found.through, i);
  pixel.distance = __builtin_inff();
  detail = {};
  detail.cells = static_cast<uint32_t>(Lanes::get(found.samples, i));
  if (!Lanes::get(found.hit, i)) return;
  const CastParams& cast = params.cast;
  const double t = (Lanes::get(found.first, i) + params.middle) * params.step;
  pixel.distance = static_cast<float>(t * world_length(cast, x, y));
  if (!where) return;
  const PixelRay ray = ray_through(cast, x, y);
  for (int a = 0; a < 3; ++a) {
    const double v = std::floor(cast.origin[a] + ray.direction[a] * t);
    const double most = static_cast<double>(cast.dims[a] - 1);
    detail.voxel[a] = static_cast<int32_t>(v < 0 ? 0 : v > most ? most : v);
  }
}

}  // namespace voxkit::render
