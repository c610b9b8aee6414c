#include "formats/image/image_file.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <string_view>
#include <utility>
#include <vector>

#include "formats/image/image_input.h"
#include "formats/image/image_output.h"
#include "formats/image/tiff_file.h"
#include "formats/output_file.h"

namespace voxkit {
namespace {

using OIIO::ImageSpec;
using OIIO::TypeDesc;

std::optional<SampleType> sample_type(TypeDesc type) {
  switch (type.basetype) {
    case TypeDesc::UINT8:
      return SampleType::u8;
    case TypeDesc::INT8:
      return SampleType::i8;
    case TypeDesc::UINT16:
      return SampleType::u16;
    case TypeDesc::INT16:
      return SampleType::i16;
    case TypeDesc::HALF:
    case TypeDesc::FLOAT:
      return SampleType::f32;
    default:
      return std::nullopt;
  }
}

TypeDesc file_type(SampleType type) {
  switch (type) {
    case SampleType::u8:
      return TypeDesc::UINT8;
    case SampleType::i8:
      return TypeDesc::INT8;
    case SampleType::u16:
      return TypeDesc::UINT16;
    case SampleType::i16:
      return TypeDesc::INT16;
    default:
      return TypeDesc::FLOAT;
  }
}

template <class T>
void to_floats(const std::byte* in, int64_t count, float* out) {
  for (int64_t i = 0; i < count; ++i) {
    T value;
    std::memcpy(&value, in + i * static_cast<int64_t>(sizeof(T)), sizeof value);
    out[i] = static_cast<float>(value);
  }
}

void to_floats(const std::byte* in, SampleType type, int64_t count, float* out) {
  switch (type) {
    case SampleType::u8:
      return to_floats<uint8_t>(in, count, out);
    case SampleType::i8:
      return to_floats<int8_t>(in, count, out);
    case SampleType::u16:
      return to_floats<uint16_t>(in, count, out);
    default:
      return to_floats<int16_t>(in, count, out);
  }
}

template <class T>
void from_floats(const float* in, int64_t count, std::byte* out) {
  constexpr float lo = std::numeric_limits<T>::min(), hi = std::numeric_limits<T>::max();
  for (int64_t i = 0; i < count; ++i) {
    // Written so that a NaN becomes the least value.
    const T value = static_cast<T>(std::lrint(in[i] > lo ? std::min(in[i], hi) : lo));
    std::memcpy(out + i * static_cast<int64_t>(sizeof(T)), &value, sizeof value);
  }
}

void from_floats(const float* in, SampleType type, int64_t count, std::byte* out) {
  switch (type) {
    case SampleType::u8:
      return from_floats<uint8_t>(in, count, out);
    case SampleType::i8:
      return from_floats<int8_t>(in, count, out);
    case SampleType::u16:
      return from_floats<uint16_t>(in, count, out);
    case SampleType::i16:
      return from_floats<int16_t>(in, count, out);
    default:
      std::memcpy(out, in, static_cast<size_t>(count) * sizeof(float));
  }
}

/// The channels that are the picture, first and count: in an OpenEXR file that has more those of no layer
/// that are called R, G, B and A, or Y and A. The library puts them side by side in that order.
std::pair<int, int> picture_channels(const ImageSpec& spec, std::string_view format) {
  const auto& names = spec.channelnames;
  if (format != "openexr") return {0, spec.nchannels};
  for (const std::vector<std::string>& colors : {std::vector<std::string>{"R", "G", "B"}, {"Y"}}) {
    const auto first = std::search(names.begin(), names.end(), colors.begin(), colors.end());
    if (first == names.end()) continue;
    const auto next = first + static_cast<ptrdiff_t>(colors.size());
    return {static_cast<int>(first - names.begin()),
            static_cast<int>(colors.size()) + (next != names.end() && *next == "A")};
  }
  return {0, spec.nchannels};
}

Result<std::optional<Image>> read(const std::string& path, Context& ctx) {
  limit_image_size(ctx);
  VOX_TRY(const auto input, open_image(path, ctx.memory->limit()));
  if (std::string_view(input->format_name()) == "tiff") {
    VOX_TRY(const int64_t pages, count_tiff_pages(path));
    if (pages > 1) return std::nullopt;
  }
  const ImageSpec spec = input->spec();
  const auto [first, count] = picture_channels(spec, input->format_name());
  const auto type = sample_type(spec.channelformat(first));
  if (!type || spec.deep || spec.depth > 1 || count < 1 || count > 4)
    return bad_input(path,
                     fmt::format("image is {}: expected 1 to 4 channels of 8 or 16 bit integers or floats",
                                 describe(spec)));
  VOX_TRY(Image image, Image::create(spec.width, spec.height, count, *type, ctx));
  const int64_t samples = image.pixels() * image.channels();
  // Integers are asked for as they are: as floats the library would scale them to 0..1.
  std::unique_ptr<Buffer> stored;
  if (*type != SampleType::f32) {
    VOX_TRY(stored, Buffer::allocate(static_cast<uint64_t>(samples * sample_bytes(*type)), "an image", ctx));
  }
  void* pixels = stored ? static_cast<void*>(stored->data()) : image.row(0);
  if (!input->read_image(0, 0, first, first + count, file_type(*type), pixels))
    return bad_input(path, one_line(input->geterror()));
  if (stored) to_floats(stored->data(), *type, samples, image.row(0));
  return image;
}

/// The samples of a row of the picture and of its layers, pixel by pixel; `stride` channels in all.
void interleave(const Image& image, std::span<const ImageLayer> layers, int64_t y, int64_t stride,
                float* out) {
  const auto put = [&](const Image& from) {
    const float* in = from.row(y);
    for (int64_t x = 0; x < image.width(); ++x, in += from.channels())
      std::copy_n(in, from.channels(), out + x * stride);
    out += from.channels();
  };
  put(image);
  for (const ImageLayer& layer : layers) put(layer.image);
}

Status write(const std::string& path, const Image& image, std::span<const ImageLayer> layers,
             const std::string& format, OutputFile& file) {
  const TypeDesc type = file_type(image.type());
  ImageSpec spec(static_cast<int>(image.width()), static_cast<int>(image.height()), image.channels(), type);
  if (image.channels() == 2) {
    spec.channelnames = {"Y", "A"};
    spec.alpha_channel = 1;
  }
  for (const ImageLayer& layer : layers)
    for (const char channel : layer.channels) {
      spec.channelnames.push_back(layer.name + '.' + channel);
      ++spec.nchannels;
    }
  spec.attribute("compression", "zip");
  spec.attribute("oiio:UnassociatedAlpha", 1);
  spec.attribute("DateTime", "");  // else the library writes the time of day
  CheckedImageOutput output(path, file.temporary());
  VOX_CHECK(output.open(format, spec));
  const int64_t row_samples = image.width() * spec.nchannels;
  constexpr int64_t rows_at_once = 64;
  std::vector<std::byte> rows(
      static_cast<size_t>(std::min(rows_at_once, image.height()) * row_samples * sample_bytes(image.type())));
  for (int64_t y = 0; y < image.height(); y += rows_at_once) {
    const int64_t end = std::min(y + rows_at_once, image.height());
    if (layers.empty())
      from_floats(image.row(y), image.type(), (end - y) * row_samples, rows.data());
    else
      for (int64_t i = y; i < end; ++i)
        interleave(image, layers, i, spec.nchannels,
                   reinterpret_cast<float*>(rows.data()) + (i - y) * row_samples);
    VOX_CHECK(output.write(y, end, type, rows.data()));
  }
  return output.close();
}

}  // namespace

Result<std::optional<Image>> read_image_file(const std::string& path, Context& ctx) {
  try {
    return read(path, ctx);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, path, "not enough memory to decode the image");
  } catch (const std::exception& error) {
    return bad_input(path, one_line(error.what()));
  }
}

Status write_image_file(const std::string& path, const Image& image, bool force,
                        std::span<const ImageLayer> layers) {
  VOX_CHECK(check_image_output(path, force));
  const std::string format = image_format(path);
  const bool real = image.type() == SampleType::f32;
  const bool is_signed = image.type() == SampleType::i8 || image.type() == SampleType::i16;
  if ((format == "png" && (real || is_signed)) || (format == "openexr" && !real))
    return fail(
        ErrorCode::usage, path,
        fmt::format("an image with this ending cannot hold {}: expected .tif (all types), .png (8 and 16 "
                    "bits) or .exr (floats)",
                    real        ? "floats"
                    : is_signed ? "signed integers"
                                : "integers"));
  for (const ImageLayer& layer : layers)
    if (format != "openexr" || layer.image.type() != SampleType::f32 ||
        layer.image.width() != image.width() || layer.image.height() != image.height() ||
        std::ssize(layer.channels) != layer.image.channels())
      return fail(ErrorCode::usage, path,
                  fmt::format("the layer {} cannot be written: expected an .exr file, and {} x {} floats "
                              "with a letter for each channel",
                              layer.name, image.width(), image.height()));
  if (image.width() > INT32_MAX || image.height() > INT32_MAX)
    return fail(ErrorCode::usage, path, "the image is too large for its file: expected sides below 2^31");
  try {
    VOX_TRY(const auto file, OutputFile::create(path, force));
    VOX_CHECK(write(path, image, layers, format, *file));
    return file->commit();
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, path, "not enough memory to write the image");
  } catch (const std::exception& error) {
    return fail(ErrorCode::output, path, "cannot write: " + one_line(error.what()));
  }
}

}  // namespace voxkit
