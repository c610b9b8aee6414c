// Pictures that are laid on meshes.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "formats/copy.h"

namespace voxkit {

/// Texels of 4 bytes: red, green and blue in sRGB and alpha, not multiplied by it; rows from top to bottom.
/// The memory counts against ctx.memory, which must outlive the texture.
struct Texture {
  int64_t width = 0, height = 0;
  std::unique_ptr<Buffer> texels;
  bool has_alpha = false;  ///< whether some alpha is below 255

  const uint8_t* data() const { return reinterpret_cast<const uint8_t*>(texels->data()); }
  uint8_t* data() { return reinterpret_cast<uint8_t*>(texels->data()); }
};

/// Most texels a side.
inline constexpr int64_t max_texture_side = 1 << 16;

/// An opaque or transparent picture in one colour; `fill` is R, G, B, A in its lowest to highest byte.
Result<Texture> plain_texture(int64_t width, int64_t height, uint32_t fill, Context& ctx);

/// Reads a file of any format that `read_image` knows, and .tga and .bmp. Samples of 16 bits are rounded to
/// 8, floats are taken as linear light. Errors: ErrorCode::input, ErrorCode::limit.
Result<Texture> read_texture(const std::string& path, Context& ctx);

/// The same of the bytes of a PNG or JPEG file. `name` is for errors.
Result<Texture> decode_texture(const std::string& name, std::span<const std::byte> bytes, Context& ctx);

/// Puts the opacity that `mask` shows, its alpha where it has one and else its brightness, in place of the
/// alpha of `texture`. A mask of another size is stretched over it: the nearest texel counts.
void set_opacity(Texture& texture, const Texture& mask);

/// Finds the file that a mesh in `folder` calls `name`: as it is written, with '/' for '\', and with its
/// %-escapes resolved; then in letters of either case; then by its last part, beside the mesh. Empty where
/// there is none.
std::string find_texture(const std::string& folder, const std::string& name);

}  // namespace voxkit
