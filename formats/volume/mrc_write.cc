// MRC2014 maps.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>

#include "formats/volume/dense_sink.h"
#include "formats/volume/facts.h"
#include "formats/volume/half.h"
#include "formats/volume/mrc_header.h"
#include "formats/volume/readers.h"

namespace voxkit {
namespace {

using namespace mrc;

/// Writes samples and, once they are all known, their range into the header.
class MrcSink final : public DenseSink {
 public:
  MrcSink(std::unique_ptr<OutputFile> file, const VolumeInfo& info, const SampleLayout& layout)
      : DenseSink(std::move(file), info, layout), type_(layout.type) {}

 protected:
  Status put(std::span<const std::byte> bytes) override {
    const auto as_it_is = [](auto sample) { return static_cast<double>(sample); };
    switch (type_) {
      case SampleType::i8:
        measure<int8_t>(bytes, as_it_is);
        break;
      case SampleType::u16:
        measure<uint16_t>(bytes, as_it_is);
        break;
      case SampleType::i16:
        measure<int16_t>(bytes, as_it_is);
        break;
      case SampleType::f32:
        measure<float>(bytes, as_it_is);
        break;
      case SampleType::f16:
        measure<uint16_t>(bytes, half_to_float);
        break;
      default:
        measure<uint8_t>(bytes, as_it_is);
        break;
    }
    return DenseSink::put(bytes);
  }

  Status complete() override {
    // Standard output cannot be gone back in: the header keeps saying that the range is not known.
    if (file_->temporary().empty() || count_ == 0) return {};
    const float range[3] = {static_cast<float>(lo_), static_cast<float>(hi_),
                            static_cast<float>(sum_ / static_cast<double>(count_))};
    const int fd = ::open(file_->temporary().c_str(), O_WRONLY | O_CLOEXEC);
    const bool written = fd >= 0 && ::pwrite(fd, range, sizeof(range), at_range) == sizeof(range);
    const int error = errno;
    if (fd >= 0) ::close(fd);
    if (written) return {};
    return fail(ErrorCode::output, file_->name(), fmt::format("cannot be written: {}", std::strerror(error)));
  }

 private:
  template <class T, class Value>
  void measure(std::span<const std::byte> bytes, const Value& value_of) {
    for (size_t i = 0; i < bytes.size(); i += sizeof(T)) {
      T sample;
      std::memcpy(&sample, bytes.data() + i, sizeof(T));
      const double value = value_of(sample);
      if (std::isnan(value)) continue;
      lo_ = std::min(lo_, value);
      hi_ = std::max(hi_, value);
      sum_ += value;
      ++count_;
    }
  }

  SampleType type_;
  double lo_ = std::numeric_limits<double>::infinity(), hi_ = -lo_, sum_ = 0;
  uint64_t count_ = 0;
};

/// Lengths and angles of a cell whose first axis is along x and whose second is in the plane of x and y.
bool is_cell(const Affine& affine) {
  const auto& [a, b, c] = affine.axes;
  return a[0] > 0 && a[1] == 0 && a[2] == 0 && b[1] > 0 && b[2] == 0 && c[2] > 0;
}

double angle_between(const Affine::Vector& a, const Affine::Vector& b) {
  const double product = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  if (product == 0) return 90;
  const double lengths = std::hypot(a[0], a[1], a[2]) * std::hypot(b[0], b[1], b[2]);
  return std::acos(std::clamp(product / lengths, -1.0, 1.0)) * (180 / 3.14159265358979323846);
}

/// The number of the first voxel, where that says to the last bit what floats of 32 bits do not.
std::optional<std::array<int32_t, 3>> start_of(const Affine& affine) {
  Affine moved = affine;
  moved.origin = {};
  Affine::Vector start{};
  bool exact = true;
  for (size_t k = 3; k-- > 0;) {  // the cell's axes are a triangle
    double rest = affine.origin[k];
    for (size_t j = k + 1; j < 3; ++j) rest -= start[j] * affine.axes[j][k];
    start[k] = std::nearbyint(rest / affine.axes[k][k]);
    if (!(std::abs(start[k]) < 1e9)) return std::nullopt;
    exact &= static_cast<double>(static_cast<float>(affine.origin[k])) == affine.origin[k];
  }
  if (exact || moved.place(start) != affine.origin) return std::nullopt;
  return std::array<int32_t, 3>{static_cast<int32_t>(start[0]), static_cast<int32_t>(start[1]),
                                static_cast<int32_t>(start[2])};
}

void write_placement(const std::string& path, const VolumeInfo& info, Header& header, Context& ctx) {
  Affine affine = info.affine;
  if (info.unit == Unit::unknown) {
    if (affine != Affine{})
      ctx.note(fmt::format(
          "{}: the unit of the volume is not known: MRC has angstrom only, and lengths are written "
          "as they are",
          path));
  } else if (info.unit != Unit::angstrom) {
    affine = in_unit(affine, info.unit, Unit::angstrom);
  }
  if (!is_cell(affine)) affine = Affine::plain(affine.spacing(), affine.origin);
  const Affine::Vector steps = affine.spacing();
  const auto& [a, b, c] = affine.axes;
  const double angles[3] = {angle_between(b, c), angle_between(a, c), angle_between(a, b)};
  const auto start = start_of(affine);
  for (size_t i = 0; i < 3; ++i) {
    const int32_t side = static_cast<int32_t>(info.dims[static_cast<int>(i)]);
    header.set(at_dims + 4 * i, side);
    header.set(at_samples + 4 * i, side);
    header.set(at_cell + 4 * i, static_cast<float>(steps[i] * side));
    header.set(at_angles + 4 * i, static_cast<float>(angles[i]));
    header.set(at_axes + 4 * i, static_cast<int32_t>(i + 1));
    if (start) {
      header.set(at_start + 4 * i, (*start)[i]);
    } else {
      header.set(at_origin + 4 * i, static_cast<float>(affine.origin[i]));
    }
  }
}

Header make_header(const std::string& path, const VolumeInfo& info, const SampleLayout& layout,
                   Context& ctx) {
  Header header;
  write_placement(path, info, header, ctx);
  int32_t mode = 0;
  if (layout.type == SampleType::i16) mode = 1;
  if (layout.type == SampleType::f32) mode = 2;
  if (layout.type == SampleType::u16) mode = 6;
  if (layout.type == SampleType::f16) mode = 12;
  header.set(at_mode, mode);
  if (mode == 0) {
    const bool placed = info.affine.origin != Affine::Vector{};
    header.set(at_imod_stamp, imod_stamp);
    header.set(at_imod_flags,
               (layout.type == SampleType::i8 ? imod_signed : 0) | (placed ? imod_standard_origin : 0));
  }
  // By the standard these say: not known (greatest below least, mean below both, rms below zero).
  header.set(at_range, 0.0f);
  header.set(at_range + 4, -1.0f);
  header.set(at_range + 8, -2.0f);
  header.set(at_rms, -1.0f);
  header.set(at_space_group, int32_t{1});
  header.set(at_version, int32_t{20141});
  std::memcpy(header.bytes.data() + at_map, "MAP DD\0\0", 8);
  if (!info.description.empty()) {
    std::string text = cut_text(info.description, label_bytes);
    if (text.size() < info.description.size())
      ctx.note(
          fmt::format("{}: the description is cut to {} bytes, which MRC has for it", path, text.size()));
    text.resize(label_bytes, ' ');
    std::memcpy(header.bytes.data() + at_labels, text.data(), label_bytes);
    header.set(at_label_count, int32_t{1});
  }
  return header;
}

/// The samples to write: integers of more than 16 bits as floats, where these hold them.
Result<SampleLayout> layout_of(const VolumeInfo& info, const std::string& path, Context& ctx) {
  SampleLayout layout = storage_layout(info, true);
  if (info.format == VoxelFormat::bitmap) layout.type = SampleType::u8;
  if (!is_wide(layout.type)) return layout;
  layout.type = SampleType::f32;
  if (info.format == VoxelFormat::float32) return layout;
  const double last = info.labels                            ? static_cast<double>(info.labels->size() - 1)
                      : info.format == VoxelFormat::density8 ? 255
                                                             : 65535;
  constexpr double most = 1 << 24;
  if (std::abs(info.sample(0)) > most || std::abs(info.sample(last)) > most)
    return fail(ErrorCode::usage, path,
                fmt::format("MRC holds no integers of more than 16 bits, and floats not those from {} to {}: "
                            "expected --type f32, which rounds them",
                            info.sample(0), info.sample(last)));
  ctx.note(fmt::format("{}: MRC holds no integers of more than 16 bits: {} are written as floats, exactly",
                       path, name(info.sample_type)));
  return layout;
}

}  // namespace

SinkResult create_mrc(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  if (is_color(info.format))
    return fail(ErrorCode::usage, path,
                fmt::format("MRC holds no colours: expected scalars, not {}", name(info.format)));
  for (int i = 0; i < 3; ++i)
    if (info.dims[i] > std::numeric_limits<int32_t>::max())
      return fail(ErrorCode::usage, path,
                  fmt::format("a side of {} voxels: expected less than 2^31 in MRC", info.dims[i]));
  VOX_TRY(const SampleLayout layout, layout_of(info, path, ctx));
  VOX_TRY(auto file, OutputFile::create(path, force));
  note_dropped(
      path, "MRC",
      not_held(info, {.place = true, .directions = is_cell(info.affine), .unit = true, .description = true}),
      ctx);
  VOX_CHECK(file->write(make_header(path, info, layout, ctx).bytes));
  return std::make_unique<MrcSink>(std::move(file), info, layout);
}

}  // namespace voxkit
