#include "libvq/rbuc.h"

#include <algorithm>
#include <bit>

#include "formats/cpu.h"
#include "libvq/rbuc_avx2.h"

namespace voxkit::vq {
namespace {

/// The residuals of all transforms, in raster order.
struct Residuals {
  uint16_t of[transforms][brick_voxels];
};

/// All ones for voxels that have a neighbour below along an axis.
struct InsideMasks {
  uint16_t x[brick_voxels], y[brick_voxels], z[brick_voxels];
};
constexpr InsideMasks inside = [] {
  InsideMasks m{};
  for (int i = 0; i < brick_voxels; ++i) {
    m.x[i] = i & 3 ? 0xffff : 0;
    m.y[i] = i & 12 ? 0xffff : 0;
    m.z[i] = i & 48 ? 0xffff : 0;
  }
  return m;
}();

/// Since all voxels are known, the loops have no order: compilers turn them into vector code.
[[gnu::always_inline]] inline void transform_all(const Brick& brick, BrickRange range, Residuals& out) {
  constexpr int before = 21;  // as far back as predictors look
  const uint32_t top = static_cast<uint32_t>(range.max - range.min);
  uint16_t padded[before + brick_voxels] = {};
  uint16_t* const u = padded + before;
  for (int i = 0; i < brick_voxels; ++i)
    u[i] = static_cast<uint16_t>(brick[static_cast<size_t>(i)] - range.min);
  for (int i = 0; i < brick_voxels; ++i) {
    const unsigned x = inside.x[i], y = inside.y[i], z = inside.z[i];
    const uint32_t a = u[i - 1] & x, b = u[i - 4] & y, c = u[i - 16] & z;
    const uint32_t ab = u[i - 5] & x & y, ac = u[i - 17] & x & z, bc = u[i - 20] & y & z;
    const uint32_t previous = a | (b & ~x) | (c & ~x & ~y);
    const uint32_t xy = plane(a, b, ab, top), xz = plane(a, c, ac, top), yz = plane(b, c, bc, top);
    const uint32_t middle = median(xy, xz, yz), face = !z ? xy : !y ? xz : !x ? yz : middle;
    out.of[0][i] = u[i];
    out.of[1][i] = static_cast<uint16_t>(fold_modulo(u[i], previous, top));
    out.of[2][i] = static_cast<uint16_t>(fold_modulo(u[i], middle, top));
    out.of[3][i] = static_cast<uint16_t>(fold_bounded(u[i], face, top));
  }
}
void transform_all_generic(const Brick& brick, BrickRange range, Residuals& out) {
  transform_all(brick, range, out);
}
#ifdef VOXKIT_AVX2
VOXKIT_AVX2_CODE void transform_all_avx2(const Brick& brick, BrickRange range, Residuals& out) {
  transform_all(brick, range, out);
}
const auto transform_all_here = has_avx2() ? transform_all_avx2 : transform_all_generic;
const auto decode_codeword_here = has_avx2() ? decode_codeword_avx2 : decode_codeword_portable;
const auto decode_plain_here = has_avx2() ? decode_plain_avx2 : decode_plain_portable;
#else
constexpr auto transform_all_here = transform_all_generic;
constexpr auto decode_codeword_here = decode_codeword_portable;
constexpr auto decode_plain_here = decode_plain_portable;
#endif

/// The widths of the octants' residuals, and the bytes of the codeword.
struct Plan {
  int c1[8], c2, length;
};
Plan plan_codeword(const uint16_t* residuals) {
  Plan p;
  int widest = 0, sum = 0;
  for (uint32_t octant = 0; octant < 8; ++octant) {
    uint32_t all = 0;
    for (uint32_t pair = 0; pair < 8; pair += 2)  // two voxels along x at a time
      all |= load_le<uint32_t>(reinterpret_cast<const std::byte*>(residuals + octant_voxel(octant, pair)));
    p.c1[octant] = std::bit_width((all | all >> 16) & 0xffff);
    widest = std::max(widest, p.c1[octant]);
    sum += p.c1[octant];
  }
  p.c2 = std::bit_width(static_cast<unsigned>(widest));
  p.length = 1 + p.c2 + sum;
  return p;
}

}  // namespace

int encode_codeword(const Brick& brick, BrickRange range, std::byte* bytes) {
  Residuals residuals;
  transform_all_here(brick, range, residuals);
  int best = 0;
  Plan plan = plan_codeword(residuals.of[0]);
  for (int t = 1; t < transforms; ++t)
    if (const Plan other = plan_codeword(residuals.of[t]); other.length < plan.length) {
      best = t;
      plan = other;
    }
  bytes[0] = static_cast<std::byte>(plan.c2 | best << 6);
  uint64_t widths = 0;
  for (int octant = 0; octant < 8; ++octant)
    widths |= static_cast<uint64_t>(plan.c1[octant]) << (octant * plan.c2);
  store_le(bytes + 1, widths);
  std::byte* at = bytes + 1 + plan.c2;
  for (uint32_t octant = 0; octant < 8; ++octant) {
    uint16_t values[8];
    for (uint32_t i = 0; i < 8; ++i) values[i] = residuals.of[best][octant_voxel(octant, i)];
    pack8(values, plan.c1[octant], at);
    at += plan.c1[octant];
  }
  return plan.length;
}

void encode_plain(const Brick& brick, uint32_t base, int bits, std::byte* bytes) {
  uint16_t row[8];
  for (size_t at = 0; at < brick.size(); at += 8, bytes += bits) {
    for (size_t i = 0; i < 8; ++i) row[i] = static_cast<uint16_t>(brick[at + i] - base);
    pack8(row, bits, bytes);
  }
}

bool decode_plain(const std::byte* bytes, int bits, BrickRange range, uint16_t* voxels) {
  return decode_plain_here(bytes, bits, range, voxels);
}
bool decode_codeword(const std::byte* codeword, uint32_t available, int bits, BrickRange range,
                     uint16_t* voxels) {
  return decode_codeword_here(codeword, available, bits, range, voxels);
}

int codeword_length(const std::byte* codeword, uint32_t available, int bits) {
  const auto head = static_cast<uint32_t>(codeword[0]);
  uint32_t length = 1;
  if (head == escape) {
    length += static_cast<uint32_t>(plain_bytes(bits));
  } else {
    const uint32_t c2 = head & 63;
    if (c2 > 5) return 0;
    length += c2;
    for (uint32_t octant = 0; octant < 8; ++octant) {
      const uint32_t c1 = load_bits(codeword + 1, octant * c2, static_cast<int>(c2));
      if (c1 > 16) return 0;
      length += c1;
    }
  }
  return length <= available ? static_cast<int>(length) : 0;
}

}  // namespace voxkit::vq
