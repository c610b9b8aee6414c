#include "formats/volume/image_stack_sink.h"

#include <Imath/half.h>
#include <OpenImageIO/imageio.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <optional>
#include <system_error>

#include "formats/image/image_input.h"
#include "formats/image/image_output.h"
#include "formats/parallel.h"
#include "formats/volume/dense_sink.h"
#include "formats/volume/image_names.h"
#include "formats/volume/stack_description.h"
#include "formats/volume/wide_integers.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

/// Least and greatest sample that a volume of wide integers may have; of 64 bits as int64.
bool fits_32_bits(const VolumeInfo& info, bool is_signed) {
  const auto lo = is_signed ? int64_t{INT32_MIN} : 0,
             hi = is_signed ? int64_t{INT32_MAX} : int64_t{UINT32_MAX};
  if (info.labels) {
    for (const int64_t label : *info.labels)
      if (label < lo || label > hi) return false;
    return true;
  }
  if (info.format == VoxelFormat::float32) return !info.rounded;  // at most 2^24
  return info.wide_base >= lo && info.wide_base <= hi - 65535;
}

/// The type of samples in the images of a kind, as which a volume is written; nothing where they cannot hold
/// it.
std::optional<SampleType> stored_type(const std::string& format, const VolumeInfo& info) {
  const bool png = format == "png", tiff = format == "tiff", exr = format == "openexr";
  if (is_color(info.format)) return png || tiff ? std::optional(SampleType::u8) : std::nullopt;
  if (is_wide(info.sample_type)) {
    const bool is_signed = info.sample_type == SampleType::i32 || info.sample_type == SampleType::i64;
    const SampleType narrow = is_signed ? SampleType::i32 : SampleType::u32;
    if (tiff && (info.sample_type == narrow || fits_32_bits(info, is_signed))) return narrow;
    if (exr && info.format == VoxelFormat::float32 && !info.labels) return SampleType::f32;
    return std::nullopt;
  }
  if (info.format == VoxelFormat::float32) {
    if (exr && info.sample_type == SampleType::f16) return SampleType::f16;
    return tiff || exr ? std::optional(SampleType::f32) : std::nullopt;
  }
  if (exr || (!png && !tiff) || (png && info.bias() != 0)) return std::nullopt;
  if (info.format == VoxelFormat::density16) return info.bias() ? SampleType::i16 : SampleType::u16;
  return info.bias() ? SampleType::i8 : SampleType::u8;
}

TypeDesc library_type(SampleType type) {
  switch (type) {
    case SampleType::u8:
      return TypeDesc::UINT8;
    case SampleType::i8:
      return TypeDesc::INT8;
    case SampleType::u16:
      return TypeDesc::UINT16;
    case SampleType::i16:
      return TypeDesc::INT16;
    case SampleType::u32:
      return TypeDesc::UINT32;
    case SampleType::i32:
      return TypeDesc::INT32;
    case SampleType::f16:
      return TypeDesc::HALF;
    default:
      return TypeDesc::FLOAT;
  }
}

/// What images of a kind leave out of a volume, in one line; empty: nothing.
std::string left_out(const std::string& format, const VolumeInfo& info) {
  std::vector<std::string> lost;
  const bool tiff = format == "tiff";
  const bool placed = info.affine != Affine{} || info.unit != Unit::unknown || info.world != World::unknown;
  if (!tiff && placed) lost.emplace_back("where its voxels are");
  if (tiff && !info.affine.is_plain()) lost.emplace_back("the directions of its axes and its origin");
  if (!tiff && (info.slope != 1 || info.intercept != 0))
    lost.emplace_back("slope and intercept of its values");
  if (!tiff && !info.description.empty()) lost.emplace_back("its description");
  if (!tiff && info.is_labels) lost.emplace_back("that its values are labels");
  if (info.fill) lost.emplace_back("its fill value");
  if (info.space_code != 0) lost.emplace_back("the code of its space");
  std::string all;
  for (size_t i = 0; i < lost.size(); ++i)
    all += (i == 0 ? "" : i + 1 == lost.size() ? " and " : ", ") + lost[i];
  return all.empty() ? all : "images of this kind do not hold " + all + ": dropped";
}

tl::unexpected<Error> output_error(const std::string& path, const std::string& what) {
  return fail(ErrorCode::output, path, fmt::format("{}: {}", what, std::generic_category().message(errno)));
}

/// Slices are written into a hidden folder beside their names and get those names together at the end.
class ImageStackSink final : public VolumeSink {
 public:
  static SinkResult create(const std::string& text, const VolumeInfo& info, bool force, Context& ctx) {
    std::unique_ptr<ImageStackSink> sink(new ImageStackSink);
    VOX_TRY(sink->pattern_, numbered_name(text));
    const char* format = image_format(text);
    const auto type = format ? stored_type(format, info) : std::nullopt;
    if (!type || info.dims.x > INT32_MAX || info.dims.y > INT32_MAX)
      return fail(
          ErrorCode::usage, text,
          fmt::format("images with this ending cannot hold {}{}: expected .tif (what 32 bits hold), .png (8 "
                      "and 16 bits, colours) or .exr (FLOAT32)",
                      storage_bias(info.sample_type) && !is_color(info.format) ? "signed " : "",
                      type_name(info)));
    sink->format_ = format;
    sink->type_ = library_type(*type);
    sink->stored_ = *type;
    sink->note_ = ctx.note;
    if (const std::string lost = left_out(format, info); !lost.empty()) ctx.note(text + ": " + lost);
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
    if (rounds_) note_(pattern_.path(0) + ": some values are rounded to half floats");
    return {};
  }

 private:
  ImageStackSink() = default;

  Status write_slice(int64_t z, ConstVoxelSpan slice) const {
    const std::string path = temporary_ + pattern_.name(static_cast<uint64_t>(z));
    try {
      ImageSpec spec(static_cast<int>(info_.dims.x), static_cast<int>(info_.dims.y), attributes(info_.format),
                     type_);
      spec.attribute("compression", "zip");
      spec.attribute("oiio:UnassociatedAlpha", 1);
      spec.attribute("DateTime", "");  // else the library writes the time of day
      if (format_ == "tiff") describe_place(spec);
      CheckedImageOutput output(pattern_.path(static_cast<uint64_t>(z)), path);
      VOX_CHECK(output.open(format_, spec));
      const int64_t row_bytes = info_.dims.x * voxel_bytes(info_.format);
      const int64_t file_row = info_.dims.x * attributes(info_.format) * sample_bytes(stored_);
      constexpr int64_t rows_at_once = 64;
      const auto most = static_cast<size_t>(std::min(rows_at_once, info_.dims.y));
      std::vector<std::byte> rows(most * static_cast<size_t>(file_row));
      for (int64_t y = 0; y < info_.dims.y; y += rows_at_once) {
        const int64_t count = std::min(rows_at_once, info_.dims.y - y);
        for (int64_t i = 0; i < count; ++i)
          to_samples(slice.row(y + i, 0), row_bytes, rows.data() + i * file_row);
        VOX_CHECK(output.write(y, y + count, type_, rows.data()));
      }
      return output.close();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      return fail(ErrorCode::output, pattern_.path(static_cast<uint64_t>(z)),
                  "cannot write: " + one_line(error.what()));
    }
  }

  /// One row of voxels as the file's samples.
  void to_samples(const std::byte* voxels, int64_t row_bytes, std::byte* out) const {
    const int bytes = voxel_bytes(info_.format);
    if (is_wide(stored_)) {
      VolumeInfo narrow = info_;  // labels, bases and floats that 32 bits hold
      narrow.sample_type = stored_;
      to_wide(voxels, info_.dims.x, narrow, out);
      return;
    }
    if (stored_ == SampleType::f16) {
      for (int64_t x = 0; x < info_.dims.x; ++x) {
        float value;
        std::memcpy(&value, voxels + x * 4, 4);
        const Imath::half rounded(value);
        if (static_cast<float>(rounded) != value && value == value) rounds_ = true;
        std::memcpy(out + x * 2, &rounded, 2);
      }
      return;
    }
    std::memcpy(out, voxels, static_cast<size_t>(row_bytes));
    // Taking the bias off again is flipping the sign bit, the top bit of the last byte.
    if (storage_bias(stored_) != 0)
      for (int64_t i = bytes - 1; i < row_bytes; i += bytes) out[i] ^= std::byte{0x80};
  }

  /// Resolution, and a description as ImageJ reads it. What it has no words for stands on lines that it
  /// passes over.
  void describe_place(ImageSpec& spec) const {
    const std::string text = stack_description(info_);
    if (text.empty()) return;
    const auto spacing = info_.affine.spacing();
    spec.attribute("ImageDescription", text);
    spec.attribute("XResolution", static_cast<float>(1 / spacing[0]));
    spec.attribute("YResolution", static_cast<float>(1 / spacing[1]));
    spec.attribute("ResolutionUnit", "none");
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
  SampleType stored_ = SampleType::u8;
  mutable std::atomic<bool> rounds_{false};
  std::function<void(const std::string&)> note_;
  VolumeInfo info_;
  bool force_ = false;
  Context threads_;
  std::string temporary_;
  int64_t next_ = 0;
};

}  // namespace

SinkResult create_image_stack_sink(const std::string& pattern, const VolumeInfo& info, bool force,
                                   Context& ctx) {
  return ImageStackSink::create(pattern, info, force, ctx);
}

}  // namespace voxkit
