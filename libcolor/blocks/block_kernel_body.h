// The body of the inner loops, compiled for each kind of machine by the files that include this one. It has
// no include guard and no functions but static ones, so that no code for one kind is called by another.
//
// VOXKIT_CODE: attributes of all functions. VOXKIT_ANY(mask): whether any lane of a comparison is true.

using Floats = float __attribute__((vector_size(32)));
using Ints = int32_t __attribute__((vector_size(32)));
constexpr uint32_t lanes = color_vector;

#define VOXKIT_INLINE VOXKIT_CODE [[gnu::always_inline]] static inline

VOXKIT_INLINE Floats load(const float* from) {
  Floats v;
  __builtin_memcpy(&v, from, sizeof v);
  return v;
}
VOXKIT_INLINE Floats fill(float x) {
  return Floats{x, x, x, x, x, x, x, x};
}
VOXKIT_INLINE Floats least(Floats a, Floats b) {
  return a < b ? a : b;
}
VOXKIT_INLINE Floats greatest(Floats a, Floats b) {
  return a > b ? a : b;
}
/// To the nearest whole number, for numbers far below 2^22.
VOXKIT_INLINE Floats rounded(Floats a) {
  const Floats magic = fill(12582912.0f);
  return (a + magic) - magic;
}
/// The lanes of a vector that begins at `at` which are inside a run.
VOXKIT_INLINE Ints inside(uint32_t at, uint32_t size) {
  const auto left = static_cast<int32_t>(size - at);
  return Ints{0, 1, 2, 3, 4, 5, 6, 7} < Ints{left, left, left, left, left, left, left, left};
}

VOXKIT_INLINE Floats along(const ColorRun& run, uint32_t i, Floats x, Floats y, Floats z) {
  return load(run.channels[0] + i) * x + load(run.channels[1] + i) * y + load(run.channels[2] + i) * z;
}

VOXKIT_INLINE Extent extent_along(const ColorRun& run, const std::array<float, 3>& axis) {
  const Floats x = fill(axis[0]), y = fill(axis[1]), z = fill(axis[2]);
  Floats lo = fill(3e38f), hi = fill(-3e38f);
  uint32_t i = 0;
  for (; i + lanes <= run.size; i += lanes) {
    const Floats t = along(run, i, x, y, z);
    lo = least(lo, t);
    hi = greatest(hi, t);
  }
  if (i < run.size) {
    const Floats t = along(run, i, x, y, z);
    const Ints in = inside(i, run.size);
    lo = in ? least(lo, t) : lo;
    hi = in ? greatest(hi, t) : hi;
  }
  Extent extent{lo[0], hi[0]};
  for (uint32_t k = 1; k < lanes; ++k) {
    extent.least = lo[k] < extent.least ? lo[k] : extent.least;
    extent.most = hi[k] > extent.most ? hi[k] : extent.most;
  }
  return extent;
}
VOXKIT_CODE static Extent extent_of(const ColorRun& run, const std::array<float, 3>& axis) {
  return extent_along(run, axis);
}

/// Steps from one colour to another.
struct Steps {
  Floats r, g, b;     ///< the first
  Floats vr, vg, vb;  ///< from there to the last
  Floats scale, top, step;
};
VOXKIT_INLINE Steps steps_between(float r, float g, float b, float r1, float g1, float b1, int most_weight) {
  const float vr = r1 - r, vg = g1 - g, vb = b1 - b;
  const float length = vr * vr + vg * vg + vb * vb;
  const auto most = static_cast<float>(most_weight);
  return {
      fill(r),    fill(g),       fill(b), fill(vr), fill(vg), fill(vb), fill(length > 0 ? most / length : 0),
      fill(most), fill(1 / most)};
}
/// Squared distances of the colours from i on from the steps that are nearest along the line, `w`.
VOXKIT_INLINE Floats distances_at(const ColorRun& run, uint32_t i, const Steps& s, Floats& w) {
  const Floats r = load(run.channels[0] + i), g = load(run.channels[1] + i), b = load(run.channels[2] + i);
  const Floats t = (r - s.r) * s.vr + (g - s.g) * s.vg + (b - s.b) * s.vb;
  w = least(greatest(rounded(t * s.scale), fill(0)), s.top);
  // (a * (most - w) + b * w) / most, which is never halfway between two whole numbers.
  const Floats er = rounded((s.r * s.top + s.vr * w) * s.step) - r,
               eg = rounded((s.g * s.top + s.vg * w) * s.step) - g,
               eb = rounded((s.b * s.top + s.vb * w) * s.step) - b;
  return er * er + eg * eg + eb * eb;
}

VOXKIT_CODE static Distances distances_of(const ColorRun& run, const std::array<float, 3>& a,
                                          const std::array<float, 3>& b, int most_weight, uint32_t allowed,
                                          uint8_t* weights) {
  const Steps steps = steps_between(a[0], a[1], a[2], b[0], b[1], b[2], most_weight);
  const auto limit = static_cast<float>(allowed);
  Distances found{0, 0};
  // Sums of so many vectors are exact.
  constexpr uint32_t batch = 64 * lanes;
  for (uint32_t first = 0; first < run.size; first += batch) {
    Floats far = fill(0), sum = fill(0);
    const uint32_t last = run.size - first < batch ? run.size : first + batch;
    for (uint32_t i = first; i < last; i += lanes) {
      Floats w;
      const Floats all = distances_at(run, i, steps, w), d = inside(i, last) ? all : fill(0);
      far = greatest(far, d);
      sum = sum + d;
      if (weights != nullptr)
        for (uint32_t k = 0; k < lanes; ++k) weights[i + k] = static_cast<uint8_t>(w[k]);
    }
    float furthest = 0;
    for (uint32_t k = 0; k < lanes; ++k) {
      furthest = far[k] > furthest ? far[k] : furthest;
      found.sum += static_cast<uint64_t>(sum[k]);
    }
    if (furthest > static_cast<float>(found.most)) found.most = static_cast<uint32_t>(furthest);
    if (furthest > limit) break;
  }
  return found;
}

VOXKIT_CODE static bool within_of(const ColorRun& run, const std::array<float, 3>& color, uint32_t allowed) {
  const Floats r = fill(color[0]), g = fill(color[1]), b = fill(color[2]),
               limit = fill(static_cast<float>(allowed));
  for (uint32_t i = 0; i < run.size; i += lanes) {
    const Floats er = load(run.channels[0] + i) - r, eg = load(run.channels[1] + i) - g,
                 eb = load(run.channels[2] + i) - b;
    if (VOXKIT_ANY((er * er + eg * eg + eb * eb > limit) & inside(i, run.size))) return false;
  }
  return true;
}

/// Ends of four tries in one channel, 0 to 255, as they are stored with so many bits.
VOXKIT_INLINE Floats stored_ends(Floats v, int bits) {
  const float most = bits == 8 ? 255 : bits == 6 ? 63 : 31;
  const Floats scaled = least(greatest(v, fill(0)), fill(255)) * fill(most / 255.0f) + fill(0.5f);
  Ints whole = __builtin_convertvector(scaled, Ints);
  if (bits != 8) whole = whole << (8 - bits) | whole >> (2 * bits - 8);
  return __builtin_convertvector(whole, Floats);
}

/// Whether all colours are within the limit; if not, `witness` is the vector with one that is not.
VOXKIT_INLINE bool all_within(const ColorRun& run, const Steps& steps, Floats limit, uint32_t& witness,
                              uint64_t& squared_error) {
  Floats w;
  // What was too far before is likely to be so again.
  if (run.size > 2 * lanes &&
      VOXKIT_ANY((distances_at(run, witness, steps, w) > limit) & inside(witness, run.size)))
    return false;
  Ints sum = {};  // of up to 2^11 numbers below 2^18
  uint32_t i = 0;
  for (; i + lanes <= run.size; i += lanes) {
    const Floats d = distances_at(run, i, steps, w);
    if (VOXKIT_ANY(d > limit)) {
      witness = i;
      return false;
    }
    sum += __builtin_convertvector(d, Ints);
  }
  if (i < run.size) {
    const Floats all = distances_at(run, i, steps, w), d = inside(i, run.size) ? all : fill(0);
    if (VOXKIT_ANY(d > limit)) {
      witness = i;
      return false;
    }
    sum += __builtin_convertvector(d, Ints);
  }
  squared_error = 0;
  for (uint32_t k = 0; k < lanes; ++k) squared_error += static_cast<uint32_t>(sum[k]);
  return true;
}

VOXKIT_CODE static LineFit line_of(const ColorRun& run, const LineTries& line, int most_weight,
                                   uint32_t allowed) {
  const Extent extent = extent_along(run, line.axis);
  const float lo = extent.least - line.center, hi = extent.most - line.center;
  const float half_cell = (hi - lo) / static_cast<float>(2 * (most_weight + 1));
  const bool small = line.endpoints == Endpoints::rgb565;
  const Floats limit = fill(static_cast<float>(allowed));
  uint32_t witness = (run.size - 1) / lanes * lanes;
  LineFit fit;
  for (int first = 0; first < line.tries; first += 4) {
    // Four tries at once: their first ends, then their last ones.
    const float* const inset = line_insets + 2 * first;
    const Floats t = Floats{lo, lo, lo, lo, hi, hi, hi, hi} + load(inset) * fill(half_cell);
    const Floats r = stored_ends(fill(line.mean[0]) + t * fill(line.axis[0]), small ? 5 : 8),
                 g = stored_ends(fill(line.mean[1]) + t * fill(line.axis[1]), small ? 6 : 8),
                 b = stored_ends(fill(line.mean[2]) + t * fill(line.axis[2]), small ? 5 : 8);
    for (int i = 0; i < 4 && first + i < line.tries; ++i) {
      const int j = i + 4;
      if (!all_within(run, steps_between(r[i], g[i], b[i], r[j], g[j], b[j], most_weight), limit, witness,
                      fit.squared_error))
        continue;
      fit.feasible = true;
      fit.a = {static_cast<uint8_t>(r[i]), static_cast<uint8_t>(g[i]), static_cast<uint8_t>(b[i])};
      fit.b = {static_cast<uint8_t>(r[j]), static_cast<uint8_t>(g[j]), static_cast<uint8_t>(b[j])};
      return fit;
    }
  }
  return fit;
}

VOXKIT_CODE static Distances nearest_of(const ColorRun& run, const std::array<float, 3>* steps, int count,
                                        uint32_t allowed, uint8_t* weights) {
  Distances found{0, 0};
  // Before going on, whether that is worth it.
  constexpr uint32_t batch = 8 * lanes;
  for (uint32_t first = 0; first < run.size; first += batch) {
    Floats far = fill(0), sum = fill(0);
    const uint32_t last = run.size - first < batch ? run.size : first + batch;
    for (uint32_t i = first; i < last; i += lanes) {
      const Floats x = load(run.channels[0] + i), y = load(run.channels[1] + i),
                   z = load(run.channels[2] + i);
      Floats best = fill(3e38f), w = fill(0);
      for (int k = 0; k < count; ++k) {
        const Floats dx = x - fill(steps[k][0]), dy = y - fill(steps[k][1]), dz = z - fill(steps[k][2]);
        const Floats d = dx * dx + dy * dy + dz * dz;
        w = d < best ? fill(static_cast<float>(k)) : w;
        best = least(d, best);
      }
      const Floats d = inside(i, last) ? best : fill(0);
      far = greatest(far, d);
      sum = sum + d;
      if (weights != nullptr)
        for (uint32_t k = 0; k < lanes; ++k) weights[i + k] = static_cast<uint8_t>(w[k]);
    }
    float furthest = 0;
    for (uint32_t k = 0; k < lanes; ++k) {
      furthest = far[k] > furthest ? far[k] : furthest;
      found.sum += static_cast<uint64_t>(sum[k]);
    }
    auto whole = static_cast<uint32_t>(furthest);
    if (static_cast<float>(whole) < furthest) ++whole;
    if (whole > found.most) found.most = whole;
    if (whole > allowed) break;
  }
  return found;
}
