// A picture in memory, and its way from and to a file.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "formats/copy.h"

namespace voxkit {

/// Samples as floats, which hold integers of 8 and 16 bits exactly: channels interleaved, x fastest, rows
/// from top to bottom, without gaps. The memory counts against ctx.memory, which must outlive the image.
class Image {
 public:
  /// `channels`: 1 grey, 2 grey and alpha, 3 RGB, 4 RGBA. `type`: u8, i8, u16, i16 or f32. The samples are
  /// not set. Errors: ErrorCode::limit.
  static Result<Image> create(int64_t width, int64_t height, int channels, SampleType type, Context& ctx);

  int64_t width() const { return width_; }
  int64_t height() const { return height_; }
  int64_t pixels() const { return width_ * height_; }
  int channels() const { return channels_; }
  /// Channels without alpha: 1 or 3.
  int colors() const { return channels_ > 2 ? 3 : 1; }
  /// What the samples are in a file.
  SampleType type() const { return type_; }
  /// Nominal greatest difference of two samples: 255, 65535, or 1 for floats.
  double peak() const { return type_ == SampleType::f32 ? 1 : sample_bytes(type_) == 1 ? 255 : 65535; }

  float* row(int64_t y) { return samples_ + y * width_ * channels_; }
  const float* row(int64_t y) const { return samples_ + y * width_ * channels_; }

 private:
  Image() = default;
  int64_t width_ = 0, height_ = 0;
  int channels_ = 0;
  SampleType type_ = SampleType::u8;
  std::unique_ptr<Buffer> buffer_;
  float* samples_ = nullptr;
};

/// True for names that end like one image: .png .tif .tiff .exr .jpg .jpeg, and are no pattern of images.
bool is_image_name(const std::string& name);

/// Further channels of an OpenEXR file: "NAME.X" for each letter X of `channels`, which the image has one of
/// for each. Its samples are floats.
struct ImageLayer {
  std::string name;
  std::string channels;
  Image image;
};

/// Reads a .png, .tif, .exr or .jpg file of 1 to 4 channels of 8 or 16 bit integers or floats; nothing where
/// the file has several pages, which is a volume. An OpenEXR file may have more: its R, G, B and A, or Y and
/// A, are read, layers are not. Colours are as they are in the file, not multiplied by alpha. Errors:
/// ErrorCode::input, ErrorCode::limit.
Result<std::optional<Image>> read_image(const std::string& path, Context& ctx);

/// Writes a .png, .tif or .exr file, whole or not at all. Integers are rounded and clamped to the image's
/// type. `layers`: of the image's size, for .exr only. Errors: ErrorCode::usage where such a file cannot hold
/// the type or the layers, ErrorCode::output.
Status write_image(const std::string& path, const Image& image, bool force,
                   std::span<const ImageLayer> layers = {});

/// The checks of `write_image` that need no image.
Status check_image_output(const std::string& path, bool force);

}  // namespace voxkit
