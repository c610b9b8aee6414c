#include "libcolor/textures/bc1.h"

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <utility>

#include "formats/little_endian.h"

namespace voxkit::color {
namespace {

constexpr std::array<int, 3> most_of_channel = {31, 63, 31};

/// Both ends of a line, each channel with 5, 6 or 5 bits.
struct Ends {
  std::array<std::array<int, 3>, 2> at{};
};
/// Colours on the line: both ends, then those between. Their number decides how a block is read.
enum class Steps { three, four };
using Palette = std::array<std::array<int, 3>, 4>;

int expand(int v, int channel) {
  return channel == 1 ? v << 2 | v >> 4 : v << 3 | v >> 2;
}

Palette palette_of(const Ends& ends, Steps steps) {
  Palette p{};
  for (size_t k = 0; k < 3; ++k) {
    const int a = expand(ends.at[0][k], static_cast<int>(k)), b = expand(ends.at[1][k], static_cast<int>(k));
    p[0][k] = a;
    p[1][k] = b;
    p[2][k] = steps == Steps::four ? (2 * a + b) / 3 : (a + b) / 2;
    p[3][k] = steps == Steps::four ? (a + 2 * b) / 3 : 0;
  }
  return p;
}

/// Pairs of ends between which a third of the way is nearest to a value.
struct NearestPairs {
  std::array<std::array<std::pair<int, int>, 256>, 2> of{};  ///< of 5 and of 6 bits

  NearestPairs() {
    for (size_t kind = 0; kind < 2; ++kind) {
      const int channel = static_cast<int>(kind), most = most_of_channel[kind];
      for (int value = 0; value < 256; ++value) {
        int least = 1 << 20;
        for (int a = 0; a <= most; ++a)
          for (int b = 0; b <= most; ++b) {
            // Of pairs that are as near, those with ends that are.
            const int x = expand(a, channel), y = expand(b, channel),
                      off = 256 * std::abs((2 * x + y) / 3 - value) + std::abs(x - y);
            if (off >= least) continue;
            least = off;
            of[kind][static_cast<size_t>(value)] = {a, b};
          }
      }
    }
  }
};

/// The colours of a block, channel by channel, as floats: all that is computed with them is whole and below
/// 2^24.
class Block {
 public:
  explicit Block(const Pixels16& colors) {
    for (size_t i = 0; i < 16; ++i) {
      v_[0][i] = colors[i].r;
      v_[1][i] = colors[i].g;
      v_[2][i] = colors[i].b;
    }
  }

  /// The sum of squared errors with the nearest colours of a palette.
  float error(const Palette& palette) const {
    std::array<float, 16> least;
    least.fill(1e30f);
    for (size_t p = 0; p < 4; ++p) {
      const auto r = static_cast<float>(palette[p][0]), g = static_cast<float>(palette[p][1]),
                 b = static_cast<float>(palette[p][2]);
      for (size_t i = 0; i < 16; ++i) {
        const float dr = v_[0][i] - r, dg = v_[1][i] - g, db = v_[2][i] - b, d = dr * dr + dg * dg + db * db;
        least[i] = d < least[i] ? d : least[i];
      }
    }
    float sum = 0;
    for (const float d : least) sum += d;
    return sum;
  }
  /// Which colours are nearest.
  std::array<uint8_t, 16> nearest(const Palette& palette) const {
    std::array<uint8_t, 16> indices{};
    for (size_t i = 0; i < 16; ++i) {
      float least = 1e30f;
      for (uint8_t p = 0; p < 4; ++p) {
        float d = 0;
        for (size_t k = 0; k < 3; ++k) {
          const float apart = v_[k][i] - static_cast<float>(palette[p][k]);
          d += apart * apart;
        }
        if (d < least) {
          least = d;
          indices[i] = p;
        }
      }
    }
    return indices;
  }

  /// The outermost places of the colours along the axis on which they differ most.
  Ends outermost() const {
    float mean[3] = {}, moments[3][3] = {};
    for (size_t k = 0; k < 3; ++k) {
      for (const float v : v_[k]) mean[k] += v;
      mean[k] /= 16;
    }
    for (size_t j = 0; j < 3; ++j)
      for (size_t k = 0; k < 3; ++k)
        for (size_t i = 0; i < 16; ++i) moments[j][k] += (v_[j][i] - mean[j]) * (v_[k][i] - mean[k]);
    size_t widest = 0;
    for (size_t k = 1; k < 3; ++k)
      if (moments[k][k] > moments[widest][widest]) widest = k;
    float axis[3] = {moments[widest][0], moments[widest][1], moments[widest][2]};
    for (int round = 0; round < 6; ++round) {
      float next[3], length = 0;
      for (size_t j = 0; j < 3; ++j) {
        next[j] = moments[j][0] * axis[0] + moments[j][1] * axis[1] + moments[j][2] * axis[2];
        length += next[j] * next[j];
      }
      if (!(length > 0)) break;
      for (size_t j = 0; j < 3; ++j) axis[j] = next[j] / std::sqrt(length);
    }
    float lo = 0, hi = 0;
    for (size_t i = 0; i < 16; ++i) {
      float t = 0;
      for (size_t k = 0; k < 3; ++k) t += axis[k] * (v_[k][i] - mean[k]);
      lo = t < lo ? t : lo;
      hi = t > hi ? t : hi;
    }
    float ends[2][3];
    for (size_t k = 0; k < 3; ++k) {
      ends[0][k] = mean[k] + lo * axis[k];
      ends[1][k] = mean[k] + hi * axis[k];
    }
    return rounded(ends);
  }

  /// The ends with the least squared error for what is nearest now; false where there are none.
  bool fit(Steps steps, const std::array<uint8_t, 16>& indices, Ends& ends) const {
    constexpr float of_three[4] = {0, 1, 0.5f, 0}, of_four[4] = {0, 1, 1 / 3.0f, 2 / 3.0f};
    const float* const weights = steps == Steps::four ? of_four : of_three;
    float aa = 0, ab = 0, bb = 0, a[3] = {}, b[3] = {};
    for (size_t i = 0; i < 16; ++i) {
      if (steps == Steps::three && indices[i] == 3) continue;
      const float w = weights[indices[i]], u = 1 - w;
      aa += u * u;
      ab += u * w;
      bb += w * w;
      for (size_t k = 0; k < 3; ++k) {
        a[k] += u * v_[k][i];
        b[k] += w * v_[k][i];
      }
    }
    const float determinant = aa * bb - ab * ab;
    if (!(determinant > 1e-3f)) return false;
    float fitted[2][3];
    for (size_t k = 0; k < 3; ++k) {
      fitted[0][k] = (a[k] * bb - b[k] * ab) / determinant;
      fitted[1][k] = (b[k] * aa - a[k] * ab) / determinant;
    }
    ends = rounded(fitted);
    return true;
  }

 private:
  static Ends rounded(const float (&ends)[2][3]) {
    Ends result;
    for (size_t e = 0; e < 2; ++e)
      for (size_t k = 0; k < 3; ++k) {
        const auto most = static_cast<float>(most_of_channel[k]);
        const float v = ends[e][k] * most / 255;
        result.at[e][k] = static_cast<int>((v < 0 ? 0 : v > most ? most : v) + 0.5f);
      }
    return result;
  }

  float v_[3][16];
};

struct Coding {
  Ends ends;
  Steps steps = Steps::four;
  float error = 1e30f;

  bool improve(const Block& block, const Ends& other) {
    const float e = block.error(palette_of(other, steps));
    if (e >= error) return false;
    ends = other;
    error = e;
    return true;
  }
};

/// From the outermost colours: fits and nearest colours in turns, then single steps of single channels.
Coding search(const Block& block, Steps steps, const Ends& first, int effort) {
  Coding coding{first, steps};
  coding.improve(block, first);
  for (int round = 0; round < 1 + effort && coding.error > 0; ++round) {
    Ends fitted;
    if (!block.fit(steps, block.nearest(palette_of(coding.ends, steps)), fitted) ||
        !coding.improve(block, fitted))
      break;
  }
  for (int round = 1; round < effort && coding.error > 0; ++round) {
    bool moved = false;
    for (size_t e = 0; e < 2; ++e)
      for (size_t k = 0; k < 3; ++k)
        for (const int step : {-1, 1}) {
          Ends next = coding.ends;
          next.at[e][k] += step;
          if (next.at[e][k] >= 0 && next.at[e][k] <= most_of_channel[k]) moved |= coding.improve(block, next);
        }
    if (!moved) break;
  }
  return coding;
}

uint32_t packed(const std::array<int, 3>& end) {
  return static_cast<uint32_t>(end[0] << 11 | end[1] << 5 | end[2]);
}

void store(const Block& block, Coding coding, std::byte* out) {
  uint32_t first = packed(coding.ends.at[0]), second = packed(coding.ends.at[1]);
  if (coding.steps == Steps::four ? first < second : first > second) {
    std::swap(first, second);
    std::swap(coding.ends.at[0], coding.ends.at[1]);
  }
  if (first == second) coding.steps = Steps::three;
  const auto nearest = block.nearest(palette_of(coding.ends, coding.steps));
  uint32_t indices = 0;
  for (size_t i = 0; i < 16; ++i) indices |= uint32_t{nearest[i]} << 2 * i;
  store_le(out, static_cast<uint16_t>(first));
  store_le(out + 2, static_cast<uint16_t>(second));
  store_le(out + 4, indices);
}

}  // namespace

void encode_bc1(const Pixels16& colors, int effort, std::byte* out) {
  static const NearestPairs pairs;
  const Block block(colors);
  const Rgb one = colors[0];
  bool plain = true;
  for (const Rgb c : colors) plain &= c == one;
  Coding best;
  if (plain) {
    for (size_t k = 0; k < 3; ++k) {
      const auto [a, b] = pairs.of[k % 2][k == 0 ? one.r : k == 1 ? one.g : one.b];
      best.ends.at[0][k] = a;
      best.ends.at[1][k] = b;
    }
  } else {
    const Ends first = block.outermost();
    best = search(block, Steps::four, first, effort);
    const Coding three = search(block, Steps::three, first, effort);
    if (three.error < best.error) best = three;
  }
  store(block, best, out);
}

void decode_bc1(const std::byte* block, Pixels16& out) {
  const uint32_t first = load_le<uint16_t>(block), second = load_le<uint16_t>(block + 2),
                 indices = load_le<uint32_t>(block + 4);
  Ends ends;
  for (size_t e = 0; e < 2; ++e) {
    const auto end = static_cast<int>(e == 0 ? first : second);
    ends.at[e] = {end >> 11, end >> 5 & 63, end & 31};
  }
  const Palette palette = palette_of(ends, first > second ? Steps::four : Steps::three);
  for (size_t i = 0; i < 16; ++i) {
    const auto& c = palette[indices >> 2 * i & 3];
    out[i] = {static_cast<uint8_t>(c[0]), static_cast<uint8_t>(c[1]), static_cast<uint8_t>(c[2])};
  }
}

}  // namespace voxkit::color
