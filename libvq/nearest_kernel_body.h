// The inner loops of the search, written once. To be included by one file for each kind of machine, within a
// namespace of its own, after these:
//
//   VOXKIT_CODE         what marks a function as code for that machine
//   Vector              `lanes` numbers of 32 bits
//   load, fill          from memory; the same number in all lanes
//   add, subtract       modulo 2^32
//   add_products        to each lane, the two products of the 16-bit halves of two others
//   difference          of the halves
//   gap                 of the halves: how far outside [least, most], 0 inside
//   sign_mask           one bit for each lane: whether its highest bit is set
//   compress            stores the lanes whose bits are set, one after the other, and anything behind them
//   sum                 of the lanes
//
// No include guard: see above.

VOXKIT_CODE inline void near_box(const KeyBox& box, int32_t reach, const QueryRows& in, QueryRows& out) {
  Vector least[coarse_pairs], most[coarse_pairs];
  for (int j = 0; j < coarse_pairs; ++j) {
    least[j] = fill(key_pair(box.least, j));
    most[j] = fill(key_pair(box.most, j));
  }
  out.make_room(in.size);
  size_t kept = 0;
  for (size_t q = 0; q < in.size; q += lanes) {
    Vector pairs[coarse_pairs];
    Vector distance = fill(0);
    for (int j = 0; j < coarse_pairs; ++j) {
      pairs[j] = load(in.pairs[j].data() + q);
      const Vector outside = gap(pairs[j], least[j], most[j]);
      distance = add_products(distance, outside, outside);
    }
    // Less than 2^31, or too far anyway: corners of a box may be further apart than any bricks.
    const Vector own = load(in.reach.data() + q);
    uint32_t mask = sign_mask(subtract(distance, add(fill(reach), own)));
    if (in.size - q < lanes) mask &= (1u << (in.size - q)) - 1;
    if (mask == 0) continue;
    for (int j = 0; j < coarse_pairs; ++j) compress(mask, pairs[j], out.pairs[j].data() + kept);
    compress(mask, own, out.reach.data() + kept);
    compress(mask, load(in.number.data() + q), out.number.data() + kept);
    kept += static_cast<size_t>(__builtin_popcount(mask));
  }
  out.size = kept;
}

// |x|^2 - 2 x q + |q|^2 less the reaches: what is negative is near. The true sum fits 32 bits, so that it
// does not matter if parts of it do not.
VOXKIT_CODE inline void near_bricks(const Leaf& leaf, const uint32_t* edges, const QueryKey* queries,
                                    const uint32_t* numbers, size_t count, uint32_t* masks) {
  constexpr int vectors = leaf_bricks / lanes;
  // Two at a time, so that what is loaded of the leaf is used twice.
  for (size_t k = 0; k < count; k += 2) {
    const QueryKey& a = queries[numbers[k]];
    const QueryKey& b = queries[numbers[k + 1 < count ? k + 1 : k]];
    uint32_t mask_a = 0, mask_b = 0;
    constexpr int at_once = vectors < 4 ? vectors : 4;  // as many as there are registers for
    for (int v = 0; v < vectors; v += at_once) {
      Vector sum_a[at_once], sum_b[at_once];
      for (int i = 0; i < at_once; ++i) {
        const Vector edge = load(edges + (v + i) * lanes);
        sum_a[i] = add(edge, fill(a.edge));
        sum_b[i] = add(edge, fill(b.edge));
      }
#pragma GCC unroll 8  // with 16, g++ holds the leaf in more registers than there are
      for (int j = 0; j < fine_pairs; ++j) {
        const Vector pair_a = fill(a.doubled[j]), pair_b = fill(b.doubled[j]);
        for (int i = 0; i < at_once; ++i) {
          const Vector pairs = load(leaf[j].data() + (v + i) * lanes);
          sum_a[i] = add_products(sum_a[i], pairs, pair_a);
          sum_b[i] = add_products(sum_b[i], pairs, pair_b);
        }
      }
      for (int i = 0; i < at_once; ++i) {
        mask_a |= sign_mask(sum_a[i]) << ((v + i) * lanes);
        mask_b |= sign_mask(sum_b[i]) << ((v + i) * lanes);
      }
    }
    masks[k] = mask_a;
    masks[k + 1] = mask_b;
  }
}

VOXKIT_CODE inline void distances_narrow(const Brick* bricks, uint32_t mask, const Brick& brick,
                                         uint64_t* out) {
  constexpr int vectors = brick_voxels / 2 / lanes;
  Vector other[vectors];
  for (int i = 0; i < vectors; ++i) other[i] = load(brick.data() + 2 * i * lanes);
  for (; mask != 0; mask &= mask - 1) {
    const int bit = __builtin_ctz(mask);
    Vector squares = fill(0);
    for (int i = 0; i < vectors; ++i) {
      const Vector apart = difference(load(bricks[bit].data() + 2 * i * lanes), other[i]);
      squares = add_products(squares, apart, apart);
    }
    out[bit] = sum(squares);
  }
}

VOXKIT_CODE inline void distances_wide(const Brick* bricks, uint32_t mask, const Brick& brick,
                                       uint64_t* out) {
  for (; mask != 0; mask &= mask - 1) {
    const int bit = __builtin_ctz(mask);
    uint64_t squares = 0;
    for (int v = 0; v < brick_voxels; ++v) {
      const uint32_t apart = static_cast<uint32_t>(bricks[bit][v]) - brick[v];
      squares += apart * apart;  // modulo 2^32 it is the square of the true difference, which fits
    }
    out[bit] = squares;
  }
}

inline constexpr Kernels narrow_kernels{near_box, near_bricks, distances_narrow};
inline constexpr Kernels wide_kernels{near_box, near_bricks, distances_wide};
