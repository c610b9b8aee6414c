// Stacks of images by OpenImageIO: one image a slice, or one file of many pages.
#include <OpenImageIO/imageio.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <set>
#include <string_view>
#include <system_error>

#include "formats/image/image_file.h"
#include "formats/image/image_input.h"
#include "formats/image/image_module.h"
#include "formats/image/tiff_pages.h"
#include "formats/natural_order.h"
#include "formats/parallel.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/sliced_source.h"
#include "formats/volume/volume_module.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;
using OIIO::ImageInput;
using OIIO::ImageOutput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

// ------------------------------------------------------------------------------------------------ names of
// slices

/// Names of the regular files in a folder, hidden ones left out.
Result<std::vector<std::string>> files_in(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(folder.empty() ? "." : folder, error), end; !error && it != end;
       it.increment(error)) {
    std::error_code ignored;
    const std::string file = it->path().filename().string();
    if (!file.starts_with('.') && it->is_regular_file(ignored)) names.push_back(file);
  }
  if (error) return bad_input(folder.empty() ? "." : folder, "cannot read the folder: " + error.message());
  return names;
}

/// Every number that the pattern makes from a file that is there.
Result<std::set<uint64_t>> numbers_of(const NumberedName& pattern) {
  VOX_TRY(const auto files, files_in(pattern.folder));
  std::set<uint64_t> numbers;
  for (const std::string& file : files)
    if (const auto number = pattern.number(file)) numbers.insert(*number);
  return numbers;
}

Result<std::vector<std::string>> slices_of_pattern(const std::string& text) {
  VOX_TRY(const NumberedName pattern, numbered_name(text));
  VOX_TRY(const auto numbers, numbers_of(pattern));
  if (numbers.empty()) return bad_input(text, "no file has a name of this pattern");
  std::vector<std::string> paths;
  uint64_t expected = *numbers.begin();
  for (const uint64_t number : numbers) {
    if (number != expected)
      return bad_input(pattern.path(expected),
                       fmt::format("slice is missing: expected every number from {} to {}", *numbers.begin(),
                                   *numbers.rbegin()));
    paths.push_back(pattern.path(number));
    ++expected;
  }
  return paths;
}

Result<std::vector<std::string>> slices_of_folder(const std::string& folder) {
  VOX_TRY(auto files, files_in(folder));
  std::erase_if(files, [](const std::string& file) { return image_format(file) == nullptr; });
  if (files.empty()) return bad_input(folder, "no images in this folder: expected .tif, .png or .exr files");
  std::sort(files.begin(), files.end(), natural_less);
  for (const std::string& file : files)
    if (ending_of(file) != ending_of(files.front()))
      return bad_input(folder,
                       fmt::format("images of several kinds, as {} and {}: expected one kind, or a pattern",
                                   files.front(), file));
  for (std::string& file : files) file = folder + (folder.ends_with('/') ? "" : "/") + file;
  return files;
}

// -----------------------------------------------------------------------------------------------------
// reading

/// The voxels that pixels of an image become.
struct PixelKind {
  SampleLayout layout;
  VoxelFormat format = VoxelFormat::density8;
  TypeDesc type;  ///< asked of OpenImageIO; no conversion but half to float, which is exact
};

std::optional<PixelKind> pixel_kind(const ImageSpec& spec) {
  PixelKind kind;
  switch (spec.format.basetype) {
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
    case TypeDesc::FLOAT:
      kind.layout.type = SampleType::f32;
      break;
    case TypeDesc::DOUBLE:
      kind.layout.type = SampleType::f64;
      break;
    default:
      return std::nullopt;
  }
  kind.type = spec.format.basetype == TypeDesc::HALF ? TypeDesc(TypeDesc::FLOAT) : spec.format;
  kind.layout.components = spec.nchannels;
  const bool colour = spec.nchannels == 3 || spec.nchannels == 4;
  if (spec.deep || spec.depth > 1 || (spec.nchannels != 1 && !(colour && kind.layout.type == SampleType::u8)))
    return std::nullopt;
  kind.format = spec.nchannels == 3   ? VoxelFormat::rgb24
                : spec.nchannels == 4 ? VoxelFormat::rgba32
                                      : scalar_format(kind.layout.type);
  return kind;
}

bool same_pixels(const ImageSpec& a, const ImageSpec& b) {
  return a.width == b.width && a.height == b.height && a.nchannels == b.nchannels && a.format == b.format;
}

class ImageStack : public SlicedSource {
 public:
  static SourceResult open(std::vector<std::string> files, bool pages, Context& ctx) {
    std::unique_ptr<ImageStack> stack(new ImageStack);
    stack->limit_ = ctx.memory->limit();
    stack->files_ = std::move(files);
    stack->pages_ = pages;
    VOX_TRY(auto first, open_image(stack->files_.front(), stack->limit_));
    stack->spec_ = first->spec();
    const auto kind = pixel_kind(stack->spec_);
    if (!kind)
      return bad_input(
          stack->files_.front(),
          fmt::format("image is {}: expected 1 channel, or 3 or 4 of 8 bits", describe(stack->spec_)));
    stack->kind_ = *kind;
    int64_t slices = static_cast<int64_t>(stack->files_.size());
    if (pages) {
      if (std::string_view(first->format_name()) == "tiff") {
        VOX_TRY(slices, count_tiff_pages(stack->files_.front()));
      }
      if (slices > INT32_MAX || !first->seek_subimage(static_cast<int>(slices - 1), 0))
        return bad_input(stack->files_.front(), one_line(first->geterror()));
      VOX_CHECK(stack->check(first->spec(), stack->files_.front(), static_cast<int>(slices - 1)));
      stack->idle_.push_back(std::move(first));
    } else if (slices > 1) {
      VOX_TRY(const auto last, open_image(stack->files_.back(), stack->limit_));
      VOX_CHECK(stack->check(last->spec(), stack->files_.back(), 0));
    }
    stack->info_.dims = {stack->spec_.width, stack->spec_.height, slices};
    stack->info_.format = kind->format;
    stack->info_.sample_type = kind->layout.type;
    if (!checked_voxels(stack->info_.dims))
      return bad_input(stack->files_.front(), "stack has too many voxels");
    stack->keep_slices(ctx);
    return stack;
  }

 protected:
  Status read_rows(int64_t z, int64_t y0, int64_t y1, std::byte* rows) override {
    try {
      if (!pages_) {
        VOX_TRY(const auto input, open_image(files_[static_cast<size_t>(z)], limit_));
        return read_from(*input, files_[static_cast<size_t>(z)], 0, y0, y1, rows);
      }
      // Opening a file of many pages and walking to a page is slow, so open ones are kept, one a thread at
      // most.
      VOX_TRY(auto input, take());
      VOX_CHECK(read_from(*input, files_.front(), static_cast<int>(z), y0, y1, rows));
      std::lock_guard lock(mutex_);
      idle_.push_back(std::move(input));
      return {};
    } catch (const std::bad_alloc&) {
      return fail(ErrorCode::limit, files_.front(), "not enough memory to decode a slice");
    } catch (const std::exception& error) {
      return bad_input(files_.front(), one_line(error.what()));
    }
  }

 private:
  ImageStack() = default;

  Status check(const ImageSpec& spec, const std::string& path, int page) const {
    if (same_pixels(spec, spec_)) return {};
    return bad_input(
        path, fmt::format("{} is {}: expected {}, like the first",
                          pages_ ? fmt::format("page {}", page) : "slice", describe(spec), describe(spec_)));
  }

  Result<std::unique_ptr<ImageInput>> take() {
    {
      std::lock_guard lock(mutex_);
      if (!idle_.empty()) {
        auto input = std::move(idle_.back());
        idle_.pop_back();
        return input;
      }
    }
    return open_image(files_.front(), limit_);
  }

  Status read_from(ImageInput& input, const std::string& path, int page, int64_t y0, int64_t y1,
                   std::byte* rows) {
    if (page > 0 || pages_)
      if (!input.seek_subimage(page, 0)) return bad_input(path, one_line(input.geterror()));
    const ImageSpec& spec = input.spec();
    VOX_CHECK(check(spec, path, page));
    // A tiled image is read by whole rows of tiles.
    const int64_t tile = std::max(spec.tile_width ? spec.tile_height : 1, 1);
    const int64_t begin = y0 / tile * tile,
                  end = std::min((y1 + tile - 1) / tile * tile, int64_t{spec.height});
    const int64_t row_bytes = info_.dims.x * kind_.layout.bytes_per_voxel();
    const bool in_place = begin == y0 && end == y1 && row_bytes == info_.dims.x * voxel_bytes(kind_.format);
    std::vector<std::byte> own(in_place ? 0 : static_cast<size_t>((end - begin) * row_bytes));
    std::byte* pixels = in_place ? rows : own.data();
    const int top = spec.y + static_cast<int>(begin), bottom = spec.y + static_cast<int>(end);
    const bool done =
        spec.tile_width
            ? input.read_tiles(page, 0, spec.x, spec.x + spec.width, top, bottom, spec.z, spec.z + 1, 0,
                               spec.nchannels, kind_.type, pixels)
            : input.read_scanlines(page, 0, top, bottom, spec.z, 0, spec.nchannels, kind_.type, pixels);
    if (!done) return bad_input(path, one_line(input.geterror()));
    convert_samples(pixels + (y0 - begin) * row_bytes, kind_.layout, (y1 - y0) * info_.dims.x, info_, rows);
    return {};
  }

  std::vector<std::string> files_;
  bool pages_ = false;  ///< slices are the pages of files_.front()
  uint64_t limit_ = 0;
  ImageSpec spec_;
  PixelKind kind_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<ImageInput>> idle_;
};

SourceResult open_stack(const std::string& name, const OpenOptions&, Context& ctx) {
  try {
    limit_image_size(ctx);
    std::error_code ignored;
    if (fs::is_directory(name, ignored)) {
      VOX_TRY(auto files, slices_of_folder(name));
      return ImageStack::open(std::move(files), false, ctx);
    }
    if (fs::is_regular_file(name, ignored)) return ImageStack::open({name}, true, ctx);
    if (name.find('%') == std::string::npos)
      return bad_input(
          name, "no such file or folder: expected a folder, a file, or a pattern such as slice-%04d.tif");
    VOX_TRY(auto files, slices_of_pattern(name));
    return ImageStack::open(std::move(files), false, ctx);
  } catch (const std::exception& error) {
    return bad_input(name, one_line(error.what()));
  }
}

// -----------------------------------------------------------------------------------------------------
// writing

/// What the images of a kind can hold exactly, or nothing.
std::optional<TypeDesc> writable_type(const std::string& format, const VolumeInfo& info) {
  const bool wide = info.format == VoxelFormat::float32;
  if (format == "openexr") return wide ? std::optional<TypeDesc>(TypeDesc::FLOAT) : std::nullopt;
  if (format == "tiff" && wide) return TypeDesc(TypeDesc::FLOAT);
  if (wide || (format != "tiff" && format != "png") || (format == "png" && info.bias() != 0))
    return std::nullopt;
  if (info.format == VoxelFormat::density16)
    return info.bias() ? TypeDesc(TypeDesc::INT16) : TypeDesc(TypeDesc::UINT16);
  return info.bias() ? TypeDesc(TypeDesc::INT8) : TypeDesc(TypeDesc::UINT8);
}

tl::unexpected<Error> output_error(const std::string& path, const std::string& what) {
  return fail(ErrorCode::output, path, fmt::format("{}: {}", what, std::generic_category().message(errno)));
}

/// Slices are written into a hidden folder beside their names and get those names together at the end.
class ImageStackSink : public VolumeSink {
 public:
  static SinkResult create(const std::string& text, const VolumeInfo& info, bool force, Context& ctx) {
    std::unique_ptr<ImageStackSink> sink(new ImageStackSink);
    VOX_TRY(sink->pattern_, numbered_name(text));
    const char* format = image_format(text);
    const auto type = format ? writable_type(format, info) : std::nullopt;
    if (!type || info.dims.x > INT32_MAX || info.dims.y > INT32_MAX)
      return fail(
          ErrorCode::usage, text,
          fmt::format("images with this ending cannot hold {}{}: expected .tif (all formats), .png (8 and 16 "
                      "bits, colours) or .exr (FLOAT32)",
                      info.bias() ? "signed " : "", voxkit::name(info.format)));
    sink->format_ = format;
    sink->type_ = *type;
    sink->info_ = info;
    sink->force_ = force;
    sink->threads_ = {ctx.threads, ctx.memory};
    // Slices of an older, longer stack would be read as part of this one.
    auto numbers = numbers_of(sink->pattern_);
    if (!numbers) return fail(ErrorCode::output, text, numbers.error().what);
    if (!numbers->empty() && (!force || static_cast<int64_t>(*numbers->rbegin()) >= info.dims.z))
      return fail(
          ErrorCode::output, sink->pattern_.path(force ? *numbers->rbegin() : *numbers->begin()),
          force ? "is left from a longer stack: remove it first" : "exists: use --force to overwrite");
    std::string folder = sink->pattern_.folder + ".voxkit-XXXXXX";
    if (!mkdtemp(folder.data())) return output_error(text, "cannot write to the folder");
    sink->temporary_ = folder + "/";
    return sink;
  }

  ~ImageStackSink() override {
    if (temporary_.empty()) return;
    std::error_code ignored;
    fs::remove_all(temporary_, ignored);
  }

  Status write(int64_t z0, int64_t z1, ConstVoxelSpan voxels) override {
    if (z0 != next_ || z1 < z0 || z1 > info_.dims.z)
      return fail(ErrorCode::internal, pattern_.path(0), "slices out of order");
    VOX_CHECK(parallel_for(threads_, z1 - z0, [&](int64_t i) {
      return write_slice(z0 + i, {voxels.row(0, i), voxels.row_stride, voxels.slice_stride});
    }));
    next_ = z1;
    return {};
  }

  Status finish() override {
    if (next_ != info_.dims.z) return fail(ErrorCode::internal, pattern_.path(0), "slices are missing");
    for (int64_t z = 0; z < info_.dims.z; ++z) {
      const std::string path = temporary_ + pattern_.name(static_cast<uint64_t>(z));
      const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
      const bool flushed = fd >= 0 && fsync(fd) == 0;
      if (fd >= 0) close(fd);
      if (!flushed) return output_error(path, "cannot flush");
    }
    for (int64_t z = 0; z < info_.dims.z; ++z)
      if (Status moved = move_in(z); !moved) {
        while (z-- > 0) move_out(z);
        return moved;
      }
    return {};
  }

 private:
  ImageStackSink() = default;

  Status write_slice(int64_t z, ConstVoxelSpan slice) const {
    const std::string path = temporary_ + pattern_.name(static_cast<uint64_t>(z));
    const auto failed = [&](const std::string& why) {
      return fail(ErrorCode::output, pattern_.path(static_cast<uint64_t>(z)),
                  "cannot write: " + one_line(why));
    };
    try {
      auto output = ImageOutput::create(format_);
      if (!output) return failed("OpenImageIO was built without " + format_);
      output->threads(1);
      ImageSpec spec(static_cast<int>(info_.dims.x), static_cast<int>(info_.dims.y), attributes(info_.format),
                     type_);
      spec.attribute("compression", "zip");
      spec.attribute("oiio:UnassociatedAlpha", 1);
      spec.attribute("DateTime", "");  // else the library writes the time of day
      if (!output->open(path, spec)) return failed(output->geterror());
      const int bytes = voxel_bytes(info_.format);
      const int64_t row_bytes = info_.dims.x * bytes;
      constexpr int64_t rows_at_once = 64;
      std::vector<std::byte> rows(static_cast<size_t>(std::min(rows_at_once, info_.dims.y) * row_bytes));
      for (int64_t y = 0; y < info_.dims.y; y += rows_at_once) {
        const int64_t count = std::min(rows_at_once, info_.dims.y - y);
        for (int64_t i = 0; i < count; ++i)
          std::memcpy(rows.data() + i * row_bytes, slice.row(y + i, 0), static_cast<size_t>(row_bytes));
        // Taking the bias off again is flipping the sign bit, the top bit of the last byte.
        if (info_.bias())
          for (int64_t i = bytes - 1; i < count * row_bytes; i += bytes)
            rows[static_cast<size_t>(i)] ^= std::byte{0x80};
        if (!output->write_scanlines(static_cast<int>(y), static_cast<int>(y + count), 0, type_, rows.data()))
          return failed(output->geterror());
      }
      if (!output->close()) return failed(output->geterror());
      return {};
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      return failed(error.what());
    }
  }

  /// Gives a slice its name. An old slice of that name changes places with it, so that it can be brought
  /// back.
  Status move_in(int64_t z) {
    const std::string from = temporary_ + pattern_.name(static_cast<uint64_t>(z));
    const std::string to = pattern_.path(static_cast<uint64_t>(z));
    const auto move = [&](unsigned flags) {
      return renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), flags) == 0;
    };
    if (move(RENAME_NOREPLACE)) return {};
    if (errno == EEXIST && force_ && move(RENAME_EXCHANGE)) return {};
    // File systems that know neither flag.
    if (errno == EINVAL && (force_ || access(to.c_str(), F_OK) != 0) && rename(from.c_str(), to.c_str()) == 0)
      return {};
    return output_error(to, "cannot give the slice its name");
  }

  void move_out(int64_t z) {
    const std::string from = temporary_ + pattern_.name(static_cast<uint64_t>(z));
    const std::string to = pattern_.path(static_cast<uint64_t>(z));
    if (rename(from.c_str(), to.c_str()) != 0) unlink(to.c_str());
  }

  NumberedName pattern_;
  std::string format_;
  TypeDesc type_;
  VolumeInfo info_;
  bool force_ = false;
  Context threads_;
  std::string temporary_;
  int64_t next_ = 0;
};

const VolumeModule volumes{.open = open_stack, .create = ImageStackSink::create};
const ImageModule images{.read = read_image_file, .write = write_image_file};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.volume = &voxkit::volumes, .image = &voxkit::images)
