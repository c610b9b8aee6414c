// WebP pictures, by libwebp: webp.so.
#include <fmt/format.h>
#include <webp/decode.h>

#include "formats/mesh/mesh_module.h"
#include "formats/reservation.h"

namespace voxkit {
namespace {

Result<Picture> decode(const std::string& name, std::span<const std::byte> bytes, Context& ctx) {
  const auto* data = reinterpret_cast<const uint8_t*>(bytes.data());
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(data, bytes.size(), &features) != VP8_STATUS_OK)
    return bad_input(name, "corrupt WebP texture: its header: expected a RIFF file with VP8, VP8L or VP8X");
  if (features.has_animation) return bad_input(name, "an animated WebP texture: expected one picture");
  const auto width = static_cast<uint64_t>(features.width), height = static_cast<uint64_t>(features.height);
  VOX_CHECK(check_picture_size(name, width, height));
  // What libwebp takes beside the picture: as much again.
  VOX_TRY(const Reservation memory, Reservation::take(4 * width * height, "a WebP texture", ctx));
  Picture picture;
  picture.width = features.width;
  picture.height = features.height;
  VOX_TRY(picture.texels, Buffer::allocate(4 * width * height, "a texture", ctx));
  if (!WebPDecodeRGBAInto(data, bytes.size(), picture.data(), 4 * width * height, 4 * features.width))
    return bad_input(name, "corrupt WebP texture: expected whole pictures");
  for (uint64_t i = 0; i < width * height && !picture.has_alpha; ++i)
    picture.has_alpha = picture.data()[4 * i + 3] != 255;
  return picture;
}

const MeshModule webp{.decode_webp = decode};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.mesh = &voxkit::webp)
