#include "libcolor/surface/picture_levels.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "formats/parallel.h"
#include "libcolor/surface/linear_light.h"

namespace voxkit::color {
namespace {

using Short8 = uint16_t __attribute__((vector_size(16)));
using Long2 = uint64_t __attribute__((vector_size(16)));
using Int4 = int32_t __attribute__((vector_size(16)));

Float4 load(const uint16_t* texel) {
  uint64_t bytes;
  std::memcpy(&bytes, texel, sizeof bytes);
  // Widened by zeros in between, which compilers make one instruction of; of a conversion in one step they do
  // not.
  const auto values = reinterpret_cast<Short8>(Long2{bytes, 0});
  const auto wide = __builtin_shufflevector(values, Short8{}, 0, 8, 1, 9, 2, 10, 3, 11);
  return __builtin_convertvector(reinterpret_cast<Int4>(wide), Float4);
}

/// The part of 0..1 that a coordinate falls on.
float wrapped(double t, PictureWrap wrap) {
  switch (wrap) {
    case PictureWrap::clamp:
      return static_cast<float>(std::clamp(t, 0.0, 1.0));
    case PictureWrap::mirror: {
      const double half = t / 2, part = 2 * (half - std::floor(half));  // 0..2
      return static_cast<float>(part > 1 ? 2 - part : part);
    }
    case PictureWrap::repeat:
      break;
  }
  return static_cast<float>(t - std::floor(t));
}

/// The two texels around a place, and the weight of the second.
struct Pair {
  int32_t first, second;
  float weight;
};
Pair pair_at(float t, int32_t size, PictureWrap wrap) {
  const float place = t * static_cast<float>(size) - 0.5f;  // above -1
  const auto first = static_cast<int32_t>(place + 1) - 1;
  Pair pair{first, first + 1, place - static_cast<float>(first)};
  if (static_cast<uint32_t>(first) < static_cast<uint32_t>(size - 1)) [[likely]]
    return pair;
  // At the first or the last texel; a coordinate may round to the far end.
  pair.first = first < 0 ? wrap == PictureWrap::repeat ? size - 1 : 0 : size - 1;
  pair.second = first < 0 || wrap == PictureWrap::repeat ? 0 : size - 1;
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

Result<PictureLevels::Level> PictureLevels::Level::make(int64_t width, int64_t height, Context& ctx) {
  Level level;
  level.width = static_cast<int32_t>(width);
  level.height = static_cast<int32_t>(height);
  VOX_TRY(level.texels,
          Buffer::allocate(static_cast<uint64_t>(width * height) * 8, "a texture's levels", ctx));
  return level;
}

Result<PictureLevels::Level> PictureLevels::halved(const Level& from, Context& ctx) {
  VOX_TRY(Level to, Level::make(std::max(1, from.width / 2), std::max(1, from.height / 2), ctx));
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
      uint16_t* out = to.at(x, y);
      for (size_t c = 0; c < 4; ++c) out[c] = static_cast<uint16_t>((sum[c] + area / 2) / area);
    }
    return {};
  }));
  return to;
}

Result<PictureLevels> PictureLevels::make(const Picture& picture, Kind kind, Context& ctx, int cut_off) {
  PictureLevels out;
  VOX_TRY(Level first, Level::make(picture.width, picture.height, ctx));
  const auto& linear = light_tables().linear;
  const uint8_t* from = picture.data();
  for (int64_t y = 0; y < picture.height; ++y)
    for (int64_t x = 0; x < picture.width; ++x, from += 4) {
      uint16_t* to = first.at(x, y);
      const uint32_t alpha = kind == Kind::color  ? from[3]
                             : kind == Kind::mask ? (from[3] >= cut_off ? 255 : 0)
                                                  : 255;
      for (size_t c = 0; c < 3; ++c)
        to[c] = kind == Kind::numbers ? static_cast<uint16_t>(from[c] * 257)
                                      : static_cast<uint16_t>((linear[from[c]] * alpha + 127) / 255);
      to[3] = static_cast<uint16_t>(alpha * 257);
    }
  out.levels_.push_back(std::move(first));
  while (out.levels_.back().width > 1 || out.levels_.back().height > 1) {
    VOX_TRY(Level next, halved(out.levels_.back(), ctx));
    out.levels_.push_back(std::move(next));
  }
  return out;
}

PictureLevels::Detail PictureLevels::detail(double texels_squared) const {
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

Float4 PictureLevels::bilinear(const Level& level, float u, float v, PictureWrap wrap_u, PictureWrap wrap_v) {
  const Pair x = pair_at(u, level.width, wrap_u), y = pair_at(v, level.height, wrap_v);
  const Float4 a = load(level.at(x.first, y.first)), b = load(level.at(x.second, y.first));
  const Float4 c = load(level.at(x.first, y.second)), d = load(level.at(x.second, y.second));
  const Float4 upper = a + (b - a) * x.weight, lower = c + (d - c) * x.weight;
  return upper + (lower - upper) * y.weight;
}

Float4 PictureLevels::nearest(const Level& level, float u, float v) {
  const auto texel = [](float t, int32_t size) {
    return std::min(static_cast<int32_t>(t * static_cast<float>(size)), size - 1);
  };
  return load(level.at(texel(u, level.width), texel(v, level.height)));
}

Float4 PictureLevels::sample(double u, double v, PictureWrap wrap_u, PictureWrap wrap_v, PictureFilter filter,
                             Detail detail) const {
  const float s = wrapped(u, wrap_u), t = wrapped(v, wrap_v);
  const bool as_it_is = filter == PictureFilter::nearest && detail.level == 0;
  Float4 value = as_it_is ? nearest(levels_[0], s, t) : bilinear(levels_[detail.level], s, t, wrap_u, wrap_v);
  if (detail.next > 0)
    value += (bilinear(levels_[detail.level + 1], s, t, wrap_u, wrap_v) - value) * detail.next;
  return value;
}

}  // namespace voxkit::color
