#include "formats/image/image.h"

#include <fmt/format.h>

#include "formats/image/image_module.h"
#include "formats/names.h"
#include "formats/output_file.h"

namespace voxkit {

Result<Image> Image::create(int64_t width, int64_t height, int channels, SampleType type, Context& ctx) {
  const auto pixels = checked_voxels({width, height, 1});
  const bool known = type == SampleType::f32 || sample_bytes(type) <= 2;
  if (!pixels || *pixels > uint64_t{1} << 56 || channels < 1 || channels > 4 || !known)
    return bad_usage(
        fmt::format("an image of {} x {} x {} samples: expected 1 to 4 channels of 8 or 16 bit "
                    "integers or floats",
                    width, height, channels));
  Image image;
  image.width_ = width;
  image.height_ = height;
  image.channels_ = channels;
  image.type_ = type;
  VOX_TRY(image.buffer_,
          Buffer::allocate(*pixels * static_cast<uint64_t>(channels) * sizeof(float), "an image", ctx));
  image.samples_ = reinterpret_cast<float*>(image.buffer_->data());
  return image;
}

bool is_image_name(const std::string& name) {
  if (is_numbered(name)) return false;
  for (const char* ending : {".png", ".tif", ".tiff", ".exr", ".jpg", ".jpeg"})
    if (has_ending(name, ending)) return true;
  return false;
}

Status check_image_output(const std::string& path, bool force) {
  if (!is_image_name(path) || has_ending(path, ".jpg") || has_ending(path, ".jpeg"))
    return fail(ErrorCode::usage, path,
                "cannot be written as an image: expected a name that ends in .png, .tif or .exr");
  return check_output(path, force);
}

Result<std::optional<Image>> read_image(const std::string& path, Context& ctx) {
  VOX_TRY(const ModuleTable* const module,
          load_module({"image_stack", "reading images", "libopenimageio-dev", ErrorCode::input, true}, path));
  return module->image->read(path, ctx);
}

Status write_image(const std::string& path, const Image& image, bool force,
                   std::span<const ImageLayer> layers) {
  VOX_TRY(const ModuleTable* const module,
          load_module({"image_stack", "writing images", "libopenimageio-dev", ErrorCode::usage, true}, path));
  return module->image->write(path, image, force, layers);
}

}  // namespace voxkit
