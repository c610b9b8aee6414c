#include "formats/volume/png_stack.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <filesystem>

#include "formats/image/image_check.h"
#include "formats/image/png_file.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/parts.h"
#include "formats/volume/sliced_source.h"

namespace voxkit {
namespace {

/// How pixels become voxels.
struct Kind {
  enum class From { samples, channel, grey_palette, rgb_palette, rgba_palette, transparent_rgb } from;
  VoxelFormat format;
  SampleType type;
  int channel = 0;
};

std::string describe(const PngHead& head) {
  return fmt::format("{} x {} with {} channel{} of {} bits{}", head.width, head.height, head.samples,
                     head.samples == 1 ? "" : "s", head.bits, head.palette.empty() ? "" : ", a palette");
}

bool is_grey(const PngHead& head) {
  const size_t entries = size_t{1} << head.bits;
  return !head.translucent &&
         std::all_of(head.palette.begin(), head.palette.begin() + static_cast<ptrdiff_t>(entries),
                     [](const auto& c) { return c[0] == c[1] && c[0] == c[2]; });
}

class PngStack final : public SlicedSource {
 public:
  static SourceResult open(std::vector<std::string> files, const OpenOptions& options, Context& ctx) {
    std::unique_ptr<PngStack> stack(new PngStack);
    stack->files_ = std::move(files);
    stack->info_.files = stack->files_;
    const std::string& name = stack->files_.front();
    VOX_TRY(stack->head_, read_png_head(name));
    const PngHead& head = stack->head_;
    std::error_code unknown;
    const uint64_t there = std::filesystem::file_size(name, unknown);
    if (unknown || static_cast<uint64_t>(head.width) * static_cast<uint64_t>(head.height) / 65536 > there)
      return bad_input(
          name, fmt::format("header says {}: a file of {} bytes cannot hold that", describe(head), there));
    VOX_CHECK(check_image_pixels(name, head.width, head.height));
    const auto bytes = static_cast<uint64_t>(head.width * head.height) *
                       static_cast<uint64_t>(head.samples * (head.bits > 8 ? 2 : 1));
    if (bytes > ctx.memory->limit() / 2)
      return fail(ErrorCode::limit, name,
                  fmt::format("one image takes {} bytes: more than half of --max-memory, {}", bytes,
                              ctx.memory->limit()));
    VOX_CHECK(stack->choose(options));
    if (stack->files_.size() > 1) {
      VOX_TRY(const PngHead last, read_png_head(stack->files_.back()));
      VOX_CHECK(stack->check(stack->files_.back(), last));
    }
    VolumeInfo& info = stack->info_;
    info.dims = {head.width, head.height, std::ssize(stack->files_)};
    info.format = stack->kind_.format;
    info.sample_type = stack->kind_.type;
    info.is_labels = options.labels && !is_color(info.format);
    if (!checked_voxels(info.dims)) return bad_input(name, "stack has too many voxels");
    if (head.transparent_value && stack->kind_.from != Kind::From::transparent_rgb)
      ctx.note(name + ": that one of its values means void is dropped");
    stack->place(ctx);
    stack->keep_slices(ctx);
    return stack;
  }

 protected:
  Status read_rows(int64_t z, int64_t y0, int64_t y1, std::byte* rows) override {
    const std::string& name = files_[static_cast<size_t>(z)];
    try {
      PngHead head = head_;
      if (z > 0) {
        VOX_TRY(head, read_png_head(name));
        VOX_CHECK(check(name, head));
      }
      const int64_t sample = head.bits > 8 ? 2 : 1, row = head.width * head.samples * sample;
      const bool in_place = kind_.from == Kind::From::samples && y0 == 0 && y1 == head.height;
      std::vector<std::byte> own(in_place ? 0 : static_cast<size_t>(row * head.height));
      std::byte* const samples = in_place ? rows : own.data();
      VOX_CHECK(read_png_samples(name, head, samples));
      if (!in_place) convert(head, samples + y0 * row, (y1 - y0) * head.width, rows);
      return {};
    } catch (const std::bad_alloc&) {
      return fail(ErrorCode::limit, name, "not enough memory to decode a slice");
    }
  }

 private:
  PngStack() = default;

  Status choose(const OpenOptions& options) {
    using From = Kind::From;
    const SampleType type = head_.bits == 1   ? SampleType::bit
                            : head_.bits <= 8 ? SampleType::u8
                                              : SampleType::u16;
    kind_ = {From::samples, scalar_format(type), type, 0};
    if (!head_.palette.empty()) {
      VOX_CHECK(only_part(files_.front(), options));
      if (options.labels) return {};
      const bool grey = is_grey(head_);
      kind_ = {grey                ? From::grey_palette
               : head_.translucent ? From::rgba_palette
                                   : From::rgb_palette,
               grey                ? VoxelFormat::density8
               : head_.translucent ? VoxelFormat::rgba32
                                   : VoxelFormat::rgb24,
               SampleType::u8, 0};
      return {};
    }
    const bool color = head_.samples >= 3 && head_.bits == 8;
    if (head_.samples == 1 || (color && !options.channel)) {
      VOX_CHECK(only_part(files_.front(), options));
      if (head_.samples == 1) return {};
      const bool alpha = head_.samples == 4 || head_.transparent_value;
      kind_ = {head_.transparent_value ? From::transparent_rgb : From::samples,
               alpha ? VoxelFormat::rgba32 : VoxelFormat::rgb24, SampleType::u8, 0};
      return {};
    }
    if (!options.channel && !options.any_part)
      return bad_input(
          files_.front(),
          fmt::format("image is {}: expected 1 channel, or 3 or 4 of 8 bits, or --channel N with a "
                      "number from 0 to {}",
                      describe(head_), head_.samples - 1));
    VOX_TRY(const auto chosen, choose_parts(files_.front(),
                                            {{"--time", "time steps", 1, options.time},
                                             {"--channel", "channels", head_.samples, options.channel}},
                                            options, info_));
    kind_.from = From::channel;
    kind_.channel = static_cast<int>(chosen[1]);
    return {};
  }

  Status check(const std::string& name, const PngHead& head) const {
    const bool alike = head.width == head_.width && head.height == head_.height && head.bits == head_.bits &&
                       head.samples == head_.samples && head.palette.empty() == head_.palette.empty() &&
                       (kind_.from != Kind::From::transparent_rgb || head.transparent_value);
    if (!alike)
      return bad_input(
          name, fmt::format("slice is {}: expected {}, like the first", describe(head), describe(head_)));
    if (kind_.from == Kind::From::grey_palette && !is_grey(head))
      return bad_input(name, "slice has a palette of colours: expected one of greys, like the first");
    return {};
  }

  void place(Context& ctx) {
    const auto& per = head_.per_metre ? head_.per_metre : head_.per_unit;
    if (!per) return;
    const double x = 1.0 / (*per)[0], y = 1.0 / (*per)[1];
    if (!head_.per_metre) {
      // Only the ratio of the sides of a pixel.
      info_.affine.axes[1][1] = static_cast<double>((*per)[0]) / (*per)[1];
      return;
    }
    info_.unit = Unit::millimetre;
    info_.affine = Affine::plain({x * 1000, y * 1000, x * 1000}, {});
    if (info_.dims.z > 1)
      ctx.note(fmt::format("{}: how far apart slices are is not said: taken to be {} mm, as columns are",
                           files_.front(), x * 1000));
  }

  void convert(const PngHead& head, const std::byte* in, int64_t count, std::byte* out) const {
    using From = Kind::From;
    const int64_t sample = head.bits > 8 ? 2 : 1;
    for (int64_t i = 0; i < count; ++i) {
      switch (kind_.from) {
        case From::samples:
          std::memcpy(out, in, static_cast<size_t>(count * head.samples * sample));
          return;
        case From::channel:
          std::memcpy(out + i * sample, in + (i * head.samples + kind_.channel) * sample,
                      static_cast<size_t>(sample));
          break;
        case From::grey_palette:
          out[i] = static_cast<std::byte>(color(head, in[i])[0]);
          break;
        case From::rgb_palette:
          std::memcpy(out + 3 * i, color(head, in[i]).data(), 3);
          break;
        case From::rgba_palette:
          std::memcpy(out + 4 * i, color(head, in[i]).data(), 4);
          break;
        case From::transparent_rgb: {
          std::memcpy(out + 4 * i, in + 3 * i, 3);
          const bool is_void = std::memcmp(in + 3 * i, head.void_color.data(), 3) == 0;
          out[4 * i + 3] = is_void ? std::byte{0} : std::byte{255};
          break;
        }
      }
    }
  }
  static const std::array<uint8_t, 4>& color(const PngHead& head, std::byte index) {
    return head.palette[std::to_integer<size_t>(index)];
  }

  std::vector<std::string> files_;
  PngHead head_;  ///< of the first
  Kind kind_{};
};

}  // namespace

SourceResult open_png_stack(std::vector<std::string> files, const OpenOptions& options, Context& ctx) {
  return PngStack::open(std::move(files), options, ctx);
}

}  // namespace voxkit
