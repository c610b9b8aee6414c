// A picture at all its sizes, in linear light, and its mean over a footprint.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "formats/context.h"
#include "formats/mesh/mesh.h"

namespace voxkit::color {

/// Red, green, blue and alpha. Operations work on all four, each rounded as that of a float is.
using Float4 = float __attribute__((vector_size(16)));

/// Each level has half the sides of the one before, rounded down, to 1 x 1: the means over the areas that its
/// texels cover. Colours are multiplied by alpha, so that what is not there gives no colour to what is.
class PictureLevels {
 public:
  /// What texels are. Of a mask those whose alpha is at least 1 to 255 `cut_off` are there, and no other.
  enum class Kind : uint8_t { color, opaque, mask, numbers };
  /// Of opaque pictures and numbers alpha counts as 1 everywhere; numbers are no light, and 0..65535 for
  /// 0..255. The memory counts against ctx.memory.
  static Result<PictureLevels> make(const Picture& picture, Kind kind, Context& ctx, int cut_off = 128);

  int64_t width() const { return levels_[0].width; }
  int64_t height() const { return levels_[0].height; }

  /// Which two levels are mixed, and how much of the second, 0..1.
  struct Detail {
    uint32_t level = 0;
    float next = 0;
  };
  /// For a footprint whose longer side is the square root of `texels_squared` texels of the first level.
  Detail detail(double texels_squared) const;

  /// The mean around (u, v), linear between texels and levels: colours times alpha, and alpha, in 0..65535.
  /// With PictureFilter::nearest the texels of the first level are as they are. Any finite u and v.
  Float4 sample(double u, double v, PictureWrap wrap_u, PictureWrap wrap_v, PictureFilter filter,
                Detail detail) const;

 private:
  /// Texels of 4 numbers of 16 bits, row by row. (Tiles of 8 x 8 were no faster.)
  struct Level {
    int32_t width = 0, height = 0;
    std::unique_ptr<Buffer> texels;
    static Result<Level> make(int64_t width, int64_t height, Context& ctx);
    uint16_t* at(int64_t x, int64_t y) const {
      return reinterpret_cast<uint16_t*>(texels->data()) + 4 * (y * width + x);
    }
  };
  static Result<Level> halved(const Level& from, Context& ctx);
  static Float4 bilinear(const Level& level, float u, float v, PictureWrap wrap_u, PictureWrap wrap_v);
  static Float4 nearest(const Level& level, float u, float v);
  std::vector<Level> levels_;
};

}  // namespace voxkit::color
