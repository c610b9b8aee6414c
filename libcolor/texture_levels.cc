#include "libcolor/texture_levels.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "formats/parallel.h"
#include "libcolor/linear_light.h"

namespace voxkit::color {
namespace {

using Short4 = uint16_t __attribute__((vector_size(8)));

Float4 load(const uint16_t* texel) {
  Short4 values;
  std::memcpy(&values, texel, sizeof values);
  return __builtin_convertvector(values, Float4);
}

/// The part of 0..1 that a coordinate falls on.
float wrapped(double t, TextureWrap wrap) {
  switch (wrap) {
    case TextureWrap::clamp:
      return static_cast<float>(std::clamp(t, 0.0, 1.0));
    case TextureWrap::mirror: {
      const double half = t / 2, part = 2 * (half - std::floor(half));  // 0..2
      return static_cast<float>(part > 1 ? 2 - part : part);
    }
    case TextureWrap::repeat:
      break;
  }
  return static_cast<float>(t - std::floor(t));
}

/// The two texels around a place, and the weight of the second.
struct Pair {
  int32_t first, second;
  float weight;
};
Pair pair_at(float t, int32_t size, TextureWrap wrap) {
  const float place = t * static_cast<float>(size) - 0.5f;  // above -1
  const auto first = static_cast<int32_t>(place + 1) - 1;
  Pair pair{first, first + 1, place - static_cast<float>(first)};
  if (wrap == TextureWrap::repeat) {
    if (pair.first < 0) pair.first += size;
    if (pair.second >= size) pair.second -= size;
  } else {
    pair.first = std::max(pair.first, 0);
    pair.second = std::min(pair.second, size - 1);
  }
  // A coordinate that rounds to the far end.
  pair.first = std::min(pair.first, size - 1);
  pair.second = std::min(pair.second, size - 1);
  return pair;
}

/// Which texels of a side of `from` the texel `at` of one of `to` covers, and how much of each: up to three.
struct Cover {
  int64_t first;
  int count;
  std::array<uint32_t, 3> weights;  ///< in parts of from, whose sum is from
};
Cover cover(int64_t at, int64_t from, int64_t to) {
  // In steps of 1 / to texel: at * from to (at + 1) * from.
  const int64_t lo = at * from, hi = lo + from;
  Cover out{lo / to, 0, {}};
  for (int64_t texel = out.first; texel * to < hi; ++texel)
    out.weights[static_cast<size_t>(out.count++)] =
        static_cast<uint32_t>(std::min(hi, (texel + 1) * to) - std::max(lo, texel * to));
  return out;
}

}  // namespace

Result<TextureLevels::Level> TextureLevels::halved(const Level& from, Context& ctx) {
  Level to;
  to.width = std::max(1, from.width / 2);
  to.height = std::max(1, from.height / 2);
  VOX_TRY(to.texels,
          Buffer::allocate(static_cast<uint64_t>(to.width) * to.height * 8, "a texture's levels", ctx));
  const uint64_t area = static_cast<uint64_t>(from.width) * static_cast<uint64_t>(from.height);
  VOX_CHECK(parallel_for(ctx, to.height, [&](int64_t y) -> Status {
    const Cover rows = cover(y, from.height, to.height);
    for (int64_t x = 0; x < to.width; ++x) {
      const Cover columns = cover(x, from.width, to.width);
      std::array<uint64_t, 4> sum{};
      for (int j = 0; j < rows.count; ++j)
        for (int i = 0; i < columns.count; ++i) {
          const uint16_t* texel = from.at(columns.first + i, rows.first + j);
          const uint64_t weight =
              uint64_t{rows.weights[static_cast<size_t>(j)]} * columns.weights[static_cast<size_t>(i)];
          for (size_t c = 0; c < 4; ++c) sum[c] += weight * texel[c];
        }
      auto* out = const_cast<uint16_t*>(to.at(x, y));
      for (size_t c = 0; c < 4; ++c) out[c] = static_cast<uint16_t>((sum[c] + area / 2) / area);
    }
    return {};
  }));
  return to;
}

Result<TextureLevels> TextureLevels::make(const Texture& texture, bool opaque, Context& ctx) {
  TextureLevels out;
  Level first;
  first.width = static_cast<int32_t>(texture.width);
  first.height = static_cast<int32_t>(texture.height);
  const int64_t texels = texture.width * texture.height;
  VOX_TRY(first.texels, Buffer::allocate(static_cast<uint64_t>(texels) * 8, "a texture's levels", ctx));
  const auto& linear = light_tables().linear;
  auto* to = reinterpret_cast<uint16_t*>(first.texels->data());
  const uint8_t* from = texture.data();
  for (int64_t i = 0; i < texels; ++i, from += 4, to += 4) {
    const uint32_t alpha = opaque ? 255 : from[3];
    for (size_t c = 0; c < 3; ++c) to[c] = static_cast<uint16_t>((linear[from[c]] * alpha + 127) / 255);
    to[3] = static_cast<uint16_t>(alpha * 257);
  }
  out.levels_.push_back(std::move(first));
  while (out.levels_.back().width > 1 || out.levels_.back().height > 1) {
    VOX_TRY(Level next, halved(out.levels_.back(), ctx));
    out.levels_.push_back(std::move(next));
  }
  return out;
}

TextureLevels::Detail TextureLevels::detail(double texels_squared) const {
  const auto last = static_cast<uint32_t>(levels_.size() - 1);
  if (!(texels_squared > 1)) return {0, 0};
  int exponent = 0;
  const double part = std::frexp(texels_squared, &exponent);  // 0.5..1
  // The logarithm to base 4, straight between powers of 2.
  const double level = (exponent - 1 + (2 * part - 1)) / 2;
  if (!(level < last)) return {last, 0};
  const auto whole = static_cast<uint32_t>(level);
  return {whole, static_cast<float>(level - whole)};
}

Float4 TextureLevels::bilinear(const Level& level, float u, float v, TextureWrap wrap_u, TextureWrap wrap_v) {
  const Pair x = pair_at(u, level.width, wrap_u), y = pair_at(v, level.height, wrap_v);
  const Float4 a = load(level.at(x.first, y.first)), b = load(level.at(x.second, y.first));
  const Float4 c = load(level.at(x.first, y.second)), d = load(level.at(x.second, y.second));
  const Float4 upper = a + (b - a) * x.weight, lower = c + (d - c) * x.weight;
  return upper + (lower - upper) * y.weight;
}

Float4 TextureLevels::sample(double u, double v, TextureWrap wrap_u, TextureWrap wrap_v,
                             Detail detail) const {
  const float s = wrapped(u, wrap_u), t = wrapped(v, wrap_v);
  Float4 value = bilinear(levels_[detail.level], s, t, wrap_u, wrap_v);
  if (detail.next > 0)
    value += (bilinear(levels_[detail.level + 1], s, t, wrap_u, wrap_v) - value) * detail.next;
  return value;
}

}  // namespace voxkit::color
