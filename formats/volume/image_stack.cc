// Stacks of images: one image a slice, or one file of many pages. TIFF and PNG are read by our own code, all
// others by OpenImageIO.
#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string_view>
#include <system_error>

#include "formats/image/image_file.h"
#include "formats/image/image_input.h"
#include "formats/image/image_module.h"
#include "formats/volume/exact_samples.h"
#include "formats/volume/image_names.h"
#include "formats/volume/image_stack_sink.h"
#include "formats/volume/parts.h"
#include "formats/volume/png_stack.h"
#include "formats/volume/sliced_source.h"
#include "formats/volume/tiff_stack.h"
#include "formats/volume/volume_module.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;
using OIIO::ImageInput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

/// The voxels that pixels of an image become.
struct PixelKind {
  SampleLayout layout;
  VoxelFormat format = VoxelFormat::density8;
  TypeDesc type;  ///< asked of OpenImageIO: that of the file
  int first = 0;  ///< channel of an image of which one is taken
};

/// Of the whole pixel, or of one channel.
std::optional<PixelKind> pixel_kind(const ImageSpec& spec, std::optional<int64_t> channel) {
  PixelKind kind;
  const TypeDesc type = spec.channelformat(static_cast<int>(channel.value_or(0)));
  switch (type.basetype) {
    case TypeDesc::UINT8:
      kind.layout.type = SampleType::u8;
      break;
    case TypeDesc::INT8:
      kind.layout.type = SampleType::i8;
      break;
    case TypeDesc::UINT16:
      kind.layout.type = SampleType::u16;
      break;
    case TypeDesc::INT16:
      kind.layout.type = SampleType::i16;
      break;
    case TypeDesc::UINT32:
      kind.layout.type = SampleType::u32;
      break;
    case TypeDesc::INT32:
      kind.layout.type = SampleType::i32;
      break;
    case TypeDesc::HALF:
      kind.layout.type = SampleType::f16;
      break;
    case TypeDesc::FLOAT:
      kind.layout.type = SampleType::f32;
      break;
    case TypeDesc::DOUBLE:
      kind.layout.type = SampleType::f64;
      break;
    default:
      return std::nullopt;
  }
  kind.type = type;
  const bool color =
      (spec.nchannels == 3 || spec.nchannels == 4) && kind.layout.type == SampleType::u8 && !channel;
  if (spec.deep || spec.depth > 1) return std::nullopt;
  kind.first = static_cast<int>(channel.value_or(0));
  kind.layout.components = color ? spec.nchannels : 1;
  kind.format = !color                ? scalar_format(kind.layout.type)
                : spec.nchannels == 3 ? VoxelFormat::rgb24
                                      : VoxelFormat::rgba32;
  return kind;
}

bool same_pixels(const ImageSpec& a, const ImageSpec& b) {
  return a.width == b.width && a.height == b.height && a.nchannels == b.nchannels && a.format == b.format &&
         a.channelformats == b.channelformats;
}

class ImageStack : public SlicedSource {
 public:
  static SourceResult open(std::vector<std::string> files, const OpenOptions& options, Context& ctx) {
    std::unique_ptr<ImageStack> stack(new ImageStack);
    stack->limit_ = ctx.memory->limit();
    stack->files_ = std::move(files);
    stack->info_.files = stack->files_;
    const std::string& name = stack->files_.front();
    VOX_TRY(auto first, open_image(name, stack->limit_));
    stack->spec_ = first->spec();
    VOX_CHECK(stack->choose(options));
    if (first->seek_subimage(1, 0))
      return bad_input(name, "several images in one file: expected one in each file of a stack");
    static_cast<void>(first->geterror());  // that there is no second one
    const auto slices = std::ssize(stack->files_);
    if (slices > 1) {
      VOX_TRY(const auto last, open_image(stack->files_.back(), stack->limit_));
      VOX_CHECK(stack->check(last->spec(), stack->files_.back()));
    }
    VolumeInfo& info = stack->info_;
    info.dims = {stack->spec_.width, stack->spec_.height, slices};
    info.format = stack->kind_.format;
    info.sample_type = stack->kind_.layout.type;
    info.is_labels = options.labels && !is_color(info.format);
    if (!checked_voxels(info.dims)) return bad_input(name, "stack has too many voxels");
    if (stack->spec_.x != 0 || stack->spec_.y != 0)
      ctx.note(fmt::format("{}: that its pixels begin at {}, {} is dropped", name, stack->spec_.x,
                           stack->spec_.y));
    if (needs_look(info.sample_type)) {
      const SampleLayout layout = stack->kind_.layout;
      return spooled_samples(
          name, info, layout,
          [&](int64_t z, std::byte* samples) { return stack->samples_of(z, 0, info.dims.y, samples); },
          options, ctx);
    }
    stack->keep_slices(ctx);
    return stack;
  }

 protected:
  Status read_rows(int64_t z, int64_t y0, int64_t y1, std::byte* rows) override {
    const int64_t count = (y1 - y0) * info_.dims.x;
    std::vector<std::byte> samples(static_cast<size_t>(count * kind_.layout.bytes_per_voxel()));
    VOX_CHECK(samples_of(z, y0, y1, samples.data()));
    convert_samples(samples.data(), kind_.layout, count, info_, rows);
    return {};
  }

 private:
  ImageStack() = default;

  Status choose(const OpenOptions& options) {
    const std::string& name = files_.front();
    const auto kind = pixel_kind(spec_, {});
    const bool one = spec_.nchannels == 1 || (kind && is_color(kind->format) && !options.channel);
    if (!kind || (!one && !options.channel && !options.any_part))
      return bad_input(
          name,
          fmt::format("image is {}: expected 1 channel, or 3 or 4 of 8 bits{}", describe(spec_),
                      kind ? fmt::format(", or --channel N with a number from 0 to {}", spec_.nchannels - 1)
                           : std::string()));
    VOX_TRY(const auto chosen,
            choose_parts(name,
                         {{"--time", "time steps", 1, options.time},
                          {"--channel", "channels", one ? 1 : spec_.nchannels, options.channel}},
                         options, info_));
    kind_ = one ? *kind : *pixel_kind(spec_, chosen[1]);
    return {};
  }

  Status check(const ImageSpec& spec, const std::string& path) const {
    if (same_pixels(spec, spec_)) return {};
    return bad_input(
        path, fmt::format("slice is {}: expected {}, like the first", describe(spec), describe(spec_)));
  }

  Status samples_of(int64_t z, int64_t y0, int64_t y1, std::byte* samples) {
    const std::string& path = files_[static_cast<size_t>(z)];
    try {
      VOX_TRY(const auto input, open_image(path, limit_));
      return read_from(*input, path, y0, y1, samples);
    } catch (const std::bad_alloc&) {
      return fail(ErrorCode::limit, path, "not enough memory to decode a slice");
    } catch (const std::exception& error) {
      return bad_input(path, one_line(error.what()));
    }
  }

  Status read_from(ImageInput& input, const std::string& path, int64_t y0, int64_t y1, std::byte* samples) {
    const ImageSpec& spec = input.spec();
    VOX_CHECK(check(spec, path));
    // A tiled image is read by whole rows of tiles.
    const int64_t tile = std::max(spec.tile_width ? spec.tile_height : 1, 1);
    const int64_t begin = y0 / tile * tile,
                  end = std::min((y1 + tile - 1) / tile * tile, int64_t{spec.height});
    const int64_t row_bytes = info_.dims.x * kind_.layout.bytes_per_voxel();
    const bool in_place = begin == y0 && end == y1;
    std::vector<std::byte> own(in_place ? 0 : static_cast<size_t>((end - begin) * row_bytes));
    std::byte* const pixels = in_place ? samples : own.data();
    const int top = spec.y + static_cast<int>(begin), bottom = spec.y + static_cast<int>(end);
    const int last = kind_.first + kind_.layout.components;
    const bool done =
        spec.tile_width
            ? input.read_tiles(0, 0, spec.x, spec.x + spec.width, top, bottom, spec.z, spec.z + 1,
                               kind_.first, last, kind_.type, pixels)
            : input.read_scanlines(0, 0, top, bottom, spec.z, kind_.first, last, kind_.type, pixels);
    if (!done) return bad_input(path, one_line(input.geterror()));
    if (!in_place)
      std::memcpy(samples, pixels + (y0 - begin) * row_bytes, static_cast<size_t>((y1 - y0) * row_bytes));
    return {};
  }

  std::vector<std::string> files_;
  uint64_t limit_ = 0;
  ImageSpec spec_;
  PixelKind kind_;
};

/// By the kind of the first: a stack has one.
SourceResult open_files(std::vector<std::string> files, bool one_file, const OpenOptions& options,
                        Context& ctx) {
  const char* const format = image_format(files.front());
  const std::string_view kind = format ? format : "";
  for (const std::string& file : files) {
    std::error_code unknown;
    if (!fs::is_regular_file(file, unknown)) return bad_input(file, "not a regular file");
  }
  if (kind == "tiff") return open_tiff_stack(std::move(files), one_file, options, ctx);
#ifdef VOXKIT_PNG
  if (kind == "png") return open_png_stack(std::move(files), options, ctx);
#endif
  return ImageStack::open(std::move(files), options, ctx);
}

SourceResult open_stack(const std::string& name, const OpenOptions& options, Context& ctx) {
  try {
    limit_image_size(ctx);
    std::error_code ignored;
    if (fs::is_directory(name, ignored)) {
      VOX_TRY(auto files, slices_of_folder(name));
      return open_files(std::move(files), false, options, ctx);
    }
    if (fs::is_regular_file(name, ignored)) return open_files({name}, true, options, ctx);
    if (name.find('%') == std::string::npos)
      return bad_input(
          name, "no such file or folder: expected a folder, a file, or a pattern such as slice-%04d.tif");
    VOX_TRY(auto files, slices_of_pattern(name));
    return open_files(std::move(files), false, options, ctx);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, name, "not enough memory to open the images");
  } catch (const std::exception& error) {
    return bad_input(name, one_line(error.what()));
  }
}

const VolumeModule volumes{.open = open_stack, .create = create_image_stack_sink};
const ImageModule images{.read = read_image_file, .write = write_image_file};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.volume = &voxkit::volumes, .image = &voxkit::images)
