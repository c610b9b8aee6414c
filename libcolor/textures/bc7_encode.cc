#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "formats/little_endian.h"
#include "libcolor/textures/bc7.h"
#include "libcolor/textures/bc7_modes.h"

namespace voxkit::color {
namespace {

using bc7::Mode;
using Color = std::array<float, 3>;
using Channels = std::array<std::array<float, 16>, 3>;

/// The pixels of a subset, channel by channel; what is computed of them exactly is whole and below 2^24.
struct Subset {
  uint32_t count = 0;
  std::array<uint8_t, 16> pixels{};
  Channels v{};
};

Subset subset_of(const Channels& v, int subsets, uint32_t partition, uint32_t number) {
  Subset s;
  for (uint32_t i = 0; i < 16; ++i)
    if (bc7::subset_of(subsets, partition, i) == number) {
      for (size_t k = 0; k < 3; ++k) s.v[k][s.count] = v[k][i];
      s.pixels[s.count++] = static_cast<uint8_t>(i);
    }
  return s;
}

/// The mean of some colours, and the axis on which they differ most, of length 1; or of 0, if they do not
/// differ.
struct Line {
  Color mean{}, axis{};
};
Line line_of(const Subset& s) {
  Line line;
  const auto count = static_cast<float>(s.count);
  for (size_t k = 0; k < 3; ++k) {
    for (size_t i = 0; i < s.count; ++i) line.mean[k] += s.v[k][i];
    line.mean[k] /= count;
  }
  float m[3][3] = {};
  for (size_t i = 0; i < s.count; ++i) {
    float d[3];
    for (size_t k = 0; k < 3; ++k) d[k] = s.v[k][i] - line.mean[k];
    for (size_t j = 0; j < 3; ++j)
      for (size_t k = j; k < 3; ++k) m[j][k] += d[j] * d[k];
  }
  m[1][0] = m[0][1], m[2][0] = m[0][2], m[2][1] = m[1][2];
  size_t widest = 0;
  for (size_t k = 1; k < 3; ++k)
    if (m[k][k] > m[widest][widest]) widest = k;
  Color axis = {m[widest][0], m[widest][1], m[widest][2]};
  for (int round = 0; round < 4; ++round) {
    const float length = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    if (!(length > 0)) return line;
    for (float& a : axis) a /= length;
    line.axis = axis;
    for (size_t j = 0; j < 3; ++j)
      axis[j] = m[j][0] * line.axis[0] + m[j][1] * line.axis[1] + m[j][2] * line.axis[2];
  }
  return line;
}

/// Both ends as they are stored, and what stands for each pixel.
struct Coding {
  std::array<std::array<int, 3>, 2> end{};
  std::array<int, 2> lowest{};
  std::array<uint8_t, 16> index{};  ///< of pixels of the subset
  float error = 1e30f;
};

/// Codes subsets in one mode.
class Coder {
 public:
  explicit Coder(const Mode& mode) : mode_(mode), bits_(mode.color_bits + (mode.has_p() ? 1 : 0)) {}

  /// From the outermost colours on the line; then fits and nearest colours in turns.
  Coding code(const Subset& s, const Line& line, int rounds) const {
    float lo = 0, hi = 0;
    for (size_t i = 0; i < s.count; ++i) {
      float t = 0;
      for (size_t k = 0; k < 3; ++k) t += line.axis[k] * (s.v[k][i] - line.mean[k]);
      lo = std::min(lo, t);
      hi = std::max(hi, t);
    }
    std::array<Color, 2> ends;
    for (size_t k = 0; k < 3; ++k) {
      ends[0][k] = line.mean[k] + lo * line.axis[k];
      ends[1][k] = line.mean[k] + hi * line.axis[k];
    }
    Coding best;
    for (int round = 0; round <= rounds; ++round) {
      if (!improve(s, quantised(ends), best) || best.error == 0) break;
      if (round < rounds && !fit(s, best, ends)) break;
    }
    return best;
  }
  /// Single steps of single channels and lowest bits, as long as they help, some rounds.
  void polish(const Subset& s, Coding& best, int rounds) const {
    const int most = (1 << mode_.color_bits) - 1;
    for (int round = 0; round < rounds && best.error > 0; ++round) {
      bool moved = false;
      for (size_t e = 0; e < 2; ++e) {
        for (size_t k = 0; k < 3; ++k)
          for (const int step : {-1, 1}) {
            Coding next = best;
            next.end[e][k] += step;
            if (next.end[e][k] >= 0 && next.end[e][k] <= most) moved |= improve(s, next, best);
          }
        if (!mode_.has_p() || (mode_.shared_p != 0 && e == 1)) continue;
        Coding next = best;
        next.lowest[e] ^= 1;
        if (mode_.shared_p != 0) next.lowest[1] ^= 1;
        moved |= improve(s, next, best);
      }
      if (!moved) break;
    }
  }

 private:
  int value(int stored, int lowest) const {
    return bc7::expand(mode_.has_p() ? stored << 1 | lowest : stored, bits_);
  }
  int nearest(float v, int lowest) const {
    const int most = (1 << mode_.color_bits) - 1;
    const float scaled = v * static_cast<float>((1 << bits_) - 1) / 255,
                stored = mode_.has_p() ? (scaled - static_cast<float>(lowest)) / 2 : scaled;
    return std::clamp(static_cast<int>(std::floor(stored + 0.5f)), 0, most);
  }
  /// The nearest ends, with the lowest bits that suit them.
  Coding quantised(const std::array<Color, 2>& ends) const {
    Coding coding;
    std::array<std::array<float, 2>, 2> off{};
    std::array<std::array<std::array<int, 3>, 2>, 2> stored{};
    for (size_t e = 0; e < 2; ++e)
      for (int p = 0; p < 2; ++p)
        for (size_t k = 0; k < 3; ++k) {
          const auto at = static_cast<size_t>(p);
          stored[e][at][k] = nearest(ends[e][k], p);
          const float d =
              static_cast<float>(value(stored[e][at][k], p)) - std::clamp(ends[e][k], 0.0f, 255.0f);
          off[e][at] += d * d;
        }
    for (size_t e = 0; e < 2; ++e) {
      size_t p = 0;
      if (mode_.end_p != 0) p = off[e][1] < off[e][0];
      if (mode_.shared_p != 0) p = off[0][1] + off[1][1] < off[0][0] + off[1][0];
      coding.lowest[e] = static_cast<int>(p);
      coding.end[e] = stored[e][p];
    }
    return coding;
  }
  /// Takes `next` with the nearest colours, if it is better.
  bool improve(const Subset& s, const Coding& next, Coding& best) const {
    std::array<float, 16> least, index{};
    least.fill(1e30f);
    const uint32_t steps = 1u << mode_.index_bits;
    std::array<int, 3> a, b;
    for (size_t k = 0; k < 3; ++k) {
      a[k] = value(next.end[0][k], next.lowest[0]);
      b[k] = value(next.end[1][k], next.lowest[1]);
    }
    for (uint32_t j = 0; j < steps; ++j) {
      const int w = bc7::weight_of(mode_.index_bits, j);
      const auto r = static_cast<float>(bc7::mixed(a[0], b[0], w)),
                 g = static_cast<float>(bc7::mixed(a[1], b[1], w)),
                 c = static_cast<float>(bc7::mixed(a[2], b[2], w)), number = static_cast<float>(j);
      for (size_t i = 0; i < 16; ++i) {
        const float dr = s.v[0][i] - r, dg = s.v[1][i] - g, db = s.v[2][i] - c,
                    d = dr * dr + dg * dg + db * db;
        index[i] = d < least[i] ? number : index[i];
        least[i] = d < least[i] ? d : least[i];
      }
    }
    float error = 0;
    for (size_t i = 0; i < s.count; ++i) error += least[i];
    if (error >= best.error) return false;
    best = next;
    best.error = error;
    for (size_t i = 0; i < s.count; ++i) best.index[i] = static_cast<uint8_t>(index[i]);
    return true;
  }
  /// The ends with the least squared error for the indices that there are.
  bool fit(const Subset& s, const Coding& coding, std::array<Color, 2>& ends) const {
    float aa = 0, ab = 0, bb = 0;
    Color a{}, b{};
    for (size_t i = 0; i < s.count; ++i) {
      const float w = static_cast<float>(bc7::weight_of(mode_.index_bits, coding.index[i])) / 64, u = 1 - w;
      aa += u * u;
      ab += u * w;
      bb += w * w;
      for (size_t k = 0; k < 3; ++k) {
        a[k] += u * s.v[k][i];
        b[k] += w * s.v[k][i];
      }
    }
    const float determinant = aa * bb - ab * ab;
    if (!(determinant > 1e-3f)) return false;
    for (size_t k = 0; k < 3; ++k) {
      ends[0][k] = (a[k] * bb - b[k] * ab) / determinant;
      ends[1][k] = (b[k] * aa - a[k] * ab) / determinant;
    }
    return true;
  }

  Mode mode_;
  int bits_;
};

/// A block in a mode.
struct Plan {
  size_t mode = 6;
  uint32_t partition = 0;
  std::array<Subset, 3> subsets;
  std::array<Coding, 3> codings;
  float error = 1e30f;
};

/// A way to part the pixels, with a line for each subset.
struct Parting {
  uint32_t partition = 0;
  std::array<Subset, 3> subsets;
  std::array<Line, 3> lines;
};

Parting parting_of(const Channels& v, int subsets, uint32_t partition) {
  Parting parting;
  parting.partition = partition;
  for (uint32_t s = 0; s < static_cast<uint32_t>(subsets); ++s) {
    parting.subsets[s] = subset_of(v, subsets, partition, s);
    parting.lines[s] = line_of(parting.subsets[s]);
  }
  return parting;
}

void attempt(size_t number, const Parting& parting, int rounds, Plan& best) {
  const Mode& mode = bc7::modes[number];
  const Coder coder(mode);
  Plan plan;
  plan.mode = number;
  plan.partition = parting.partition;
  plan.error = 0;
  for (size_t s = 0; s < static_cast<size_t>(mode.subsets) && plan.error < best.error; ++s) {
    plan.codings[s] = coder.code(parting.subsets[s], parting.lines[s], rounds);
    plan.error += plan.codings[s].error;
  }
  if (plan.error >= best.error) return;
  plan.subsets = parting.subsets;
  best = plan;
}

/// The bits of a block, lowest first.
class Bits {
 public:
  void put(uint32_t value, int count) {
    for (int i = 0; i < count; ++i, ++used_)
      words_[used_ / 64] |= static_cast<uint64_t>(value >> i & 1) << used_ % 64;
  }
  void write(std::byte* out) const {
    store_le(out, words_[0]);
    store_le(out + 8, words_[1]);
  }

 private:
  std::array<uint64_t, 2> words_{};
  uint32_t used_ = 0;
};

void write(Plan plan, std::byte* out) {
  const Mode& mode = bc7::modes[plan.mode];
  const auto subsets = static_cast<uint32_t>(mode.subsets);
  std::array<uint32_t, 16> indices{};
  for (uint32_t s = 0; s < subsets; ++s) {
    Coding& c = plan.codings[s];
    const Subset& subset = plan.subsets[s];
    for (size_t i = 0; i < subset.count; ++i) indices[subset.pixels[i]] = c.index[i];
    // The highest bit of an anchor is zero: else the line is taken from its other end.
    const uint32_t last = (1u << mode.index_bits) - 1;
    if (indices[bc7::anchor_of(mode.subsets, plan.partition, s)] <= last / 2) continue;
    std::swap(c.end[0], c.end[1]);
    std::swap(c.lowest[0], c.lowest[1]);
    for (size_t i = 0; i < subset.count; ++i) indices[subset.pixels[i]] = last - indices[subset.pixels[i]];
  }
  Bits bits;
  bits.put(1u << plan.mode, static_cast<int>(plan.mode) + 1);
  bits.put(plan.partition, mode.partition_bits);
  for (size_t k = 0; k < 3; ++k)
    for (uint32_t s = 0; s < subsets; ++s)
      for (const auto& end : plan.codings[s].end) bits.put(static_cast<uint32_t>(end[k]), mode.color_bits);
  for (uint32_t e = 0; e < 2; ++e) bits.put((1u << mode.alpha_bits) - 1, mode.alpha_bits);  // opaque
  for (uint32_t s = 0; s < subsets; ++s)
    for (int e = 0; e < 2 * mode.end_p + mode.shared_p; ++e)
      bits.put(static_cast<uint32_t>(plan.codings[s].lowest[static_cast<size_t>(e)]), 1);
  for (uint32_t i = 0; i < 16; ++i) {
    const uint32_t s = bc7::subset_of(mode.subsets, plan.partition, i);
    bits.put(indices[i], mode.index_bits - (i == bc7::anchor_of(mode.subsets, plan.partition, s) ? 1 : 0));
  }
  bits.write(out);
}

/// Sums of the colours of some pixels and of their products; whole, and below 2^24.
using Sums = std::array<float, 12>;  // r g b rr rg rb gg gb bb, and nothing

/// About how much of `count` colours lies beside the line through them.
float beside_line(const Sums& sums, float count) {
  const float rr = sums[3] - sums[0] * sums[0] / count, rg = sums[4] - sums[0] * sums[1] / count,
              rb = sums[5] - sums[0] * sums[2] / count, gg = sums[6] - sums[1] * sums[1] / count,
              gb = sums[7] - sums[1] * sums[2] / count, bb = sums[8] - sums[2] * sums[2] / count,
              all = rr + gg + bb;
  if (!(all > 0)) return 0;
  Color axis = rr >= gg && rr >= bb ? Color{rr, rg, rb} : gg >= bb ? Color{rg, gg, gb} : Color{rb, gb, bb};
  float spread = 0;
  for (int round = 0; round < 3; ++round) {
    const Color next = {rr * axis[0] + rg * axis[1] + rb * axis[2],
                        rg * axis[0] + gg * axis[1] + gb * axis[2],
                        rb * axis[0] + gb * axis[1] + bb * axis[2]};
    const float length = axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2];
    if (!(length > 0)) return all;
    spread = (next[0] * axis[0] + next[1] * axis[1] + next[2] * axis[2]) / length;
    for (size_t k = 0; k < 3; ++k) axis[k] = next[k] / all;
  }
  return std::max(0.0f, all - spread);
}

/// The partings with the least beside their lines, best first.
std::vector<Parting> best_partings(const Channels& v, int subsets, size_t count) {
  std::array<Sums, 16> pixels{};
  for (size_t i = 0; i < 16; ++i) {
    const float r = v[0][i], g = v[1][i], b = v[2][i];
    pixels[i] = {r, g, b, r * r, r * g, r * b, g * g, g * b, b * b};
  }
  std::array<std::pair<float, uint32_t>, 64> all;
  for (uint32_t partition = 0; partition < 64; ++partition) {
    std::array<Sums, 3> sums{};
    std::array<float, 3> counts{};
    for (uint32_t i = 0; i < 16; ++i) {
      const uint32_t s = bc7::subset_of(subsets, partition, i);
      for (size_t k = 0; k < 12; ++k) sums[s][k] += pixels[i][k];
      ++counts[s];
    }
    float beside = 0;
    for (size_t s = 0; s < static_cast<size_t>(subsets); ++s) beside += beside_line(sums[s], counts[s]);
    all[partition] = {beside, partition};
  }
  std::partial_sort(all.begin(), all.begin() + static_cast<ptrdiff_t>(count), all.end());
  std::vector<Parting> best;
  for (size_t i = 0; i < count; ++i) best.push_back(parting_of(v, subsets, all[i].second));
  return best;
}

}  // namespace

void encode_bc7(const Pixels16& colors, int effort, std::byte* out) {
  Channels v;
  for (size_t i = 0; i < 16; ++i) {
    v[0][i] = colors[i].r;
    v[1][i] = colors[i].g;
    v[2][i] = colors[i].b;
  }
  const int rounds = effort < 3 ? 1 : 2;
  Plan best;
  attempt(6, parting_of(v, 1, 0), rounds + 1, best);
  // What is off by less than half a step of a channel is left.
  if (best.error > 6) {
    constexpr std::array<size_t, 9> tried = {1, 2, 4, 6, 8, 12, 20, 32, 64};
    const size_t count = tried[static_cast<size_t>(std::clamp(effort, 1, 9) - 1)];
    for (const Parting& parting : best_partings(v, 2, count))
      for (const size_t mode : {size_t{1}, size_t{3}}) attempt(mode, parting, rounds, best);
    if (effort > 1)
      for (const Parting& parting : best_partings(v, 3, std::max<size_t>(count / 2, 1))) {
        attempt(2, parting, rounds, best);
        if (parting.partition < 16) attempt(0, parting, rounds, best);
      }
  }
  const Mode& mode = bc7::modes[best.mode];
  if (effort > 1)
    for (size_t s = 0; s < static_cast<size_t>(mode.subsets); ++s)
      Coder(mode).polish(best.subsets[s], best.codings[s], effort - 1);
  write(best, out);
}

}  // namespace voxkit::color
