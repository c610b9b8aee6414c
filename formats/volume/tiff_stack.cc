#include "formats/volume/tiff_stack.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <tuple>

#include "formats/image/image_check.h"
#include "formats/image/image_input.h"
#include "formats/image/tiff_chunks.h"
#include "formats/image/tiff_file.h"
#include "formats/volume/exact_samples.h"
#include "formats/volume/parts.h"
#include "formats/volume/sliced_source.h"
#include "formats/volume/stack_description.h"
#include "formats/volume/tiff_pixels.h"

namespace voxkit {
namespace {

/// A page that OpenImageIO unpacks, as the rows y0 .. y1 of its samples.
Status read_by_library(const TiffFile& file, const TiffPage& page, const TiffPixels& pixels,
                       uint64_t memory_limit, int64_t y0, int64_t y1, std::byte* out) {
  using OIIO::TypeDesc;
  VOX_TRY(const auto input, open_image(file.name(), memory_limit));
  if (page.number > INT32_MAX || !input->seek_subimage(static_cast<int>(page.number), 0))
    return bad_input(file.name(), one_line(input->geterror()));
  const OIIO::ImageSpec& spec = input->spec();
  const int wide = sample_bytes(pixels.layout.type);
  const bool from_palette = page.photometric == 3;
  const int channels = from_palette ? 3 : page.samples;
  if (spec.width != page.width || spec.height != page.height || spec.nchannels != channels ||
      static_cast<int>(spec.format.size()) != wide)
    return bad_input(file.name(), fmt::format("page {}: its {} pixels are not what its directory says",
                                              page.number, tiff_compression_name(page.compression)));
  const int64_t row_bytes = page.width * channels * wide;
  std::vector<std::byte> all(static_cast<size_t>(row_bytes * page.height));
  if (!input->read_image(0, 0, 0, channels, spec.format, all.data()))
    return bad_input(file.name(), one_line(input->geterror()));
  // The library shows what MINISWHITE means, and bits as 0 and the greatest value.
  const bool inverted = page.photometric == 0;
  const int64_t pixel = int64_t{channels} * wide, taken = int64_t{pixels.layout.components} * wide;
  for (int64_t y = y0; y < y1; ++y)
    for (int64_t x = 0; x < page.width; ++x) {
      const std::byte* in = all.data() + y * row_bytes + x * pixel + pixels.first * wide;
      for (int64_t i = 0; i < taken; ++i) {
        std::byte v = in[i];
        if (inverted) v = ~v;
        if (page.bits == 1) v = v == std::byte{0} ? std::byte{0} : std::byte{1};
        *out++ = v;
      }
    }
  return {};
}

/// A ratio; of those that were rounded to terms near 2^32, as writers make them of a decimal number, that
/// number: the one of the fewest digits that gives these terms.
double decimal_ratio(uint32_t numerator, uint32_t denominator) {
  const double ratio = static_cast<double>(numerator) / denominator;
  const uint32_t less = std::min(numerator, denominator), more = std::max(numerator, denominator);
  const double tolerance = 0.5 / less;
  if (more < 1u << 30 || tolerance > 1e-6) return ratio;
  for (int digits = 1; digits < 12; ++digits) {
    const double rounded = std::strtod(fmt::format("{:.{}g}", ratio, digits).c_str(), nullptr);
    if (std::abs(rounded - ratio) <= ratio * tolerance) return rounded;
  }
  return ratio;
}

class TiffStack final : public SlicedSource {
 public:
  static SourceResult open(std::vector<std::string> files, bool pages, const OpenOptions& options,
                           Context& ctx) {
    std::unique_ptr<TiffStack> stack(new TiffStack);
    stack->limit_ = ctx.memory->limit();
    stack->files_ = std::move(files);
    stack->info_.files = stack->files_;
    stack->options_ = options;
    VOX_TRY(stack->first_, TiffFile::open(stack->files_.front()));
    VOX_CHECK(stack->plan(pages, ctx));
    const VolumeInfo info = stack->info_;
    const SampleLayout layout = stack->pixels_.layout;
    if (!needs_look(layout.type)) {
      stack->keep_slices(ctx);
      return stack;
    }
    return spooled_samples(
        stack->files_.front(), info, layout,
        [&](int64_t z, std::byte* samples) { return stack->samples_of(z, 0, info.dims.y, samples); }, options,
        ctx);
  }

 protected:
  Status read_rows(int64_t z, int64_t y0, int64_t y1, std::byte* rows) override {
    try {
      const int64_t count = (y1 - y0) * info_.dims.x;
      const bool in_place = pixels_.layout.bytes_per_voxel() == voxel_bytes(info_.format);
      std::vector<std::byte> own(in_place ? 0
                                          : static_cast<size_t>(count * pixels_.layout.bytes_per_voxel()));
      std::byte* const samples = in_place ? rows : own.data();
      VOX_CHECK(samples_of(z, y0, y1, samples));
      if (in_place && storage_bias(pixels_.layout.type) == 0 && info_.format != VoxelFormat::bitmap)
        return {};
      convert(samples, count, rows);
      return {};
    } catch (const std::bad_alloc&) {
      return fail(ErrorCode::limit, files_.front(), "not enough memory to decode a slice");
    }
  }

 private:
  TiffStack() = default;

  void convert(const std::byte* samples, int64_t count, std::byte* out) const {
    if (samples != out) return convert_samples(samples, pixels_.layout, count, info_, out);
    // Samples and voxels have one size: converted a stretch at a time, beside their place.
    std::array<std::byte, 4096> part;
    const int64_t bytes = pixels_.layout.bytes_per_voxel(), most = static_cast<int64_t>(part.size()) / bytes;
    for (int64_t done = 0; done < count; done += most) {
      const int64_t n = std::min(most, count - done);
      std::memcpy(part.data(), out + done * bytes, static_cast<size_t>(n * bytes));
      convert_samples(part.data(), pixels_.layout, n, info_, out + done * bytes);
    }
  }

  /// What the first page, the descriptions and the options say.
  Status plan(bool pages, Context& ctx) {
    const std::string& name = files_.front();
    std::vector<int64_t> full;
    bool masks = false;
    for (const TiffPage& page : first_->pages()) {
      if (!page.is_auxiliary()) full.push_back(page.number);
      masks |= (page.subfile & 4) != 0;
    }
    if (full.empty()) return bad_input(name, "all its pages are smaller copies or masks of others");
    if (masks) ctx.note(name + ": pages that are masks of others are dropped");
    page_ = first_->pages()[static_cast<size_t>(full.front())];
    if (!pages && full.size() > 1)
      return bad_input(name, fmt::format("{} pages: expected one in each file of a stack", full.size()));
    VOX_TRY(StackDescription said,
            describe_stack(name, first_->text(page_.description), full, page_.samples, options_));
    for (const std::string& note : said.notes) ctx.note(name + ": " + note);
    if (page_.imagej_metadata) ctx.note(name + ": ImageJ's labels and overlays are dropped");
    if (!pages && (said.slices > 1 || said.channels > 1 || said.times > 1))
      return bad_input(name, "its description is that of a stack: expected one page in each file of a stack");
    if (said.slices == 0) {
      said.slices = std::ssize(full);
      said.directory = full;
    }
    VOX_CHECK(choose(said));
    if (pages) {
      VOX_CHECK(plan_pages(said));
    } else {
      for (size_t i = 0; i < files_.size(); ++i) slices_.push_back({static_cast<int64_t>(i), 0, 0});
      VOX_TRY(const auto last, TiffFile::open(files_.back()));
      VOX_TRY(const TiffPage* const page, only_page(*last));
      VOX_CHECK(check(*last, *page));
    }
    VOX_CHECK(check_sizes());
    info_.dims = {page_.width, page_.height, std::ssize(slices_)};
    info_.format = pixels_.format;
    info_.sample_type = pixels_.sample_type;
    info_.is_labels = (options_.labels || said.is_labels) && !is_color(info_.format);
    info_.world = said.world;
    info_.slope = said.slope;
    info_.intercept = said.intercept;
    info_.description = said.text;
    if (!checked_voxels(info_.dims)) return bad_input(name, "stack has too many voxels");
    place(said, ctx);
    if (page_.photometric == 0)
      ctx.note(name + ": its least value is white: values are kept as they are stored");
    if (pixels_.divides_alpha)
      ctx.note(name + ": colours were stored multiplied by alpha: they are divided by it");
    if (page_.orientation > 4)
      ctx.note(
          fmt::format("{}: its orientation {} says that rows are columns: they are kept as they are stored",
                      name, page_.orientation));
    return {};
  }

  /// Which channel and time step is meant, and what its samples become.
  Status choose(const StackDescription& said) {
    const std::string& name = files_.front();
    info_.parts = said.parts;
    const bool color = page_.photometric == 3 || is_tiff_color(page_);
    // Samples of a pixel are channels where they are no colour, or one of them is asked for.
    const bool of_samples = page_.samples > 1 && (!color || (options_.channel && said.channels == 1));
    const int64_t samples = of_samples ? page_.samples : 1;
    const int64_t channels = said.channels * samples;
    OpenOptions options = options_;
    options.channel.reset();
    if (of_samples) options.channel = 0;
    VOX_CHECK(tiff_pixels(*first_, page_, 0, options));
    if (of_samples && !options_.channel && !options_.any_part)
      return bad_input(name,
                       fmt::format("image is {}: expected 1 channel, or 3 or 4 of 8 bits, or --channel N "
                                   "with a number from 0 to {}",
                                   describe(page_), channels - 1));
    VOX_TRY(const auto chosen, choose_parts(name,
                                            {{"--time", "time steps", said.times, options_.time},
                                             {"--channel", "channels", channels, options_.channel}},
                                            options_, info_));
    time_ = chosen[0];
    const int64_t channel = chosen[1];
    channel_ = channel / samples;
    VOX_TRY(pixels_,
            tiff_pixels(*first_, page_, static_cast<int>(of_samples ? channel % samples : 0), options));
    return {};
  }

  /// Slices from the pages of one file.
  Status plan_pages(const StackDescription& said) {
    const std::string& name = files_.front();
    if (said.contiguous) {
      if (page_.compression != 1 || page_.tiled || page_.depth > 1 || page_.planar == 2)
        return bad_input(name, "images that follow one directory are compressed: expected them as they are");
      const auto layout = tiff_chunk_layout(page_);
      const uint64_t start = first_->number(page_.offsets, 0), there = first_->bytes().size();
      const auto images = static_cast<uint64_t>(said.slices * said.channels * said.times);
      image_bytes_ = layout ? layout->row_bytes * static_cast<uint64_t>(page_.height) : 0;
      if (image_bytes_ == 0 || start > there || images > (there - start) / image_bytes_)
        return bad_input(name,
                         fmt::format("its description says {} images of {} bytes from byte {}: the file "
                                     "has {} bytes",
                                     images, image_bytes_, start, there));
      // Strips are one after the other then; they become one.
      page_.chunk_height = page_.height;
      page_.counts = {};
      for (int64_t z = 0; z < said.slices; ++z)
        slices_.push_back(
            {page_.number, 0, z * said.strides[0] + channel_ * said.strides[1] + time_ * said.strides[2]});
      return {};
    }
    if (page_.depth > 1 && said.slices * said.channels * said.times > 1)
      return bad_input(name, fmt::format("{} pages of {} slices each: expected one page of them",
                                         said.slices * said.channels * said.times, page_.depth));
    for (int64_t z = 0; z < said.slices; ++z) {
      const int64_t number =
          said.directory[static_cast<size_t>((time_ * said.channels + channel_) * said.slices + z)];
      const TiffPage& page = first_->pages()[static_cast<size_t>(number)];
      VOX_CHECK(check(*first_, page));
      for (int64_t k = 0; k < page.depth; ++k) slices_.push_back({number, k, 0});
    }
    return {};
  }

  Status check(const TiffFile& file, const TiffPage& page) const {
    const bool alike = page.width == page_.width && page.height == page_.height &&
                       page.depth == page_.depth && page.samples == page_.samples &&
                       page.bits == page_.bits && page.sample_format == page_.sample_format &&
                       page.photometric == page_.photometric;
    if (!alike)
      return bad_input(file.name(),
                       fmt::format("{} is {}: expected {}, like the first",
                                   files_.size() == 1 ? fmt::format("page {}", page.number) : "slice",
                                   describe(page), describe(page_)));
    VOX_TRY(const TiffPixels pixels, tiff_pixels(file, page, pixels_.first, options_of(pixels_)));
    if (pixels.layout.components != pixels_.layout.components || pixels.format != pixels_.format)
      return bad_input(file.name(),
                       fmt::format("the palette of page {} is of another kind than the first", page.number));
    return {};
  }
  OpenOptions options_of(const TiffPixels& pixels) const {
    OpenOptions options = options_;
    options.channel.reset();
    if (pixels.layout.components == 1 && page_.samples > 1) options.channel = pixels.first;
    return options;
  }

  Result<const TiffPage*> only_page(const TiffFile& file) const {
    const TiffPage* found = nullptr;
    for (const TiffPage& page : file.pages()) {
      if (page.is_auxiliary()) continue;
      if (found) return bad_input(file.name(), "several pages: expected one in each file of a stack");
      found = &page;
    }
    if (!found) return bad_input(file.name(), "all its pages are smaller copies or masks of others");
    return found;
  }

  /// That the file and our memory can hold an image.
  Status check_sizes() const {
    const std::string& name = files_.front();
    const auto layout = tiff_chunk_layout(page_);
    const double bytes = static_cast<double>(page_.width) * static_cast<double>(page_.height) *
                         std::max(page_.bits * page_.samples / 8.0, 1.0 / 8);
    if (!layout || bytes / 65536 > static_cast<double>(first_->bytes().size()) + 16)
      return bad_input(name, fmt::format("header says {}: a file of {} bytes cannot hold that",
                                         describe(page_), first_->bytes().size()));
    VOX_CHECK(check_image_pixels(name, page_.width, page_.height));
    const auto needed = std::max<uint64_t>(
        {layout->bytes, static_cast<uint64_t>(page_.width * page_.height * pixels_.layout.bytes_per_voxel()),
         static_cast<uint64_t>(page_.width * page_.height * voxel_bytes(pixels_.format))});
    if (needed > limit_ / 2)
      return fail(
          ErrorCode::limit, name,
          fmt::format("one image takes {} bytes: more than half of --max-memory, {}", needed, limit_));
    return {};
  }

  /// Lengths of voxels from the resolution and the description.
  void place(const StackDescription& said, Context& ctx) {
    constexpr Unit units[] = {Unit::unknown, Unit::inch, Unit::centimetre};
    const int said_unit = page_.resolution_unit;
    Unit unit = said_unit >= 1 && said_unit <= 3 ? units[said_unit - 1] : Unit::unknown;
    const auto length = [](const auto& resolution) -> std::optional<double> {
      if (!resolution || (*resolution)[0] == 0 || (*resolution)[1] == 0) return std::nullopt;
      return decimal_ratio((*resolution)[1], (*resolution)[0]);
    };
    std::array<std::optional<double>, 3> spacing{length(page_.x_resolution), length(page_.y_resolution), {}};
    // A ratio of pixels without a unit and of 1 says nothing.
    for (size_t a = 0; a < 3; ++a)
      if (said.spacing[a]) spacing[a] = said.spacing[a];
    if (!spacing[0] && !spacing[1] && !spacing[2]) return;
    if (said.unit) unit = *said.unit;
    if (!spacing[0]) spacing[0] = spacing[1].value_or(1);
    if (!spacing[1]) spacing[1] = spacing[0];
    const bool known = unit != Unit::unknown || *spacing[0] != 1 || *spacing[1] != 1;
    if (!spacing[2]) {
      spacing[2] = spacing[0];
      if (known && info_.dims.z > 1)
        ctx.note(fmt::format("{}: how far apart slices are is not said: taken to be {}, as columns are",
                             files_.front(), *spacing[2]));
    }
    info_.unit = unit;
    info_.affine = Affine::plain({*spacing[0], *spacing[1], *spacing[2]}, {});
    for (size_t a = 0; a < 3; ++a)
      if (said.origin_index[a] != 0) info_.affine.origin[a] = -said.origin_index[a] * *spacing[a];
    if (said.origin) info_.affine.origin = *said.origin;
    if (!info_.affine.is_valid()) info_.affine = {};
  }

  /// Rows of samples of slice z.
  Status samples_of(int64_t z, int64_t y0, int64_t y1, std::byte* out) {
    const Slice slice = slices_[static_cast<size_t>(z)];
    std::unique_ptr<const TiffFile> own;
    const TiffFile* file = first_.get();
    TiffPage page = page_;
    if (files_.size() > 1 && slice.number > 0) {
      VOX_TRY(own, TiffFile::open(files_[static_cast<size_t>(slice.number)]));
      file = own.get();
      VOX_TRY(const TiffPage* const only, only_page(*file));
      VOX_CHECK(check(*file, *only));
      page = *only;
    } else if (files_.size() == 1 && image_bytes_ == 0) {
      page = first_->pages()[static_cast<size_t>(slice.number)];
    }
    const int64_t height = page.height;
    const bool turned = page.orientation == 3 || page.orientation == 4;
    if (turned) std::tie(y0, y1) = std::pair(height - y1, height - y0);
    if (image_bytes_ > 0) {
      VOX_CHECK(read_contiguous(slice.image, y0, y1, out));
    } else if (pixels_.by_library || !unpacks_tiff(page.compression)) {
      VOX_CHECK(read_by_library(*file, page, pixels_, limit_, y0, y1, out));
    } else {
      VOX_CHECK(read_tiff_rows(*file, page, pixels_, slice.z, y0, y1, out));
    }
    const int64_t pixel = pixels_.layout.bytes_per_voxel(), row = page.width * pixel;
    if (turned)
      for (int64_t a = 0, b = y1 - y0 - 1; a < b; ++a, --b)
        std::swap_ranges(out + a * row, out + (a + 1) * row, out + b * row);
    if (page.orientation == 2 || page.orientation == 3)
      for (int64_t y = 0; y < y1 - y0; ++y)
        for (int64_t a = 0, b = page.width - 1; a < b; ++a, --b)
          std::swap_ranges(out + y * row + a * pixel, out + y * row + (a + 1) * pixel,
                           out + y * row + b * pixel);
    return {};
  }

  /// Of images that follow each other: the directory, moved.
  Status read_contiguous(int64_t image, int64_t y0, int64_t y1, std::byte* out) const {
    return read_tiff_rows(*first_, page_, pixels_, 0, y0, y1, out,
                          static_cast<uint64_t>(image) * image_bytes_);
  }

  struct Slice {
    int64_t number = 0;  ///< of the file, or of the directory in the only one
    int64_t z = 0;       ///< within the directory
    int64_t image = 0;   ///< of those that follow the only directory
  };

  std::vector<std::string> files_;
  std::unique_ptr<const TiffFile> first_;
  OpenOptions options_;
  uint64_t limit_ = 0;
  TiffPage page_;  ///< the first
  TiffPixels pixels_;
  int64_t time_ = 0, channel_ = 0;
  uint64_t image_bytes_ = 0;  ///< of images that follow one directory; 0: there are none
  std::vector<Slice> slices_;
};

}  // namespace

SourceResult open_tiff_stack(std::vector<std::string> files, bool pages, const OpenOptions& options,
                             Context& ctx) {
  return TiffStack::open(std::move(files), pages, options, ctx);
}

}  // namespace voxkit
