// DICOM by our own code, and GDCM for compressed pixels: one series of CT, MR or other images, in files of
// one frame or of many.
#include <fmt/format.h>
#include <gdcmTrace.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "formats/parallel.h"
#include "formats/volume/dicom_pixels.h"
#include "formats/volume/dicom_series.h"
#include "formats/volume/exact_samples.h"
#include "formats/volume/sliced_source.h"
#include "formats/volume/volume_module.h"

namespace voxkit {
namespace {

class DicomSeries final : public SlicedSource {
 public:
  static SourceResult open(const std::string& name, const OpenOptions& options, Context& ctx) {
    std::unique_ptr<DicomSeries> series(new DicomSeries);
    VOX_TRY(auto headers, find_dicom(name));
    VOX_TRY(series->plan_, plan_dicom(name, std::move(headers), options, ctx));
    const DicomPlan& plan = series->plan_;
    const DicomHeader& first = plan.files.front();
    for (const DicomHeader& h : plan.files) {
      VOX_TRY(series->pixels_, dicom_pixels(h, options, ctx.memory->limit()));
    }
    VolumeInfo& info = series->info_;
    info.dims = {first.columns, first.rows, std::ssize(plan.slices)};
    info.format = series->pixels_.format;
    info.sample_type = series->pixels_.type;
    info.affine = plan.affine;
    info.world = plan.world;
    info.unit = plan.unit;
    info.description = first.description;
    info.parts = plan.parts;
    for (const DicomHeader& h : plan.files) info.files.push_back(h.path);
    info.is_labels = options.labels && !is_color(info.format);
    if (!checked_voxels(info.dims)) return bad_input(name, "series has too many voxels");
    VOX_CHECK(series->scale(name, options, ctx));
    VOX_CHECK(series->padding(name, options, ctx));
    series->tell(name, ctx);
    if (!series->real_ && needs_look(info.sample_type)) return series->spooled(name, options, ctx);
    series->keep_slices(ctx);
    VOX_CHECK(series->find_filler(name, ctx));
    return series;
  }

 protected:
  Status read_rows(int64_t z, int64_t y0, int64_t y1, std::byte* rows) override {
    const DicomSlice& slice = plan_.slices[static_cast<size_t>(z)];
    const int64_t count = (y1 - y0) * info_.dims.x, bytes = voxel_bytes(info_.format);
    if (slice.file == DicomSlice::none) {
      for (int64_t i = 0; i < count; ++i)
        std::memcpy(rows + i * bytes, filler_.bytes.data(), static_cast<size_t>(bytes));
      return {};
    }
    try {
      std::vector<std::byte> samples;
      VOX_CHECK(read_dicom_samples(plan_.header(slice), plan_.frame(slice), pixels_, samples));
      const int64_t pixel = pixels_.components * sample_bytes(pixels_.type);
      const std::byte* const from = samples.data() + y0 * info_.dims.x * pixel;
      if (real_) return to_real(plan_.frame(slice), from, count, rows);
      convert_samples(from, layout(), count, info_, rows);
      return {};
    } catch (const std::bad_alloc&) {
      return fail(ErrorCode::limit, plan_.header(slice).path, "not enough memory to decode a slice");
    }
  }

 private:
  DicomSeries() = default;

  SampleLayout layout() const {
    const bool bits = pixels_.type == SampleType::bit;  // they come as bytes
    return {bits ? SampleType::u8 : pixels_.type, pixels_.components, false};
  }

  /// One slope and intercept for all, or real values.
  Status scale(const std::string& name, const OpenOptions& options, Context& ctx) {
    const DicomFrame* first = nullptr;
    for (const DicomSlice& slice : plan_.slices) {
      if (slice.file == DicomSlice::none) continue;
      const DicomFrame& frame = plan_.frame(slice);
      if (!first) first = &frame;
      if (frame.slope == first->slope && frame.intercept == first->intercept) continue;
      if (is_color(info_.format)) break;
      if (!options.real_values && !options.any_part)
        return bad_input(
            plan_.header(slice).path,
            fmt::format(
                "rescale slope and intercept, {} and {}, differ from those of {}, {} and {}: expected one "
                "for all slices, or --apply-scale, which makes real values of them",
                frame.slope, frame.intercept, plan_.files.front().path, first->slope, first->intercept));
      if (!options.real_values)
        ctx.note(name + ": each slice has a slope and an intercept of its own: values are real ones");
      real_ = true;
      info_.format = VoxelFormat::float32;
      info_.sample_type = SampleType::f32;
      return {};
    }
    if (is_color(info_.format)) return {};
    info_.slope = first->slope;
    info_.intercept = first->intercept;
    return {};
  }

  /// What the file says stands for nothing measured.
  Status padding(const std::string& name, const OpenOptions& options, Context& ctx) {
    const DicomHeader& first = plan_.files.front();
    if (!first.padding || is_color(info_.format)) return {};
    if (real_ || is_wide(info_.sample_type) || first.is_float) {
      ctx.note(fmt::format("{}: that {} stands for nothing measured is dropped", name, *first.padding));
      return {};
    }
    if (first.padding_range)
      ctx.note(fmt::format("{}: of the values that stand for nothing measured only {} is kept", name,
                           *first.padding));
    if (!options.fill) info_.fill = info_.stored(static_cast<double>(*first.padding));
    return {};
  }

  void tell(const std::string& name, Context& ctx) const {
    const DicomHeader& first = plan_.files.front();
    if (first.photometric == "MONOCHROME1")
      ctx.note(name + ": its least value is white: values are kept as they are stored");
    if (first.has_table) ctx.note(name + ": a table says what its values mean: dropped");
  }

  static Status real_values(const SampleLayout& layout, const std::byte* in, int64_t count,
                            const DicomFrame& frame, float* out) {
    const auto each = [&](auto type) {
      for (int64_t i = 0; i < count; ++i) {
        decltype(type) sample;
        std::memcpy(&sample, in + i * static_cast<int64_t>(sizeof sample), sizeof sample);
        out[i] = static_cast<float>(frame.slope * static_cast<double>(sample) + frame.intercept);
      }
    };
    switch (layout.type) {
      case SampleType::u8:
        each(uint8_t{});
        break;
      case SampleType::i8:
        each(int8_t{});
        break;
      case SampleType::u16:
        each(uint16_t{});
        break;
      case SampleType::i16:
        each(int16_t{});
        break;
      case SampleType::u32:
        each(uint32_t{});
        break;
      case SampleType::i32:
        each(int32_t{});
        break;
      case SampleType::f32:
        each(float{});
        break;
      default:
        each(double{});
        break;
    }
    return {};
  }
  Status to_real(const DicomFrame& frame, const std::byte* in, int64_t count, std::byte* out) const {
    std::vector<float> values(static_cast<size_t>(count));
    VOX_CHECK(real_values(layout(), in, count, frame, values.data()));
    std::memcpy(out, values.data(), values.size() * sizeof(float));
    return {};
  }

  /// 32-bit integers and 64-bit floats, which are looked at first.
  SourceResult spooled(const std::string& name, const OpenOptions& options, Context& ctx) {
    const bool gaps = std::any_of(plan_.slices.begin(), plan_.slices.end(),
                                  [](const DicomSlice& s) { return s.file == DicomSlice::none; });
    if (gaps) return bad_input(name, "gaps of such pixels are not filled: expected --gaps accept");
    return spooled_samples(
        name, info_, layout(),
        [&](int64_t z, std::byte* out) -> Status {
          const DicomSlice& slice = plan_.slices[static_cast<size_t>(z)];
          std::vector<std::byte> samples;
          VOX_CHECK(read_dicom_samples(plan_.header(slice), plan_.frame(slice), pixels_, samples));
          std::memcpy(out, samples.data(), samples.size());
          return {};
        },
        options, ctx);
  }

  /// What slices that are not there are filled with: what stands for nothing measured, else the least value
  /// that there is; of colours black.
  Status find_filler(const std::string& name, Context& ctx) {
    const auto gaps = std::count_if(plan_.slices.begin(), plan_.slices.end(),
                                    [](const DicomSlice& s) { return s.file == DicomSlice::none; });
    if (gaps == 0 || is_color(info_.format)) return {};
    double least = info_.fill.value_or(std::numeric_limits<double>::infinity());
    if (!info_.fill) {
      const int64_t slice_bytes = info_.dims.x * info_.dims.y * voxel_bytes(info_.format);
      std::vector<std::byte> voxels(static_cast<size_t>(slice_bytes));
      for (int64_t z = 0; z < info_.dims.z; ++z) {
        VOX_CHECK(check_interrupt());
        if (plan_.slices[static_cast<size_t>(z)].file == DicomSlice::none) continue;
        VOX_CHECK(read_rows(z, 0, info_.dims.y, voxels.data()));
        for (int64_t i = 0; i < slice_bytes; i += voxel_bytes(info_.format))
          least = std::min(least, stored_at(voxels.data() + i));
      }
    }
    if (info_.format == VoxelFormat::float32)
      filler_ = Voxel::of(static_cast<float>(least));
    else
      filler_ = Voxel::of(static_cast<uint16_t>(least));
    const double value = info_.format == VoxelFormat::float32 ? least : info_.sample(least);
    ctx.note(fmt::format("{}: {} slices that are missing are filled with {}", name, gaps, value));
    return {};
  }
  double stored_at(const std::byte* voxel) const {
    if (info_.format == VoxelFormat::float32) {
      float value;
      std::memcpy(&value, voxel, sizeof value);
      return value;
    }
    const int low = std::to_integer<int>(voxel[0]);
    return info_.format == VoxelFormat::density16 ? low | std::to_integer<int>(voxel[1]) << 8 : low;
  }

  DicomPlan plan_;
  DicomPixels pixels_;
  bool real_ = false;  ///< slope and intercept, which differ, are applied
  Voxel filler_;
};

SourceResult open_series(const std::string& name, const OpenOptions& options, Context& ctx) {
  // The library reports on standard error, which is ours.
  gdcm::Trace::DebugOff();
  gdcm::Trace::WarningOff();
  gdcm::Trace::ErrorOff();
  try {
    return DicomSeries::open(name, options, ctx);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, name, "not enough memory to read the headers");
  } catch (const std::exception& error) {
    const std::string text = error.what();
    return bad_input(name, "corrupt DICOM file: " + text.substr(0, text.find('\n')));
  }
}

const VolumeModule volumes{.open = open_series};

}  // namespace
}  // namespace voxkit

VOX_MODULE(.volume = &voxkit::volumes)
