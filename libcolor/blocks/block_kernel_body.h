// The body of the inner loops, compiled for each kind of machine by the files that include this one. It has
// no include guard and no functions but static ones, so that no code for one kind is called by another.
//
// VOXKIT_CODE: attributes of all functions.

using Floats = float __attribute__((vector_size(32)));
using Ints = int32_t __attribute__((vector_size(32)));
constexpr uint32_t lanes = 8;

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

VOXKIT_CODE static Extent extent_of(const ColorRun& run, const std::array<float, 3>& axis) {
  const Floats x = fill(axis[0]), y = fill(axis[1]), z = fill(axis[2]);
  Floats lo = fill(3e38f), hi = fill(-3e38f);
  for (uint32_t i = 0; i < run.size; i += lanes) {
    const Floats t =
        load(run.channels[0] + i) * x + load(run.channels[1] + i) * y + load(run.channels[2] + i) * z;
    const Ints in = inside(i, run.size);
    lo = in ? least(lo, t) : lo;
    hi = in ? greatest(hi, t) : hi;
  }
  Extent extent{lo[0], hi[0]};
  for (uint32_t i = 1; i < lanes; ++i) {
    extent.least = lo[i] < extent.least ? lo[i] : extent.least;
    extent.most = hi[i] > extent.most ? hi[i] : extent.most;
  }
  return extent;
}

VOXKIT_CODE static Distances distances_of(const ColorRun& run, const std::array<float, 3>& a,
                                          const std::array<float, 3>& b, int most_weight, uint32_t allowed,
                                          uint8_t* weights) {
  const float dr = b[0] - a[0], dg = b[1] - a[1], db = b[2] - a[2];
  const float length = dr * dr + dg * dg + db * db;
  const auto most = static_cast<float>(most_weight);
  const Floats ar = fill(a[0]), ag = fill(a[1]), ab = fill(a[2]);
  const Floats vr = fill(dr), vg = fill(dg), vb = fill(db);
  const Floats scale = fill(length > 0 ? most / length : 0), top = fill(most), zero = fill(0),
               step = fill(1 / most);
  const auto limit = static_cast<float>(allowed);
  Distances found{0, 0};
  // Sums of so many vectors are exact.
  constexpr uint32_t batch = 64 * lanes;
  for (uint32_t first = 0; first < run.size; first += batch) {
    Floats far = zero, sum = zero;
    const uint32_t last = run.size - first < batch ? run.size : first + batch;
    for (uint32_t i = first; i < last; i += lanes) {
      const Floats r = load(run.channels[0] + i), g = load(run.channels[1] + i),
                   c = load(run.channels[2] + i);
      const Floats along = (r - ar) * vr + (g - ag) * vg + (c - ab) * vb;
      const Floats w = least(greatest(rounded(along * scale), zero), top);
      // (a * (most - w) + b * w) / most, which is never halfway between two whole numbers.
      const Floats er = rounded((ar * top + vr * w) * step) - r, eg = rounded((ag * top + vg * w) * step) - g,
                   ec = rounded((ab * top + vb * w) * step) - c;
      Floats d = er * er + eg * eg + ec * ec;
      d = inside(i, last) ? d : zero;
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
