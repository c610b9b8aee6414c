// MRC2014 and CCP4 maps, https://www.ccpem.ac.uk/mrc_format/mrc2014.php: 1024 bytes of header, symmetry
// records, samples.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/volume/dense_sink.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/readers.h"

namespace voxkit {
namespace {

constexpr size_t header_bytes = 1024;
/// Byte offsets of the fields in use.
enum : size_t {
  at_dims = 0,
  at_mode = 12,
  at_start = 16,
  at_samples = 28,
  at_cell = 40,
  at_angles = 52,
  at_axes = 64,
  at_range = 76,
  at_space_group = 88,
  at_symmetry = 92,
  at_version = 108,
  at_imod_stamp = 152,
  at_imod_flags = 156,
  at_origin = 196,
  at_map = 208,
  at_machine = 212,
  at_rms = 216
};
constexpr int32_t imod_stamp = 1146047817;  // "IMOD"
constexpr int32_t imod_signed = 1;          // bytes are signed

class Header {
 public:
  template <class T>
  T get(size_t offset) const {
    static_assert(sizeof(T) == 4);
    uint32_t word;
    std::memcpy(&word, bytes.data() + offset, 4);
    return std::bit_cast<T>(big_endian ? __builtin_bswap32(word) : word);
  }
  template <class T>
  void set(size_t offset, T value) {
    static_assert(sizeof(T) == 4);
    std::memcpy(bytes.data() + offset, &value, 4);
  }

  std::array<std::byte, header_bytes> bytes{};
  bool big_endian = false;
};

bool known_mode(int32_t mode) {
  return (mode >= 0 && mode <= 4) || mode == 6 || mode == 12 || mode == 16 || mode == 101;
}

/// Type of the samples.
Result<SampleType> sample_type(const Header& header, const std::string& name) {
  const int32_t mode = header.get<int32_t>(at_mode);
  switch (mode) {
    case 0: {
      // Signed by the standard; IMOD's programs say which.
      const bool imod = header.get<int32_t>(at_imod_stamp) == imod_stamp;
      return imod && !(header.get<int32_t>(at_imod_flags) & imod_signed) ? SampleType::u8 : SampleType::i8;
    }
    case 1:
      return SampleType::i16;
    case 2:
      return SampleType::f32;
    case 6:
      return SampleType::u16;
    case 12:
      return SampleType::f16;
    default:
      return bad_input(
          name, fmt::format("MRC header: mode {} at byte {} is unsupported: expected 0, 1, 2, 6 or 12", mode,
                            size_t{at_mode}));
  }
}

Status parse_placement(const Header& header, const std::string& name, VolumeInfo& info) {
  std::array<int32_t, 3> axes{};
  for (size_t i = 0; i < 3; ++i) axes[i] = header.get<int32_t>(at_axes + 4 * i);
  if (axes != std::array<int32_t, 3>{1, 2, 3}) {
    auto sorted = axes;
    std::sort(sorted.begin(), sorted.end());
    const bool permutation = sorted == std::array<int32_t, 3>{1, 2, 3};
    return bad_input(
        name, fmt::format("MRC header: axis order {},{},{} at byte {}{}: expected 1,2,3", axes[0], axes[1],
                          axes[2], size_t{at_axes}, permutation ? " is unsupported" : ""));
  }
  bool placed = false;
  for (size_t i = 0; i < 3; ++i) {
    const float cell = header.get<float>(at_cell + 4 * i);
    const int32_t samples = header.get<int32_t>(at_samples + 4 * i);
    if (cell > 0 && std::isfinite(cell) && samples > 0) info.affine.axes[i][i] = double{cell} / samples;
    const float origin = header.get<float>(at_origin + 4 * i);
    placed |= origin != 0;
    if (std::isfinite(origin)) info.affine.origin[i] = origin;
  }
  for (size_t i = 0; i < 3 && !placed; ++i)
    info.affine.origin[i] = header.get<int32_t>(at_start + 4 * i) * info.affine.axes[i][i];
  return {};
}

/// Writes samples and, once they are all known, their range into the header.
class MrcSink final : public DenseSink {
 public:
  MrcSink(std::unique_ptr<OutputFile> file, const VolumeInfo& info, const SampleLayout& layout)
      : DenseSink(std::move(file), info, layout), type_(layout.type) {}

 protected:
  Status put(std::span<const std::byte> bytes) override {
    switch (type_) {
      case SampleType::i8:
        measure<int8_t>(bytes);
        break;
      case SampleType::u16:
        measure<uint16_t>(bytes);
        break;
      case SampleType::i16:
        measure<int16_t>(bytes);
        break;
      case SampleType::f32:
        measure<float>(bytes);
        break;
      default:
        measure<uint8_t>(bytes);
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
  template <class T>
  void measure(std::span<const std::byte> bytes) {
    for (size_t i = 0; i < bytes.size(); i += sizeof(T)) {
      T sample;
      std::memcpy(&sample, bytes.data() + i, sizeof(T));
      const double value = sample;
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

Header make_header(const VolumeInfo& info, const SampleLayout& layout) {
  Header header;
  for (size_t i = 0; i < 3; ++i) {
    const int32_t side = static_cast<int32_t>(info.dims[static_cast<int>(i)]);
    header.set(at_dims + 4 * i, side);
    header.set(at_samples + 4 * i, side);
    header.set(at_cell + 4 * i, static_cast<float>(info.affine.axes[i][i] * side));
    header.set(at_angles + 4 * i, 90.0f);
    header.set(at_axes + 4 * i, static_cast<int32_t>(i + 1));
    header.set(at_origin + 4 * i, static_cast<float>(info.affine.origin[i]));
  }
  int32_t mode = 0;
  if (layout.type == SampleType::i16) mode = 1;
  if (layout.type == SampleType::f32) mode = 2;
  if (layout.type == SampleType::u16) mode = 6;
  header.set(at_mode, mode);
  if (mode == 0) {
    header.set(at_imod_stamp, imod_stamp);
    header.set(at_imod_flags, layout.type == SampleType::i8 ? imod_signed : 0);
  }
  // By the standard these say: not known (greatest below least, mean below both, rms below zero).
  header.set(at_range, 0.0f);
  header.set(at_range + 4, -1.0f);
  header.set(at_range + 8, -2.0f);
  header.set(at_rms, -1.0f);
  header.set(at_space_group, int32_t{1});
  header.set(at_version, int32_t{20141});
  std::memcpy(header.bytes.data() + at_map, "MAP DD\0\0", 8);
  return header;
}

}  // namespace

SourceResult open_mrc(const std::string& path, const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto file, MappedFile::open(path));
  if (file->bytes().size() < header_bytes)
    return bad_input(
        path, fmt::format("MRC header ends after {} bytes: expected {}", file->bytes().size(), header_bytes));
  Header header;
  std::memcpy(header.bytes.data(), file->bytes().data(), header_bytes);
  if (std::memcmp(header.bytes.data() + at_map, "MAP", 3) != 0)
    return bad_input(path, fmt::format("not an MRC file: expected MAP at byte {}", size_t{at_map}));
  // Some writers get the machine stamp wrong: the order in which the mode makes sense decides then.
  header.big_endian = header.bytes[at_machine] == std::byte{0x11};
  if (!known_mode(header.get<int32_t>(at_mode))) {
    header.big_endian = !header.big_endian;
    if (!known_mode(header.get<int32_t>(at_mode))) header.big_endian = !header.big_endian;
  }

  VolumeInfo info;
  for (int i = 0; i < 3; ++i) info.dims[i] = header.get<int32_t>(at_dims + 4 * static_cast<size_t>(i));
  if (!checked_voxels(info.dims))
    return bad_input(path, fmt::format("MRC header: {} x {} x {} voxels at byte 0: expected sides from 1",
                                       info.dims.x, info.dims.y, info.dims.z));
  VOX_TRY(info.sample_type, sample_type(header, path));
  info.format = scalar_format(info.sample_type);
  VOX_CHECK(parse_placement(header, path, info));
  const int32_t symmetry = header.get<int32_t>(at_symmetry);
  if (symmetry < 0)
    return bad_input(
        path, fmt::format("MRC header: {} bytes of symmetry records at byte {}: expected 0 or more", symmetry,
                          size_t{at_symmetry}));
  const SampleLayout layout{info.sample_type, 1, header.big_endian};
  const uint64_t offset = header_bytes + static_cast<uint64_t>(symmetry);
  const float lo = header.get<float>(at_range), hi = header.get<float>(at_range + 4);
  if (info.format == VoxelFormat::float32 && lo < hi && std::isfinite(lo) && std::isfinite(hi))
    info.range = ValueRange{lo, hi};
  return mapped_source(std::move(file), offset, info, layout, options, ctx);
}

SinkResult create_mrc(const std::string& path, const VolumeInfo& info, bool force, Context&) {
  if (is_colour(info.format))
    return fail(ErrorCode::usage, path,
                fmt::format("MRC holds no colours: expected scalars, not {}", name(info.format)));
  for (int i = 0; i < 3; ++i)
    if (info.dims[i] > std::numeric_limits<int32_t>::max())
      return fail(ErrorCode::usage, path,
                  fmt::format("a side of {} voxels: expected less than 2^31 in MRC", info.dims[i]));
  SampleLayout layout = storage_layout(info);
  if (info.format == VoxelFormat::bitmap) layout.type = SampleType::u8;
  if (info.format == VoxelFormat::float32) layout.type = SampleType::f32;
  VOX_TRY(auto file, OutputFile::create(path, force));
  VOX_CHECK(file->write(make_header(info, layout).bytes));
  return std::make_unique<MrcSink>(std::move(file), info, layout);
}

}  // namespace voxkit
