// Pictures that are laid on meshes.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "formats/copy.h"

namespace voxkit {

/// Texels of 4 bytes: red, green and blue in sRGB and alpha, not multiplied by it; rows from top to bottom.
/// The memory counts against ctx.memory, which must outlive the picture.
struct Picture {
  int64_t width = 0, height = 0;
  std::unique_ptr<Buffer> texels;
  bool has_alpha = false;  ///< whether some alpha is below 255

  const uint8_t* data() const { return reinterpret_cast<const uint8_t*>(texels->data()); }
  uint8_t* data() { return reinterpret_cast<uint8_t*>(texels->data()); }
};

/// Most texels a side, and in all: larger pictures are refused before they are decoded.
inline constexpr int64_t max_picture_side = 1 << 16;
inline constexpr int64_t max_picture_texels = int64_t{1} << 28;

/// An opaque or transparent picture in one colour; `fill` is R, G, B, A in its lowest to highest byte.
Result<Picture> plain_picture(int64_t width, int64_t height, uint32_t fill, Context& ctx);

/// ErrorCode::input for pictures above these, or without texels.
Status check_picture_size(const std::string& name, uint64_t width, uint64_t height);

/// Reads a file of any format that `read_image` knows, and .tga, .bmp and .webp. Samples of 16 bits are
/// rounded to 8, floats are taken as linear light. Errors: ErrorCode::input, ErrorCode::limit.
Result<Picture> read_picture(const std::string& path, Context& ctx);

/// The same of the bytes of a PNG, JPEG or WebP file. `name` is for errors.
Result<Picture> decode_picture(const std::string& name, std::span<const std::byte> bytes, Context& ctx);

/// Stored colours v become base + gain * v, 0..1.
void adjust_colors(Picture& picture, float base, float gain);

/// Puts the opacity that `mask` shows in place of the alpha of `picture`: its channel r, g, b, m (alpha) or l
/// (brightness); 0: its alpha where it has one and else its brightness. A mask of another size is stretched
/// over it: the nearest texel counts.
void set_opacity(Picture& picture, const Picture& mask, char channel = 0);

}  // namespace voxkit
