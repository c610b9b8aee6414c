#include "formats/volume/dense_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>
#include <type_traits>
#include <vector>

#include "formats/parallel.h"
#include "formats/volume/half.h"
#include "formats/volume/wide_integers.h"

namespace voxkit {
namespace {

static_assert(std::endian::native == std::endian::little, "samples are converted for little-endian memory");

constexpr size_t buffer_bytes = size_t{1} << 20;

template <class T>
T swap_bytes(T value) {
  if constexpr (sizeof(T) == 2) return static_cast<T>(__builtin_bswap16(static_cast<uint16_t>(value)));
  if constexpr (sizeof(T) == 4) return static_cast<T>(__builtin_bswap32(static_cast<uint32_t>(value)));
  if constexpr (sizeof(T) == 8) return static_cast<T>(__builtin_bswap64(static_cast<uint64_t>(value)));
  return value;
}

/// out[i] = convert(in[i]) where in[i] are unsigned words of a type's size, in the machine's byte order.
template <class Word, bool swapped, class Convert>
void convert_words(const std::byte* in, int64_t count, std::byte* out, Convert convert) {
  using Out = decltype(convert(Word{}));
  for (int64_t i = 0; i < count; ++i) {
    Word word;
    std::memcpy(&word, in + i * sizeof(Word), sizeof(Word));
    if constexpr (swapped) word = swap_bytes(word);
    const Out value = convert(word);
    std::memcpy(out + i * sizeof(Out), &value, sizeof(Out));
  }
}

template <class Word, class Convert>
void convert_words(const std::byte* in, bool swapped, int64_t count, std::byte* out, Convert convert) {
  if (swapped) return convert_words<Word, true>(in, count, out, convert);
  convert_words<Word, false>(in, count, out, convert);
}

/// Samples of a type that is held as FLOAT32, rounded to nearest.
template <class Sample>
void convert_to_float(const std::byte* in, bool swapped, int64_t count, std::byte* out) {
  using Word = std::conditional_t<sizeof(Sample) == 4, uint32_t, uint64_t>;
  convert_words<Word>(in, swapped, count, out,
                      [](Word word) { return static_cast<float>(std::bit_cast<Sample>(word)); });
}

/// Bits `first` to `first + count` of `in`, lowest bit of a byte first, to bytes 0 and 1.
void unpack_bits(const std::byte* in, uint64_t first, int64_t count, std::byte* out) {
  const uint64_t end = first + static_cast<uint64_t>(count);
  uint64_t i = first;
  const auto one = [&] { *out++ = in[i / 8] >> (i % 8) & std::byte{1}, ++i; };
  while (i < end && i % 8 != 0) one();
  for (; i + 8 <= end; i += 8, out += 8) {
    // Copies the byte to all eight, keeps bit k in byte k, and brings it down to 0 or 1.
    const uint64_t copies = std::to_integer<uint64_t>(in[i / 8]) * 0x0101010101010101;
    const uint64_t chosen = copies & 0x8040201008040201;
    const uint64_t bytes = (chosen + 0x7f7f7f7f7f7f7f7f) >> 7 & 0x0101010101010101;
    std::memcpy(out, &bytes, 8);
  }
  while (i < end) one();
}

const std::string rounding_note = "64-bit floats are rounded to 32 bits; those beyond 3.4e38 become infinite";

/// Whether some double is not a float. NaN may differ in its payload.
Result<bool> rounds_doubles(std::span<const std::byte> samples, bool big_endian, Context& ctx) {
  constexpr int64_t part = int64_t{1} << 20;
  const auto count = static_cast<int64_t>(samples.size() / sizeof(double));
  std::atomic<bool> rounds = false;
  VOX_CHECK(parallel_for(ctx, (count + part - 1) / part, [&](int64_t k) -> Status {
    bool some = false;
    for (int64_t i = k * part, end = std::min(count, i + part); i < end && !rounds; ++i) {
      uint64_t word;
      std::memcpy(&word, samples.data() + i * 8, 8);
      const auto value = std::bit_cast<double>(big_endian ? swap_bytes(word) : word);
      some |= static_cast<double>(static_cast<float>(value)) != value && value == value;
    }
    if (some) rounds = true;
    return {};
  }));
  return rounds.load();
}

/// Whether the bytes in the file are the bytes in memory.
bool same_layout(const SampleLayout& layout, VoxelFormat format) {
  if (layout.type == SampleType::u8) return format != VoxelFormat::bitmap;
  if (layout.type == SampleType::bit) return false;
  const bool native = !layout.big_endian;
  return native && (layout.type == SampleType::u16 || layout.type == SampleType::f32);
}

/// The runs of a box that are contiguous in `out` and in the file at once: rows, slices or the whole of it.
struct Runs {
  Runs(const Box& box, Index3 dims, VoxelSpan out, VoxelFormat format) : out_(out), rows_(box.size().y) {
    const Index3 size = box.size();
    const int64_t bytes = voxel_bytes(format);
    voxels = size.x;
    count = size.y * size.z;
    if (size.x != dims.x || (size.y > 1 && out.row_stride != size.x * bytes)) return;
    voxels *= size.y;
    count = size.z;
    rows_ = 1;
    if (size.y != dims.y || (size.z > 1 && out.slice_stride != size.x * size.y * bytes)) return;
    voxels *= size.z;
    count = 1;
  }
  /// Row and slice within the box at which a run begins.
  int64_t y(int64_t run) const { return run % rows_; }
  int64_t z(int64_t run) const { return run / rows_; }
  std::byte* memory(int64_t run) const { return out_.row(y(run), z(run)); }

  int64_t voxels = 0;  ///< in each run
  int64_t count = 0;

 private:
  VoxelSpan out_;
  int64_t rows_;
};

class MappedSource final : public VolumeSource {
 public:
  MappedSource(std::shared_ptr<const MappedFile> file, uint64_t offset, const VolumeInfo& info,
               const SampleLayout& layout)
      : file_(std::move(file)), samples_(file_->bytes().data() + offset), layout_(layout) {
    info_ = info;
  }

  Status read(const Box& box, VoxelSpan out) override {
    if (box.empty()) return {};
    if (!info_.box().contains(box)) return fail(ErrorCode::internal, file_->name(), "box outside the volume");
    const Runs runs(box, info_.dims, out, info_.format);
    for (int64_t run = 0; run < runs.count; ++run) {
      const int64_t y = box.lo.y + runs.y(run), z = box.lo.z + runs.z(run);
      const int64_t voxel = (z * info_.dims.y + y) * info_.dims.x + box.lo.x;
      if (layout_.type == SampleType::bit) {
        unpack_bits(samples_, static_cast<uint64_t>(voxel), runs.voxels, runs.memory(run));
      } else {
        convert_samples(samples_ + voxel * layout_.bytes_per_voxel(), layout_, runs.voxels, info_,
                        runs.memory(run));
      }
    }
    return {};
  }
  void expect(int64_t z0, int64_t z1) const override { expect_bytes(slices(z0, z1)); }
  void release(int64_t z0, int64_t z1) const override { release_bytes(slices(z0, z1)); }

 private:
  /// Slices are one stretch of the file.
  std::span<const std::byte> slices(int64_t z0, int64_t z1) const {
    const uint64_t slice = static_cast<uint64_t>(info_.dims.x) * static_cast<uint64_t>(info_.dims.y);
    const uint64_t lo = layout_.file_bytes(slice * static_cast<uint64_t>(z0)).value_or(0);
    const uint64_t hi = layout_.file_bytes(slice * static_cast<uint64_t>(z1)).value_or(0);
    return {samples_ + lo, std::max(lo, hi) - lo};
  }

  std::shared_ptr<const MappedFile> file_;
  const std::byte* samples_;
  SampleLayout layout_;
};

class StreamedSource final : public VolumeSource {
 public:
  StreamedSource(std::unique_ptr<InputStream> stream, const VolumeInfo& info, const SampleLayout& layout)
      : stream_(std::move(stream)), layout_(layout), start_(stream_->position()) {
    info_ = info;
  }
  bool forward_only() const override { return true; }

  Status read(const Box& box, VoxelSpan out) override {
    const Index3 dims = info_.dims;
    if (box.lo.x != 0 || box.lo.y != 0 || box.hi.x != dims.x || box.hi.y != dims.y || box.lo.z < next_z_ ||
        box.hi.z <= box.lo.z || box.hi.z > dims.z || layout_.type == SampleType::bit)
      return fail(ErrorCode::internal, stream_->name(),
                  fmt::format("slices {} to {} asked of a stream at slice {}: expected whole slices in order",
                              box.lo.z, box.hi.z, next_z_));
    if (box.lo.z > next_z_) {
      const uint64_t gap = static_cast<uint64_t>((box.lo.z - next_z_) * dims.x * dims.y);
      VOX_CHECK(stream_->skip(layout_.file_bytes(gap).value_or(UINT64_MAX)));
    }
    next_z_ = box.hi.z;
    const Runs runs(box, dims, out, info_.format);
    VOX_CHECK(read_runs(runs));
    if (next_z_ == dims.z) VOX_CHECK(stream_->check_end());
    return {};
  }

 private:
  Status read_runs(const Runs& runs) {
    const int64_t bytes = layout_.bytes_per_voxel();
    if (same_layout(layout_, info_.format) && runs.voxels * bytes >= int64_t{1} << 16) {
      for (int64_t run = 0; run < runs.count; ++run)
        VOX_CHECK(read_samples({runs.memory(run), static_cast<size_t>(runs.voxels * bytes)}));
      return {};
    }
    buffer_.resize(buffer_bytes);
    const int64_t capacity = static_cast<int64_t>(buffer_bytes) / bytes;
    int64_t buffered = 0, used = 0, left = runs.voxels * runs.count;
    for (int64_t run = 0; run < runs.count; ++run)
      for (int64_t done = 0; done < runs.voxels;) {
        if (used == buffered) {
          buffered = std::min(capacity, left);
          VOX_CHECK(read_samples(std::span(buffer_).first(static_cast<size_t>(buffered * bytes))));
          left -= buffered;
          used = 0;
        }
        const int64_t n = std::min(runs.voxels - done, buffered - used);
        convert_samples(buffer_.data() + used * bytes, layout_, n, info_,
                        runs.memory(run) + done * voxel_bytes(info_.format));
        used += n;
        done += n;
      }
    return {};
  }

  Status read_samples(std::span<std::byte> out) {
    VOX_TRY(const size_t count, stream_->read(out));
    if (count == out.size()) return {};
    const uint64_t expected = layout_.file_bytes(checked_voxels(info_.dims).value_or(0)).value_or(0);
    return bad_input(stream_->name(), fmt::format("voxel data end after {} bytes: expected {}",
                                                  stream_->position() - start_, expected));
  }

  std::unique_ptr<InputStream> stream_;
  SampleLayout layout_;
  uint64_t start_;
  int64_t next_z_ = 0;
  std::vector<std::byte> buffer_;
};

}  // namespace

std::optional<uint64_t> SampleLayout::file_bytes(uint64_t voxels) const {
  if (type == SampleType::bit) return voxels / 8 + (voxels % 8 != 0);
  uint64_t bytes = 0;
  if (__builtin_mul_overflow(voxels, static_cast<uint64_t>(bytes_per_voxel()), &bytes)) return std::nullopt;
  return bytes;
}

void convert_samples(const std::byte* in, const SampleLayout& layout, int64_t count, const VolumeInfo& info,
                     std::byte* out) {
  if (same_layout(layout, info.format)) {
    std::memcpy(out, in, static_cast<size_t>(count * layout.bytes_per_voxel()));
    return;
  }
  const bool swapped = layout.big_endian;
  switch (layout.type) {
    case SampleType::bit:
      return unpack_bits(in, 0, count, out);
    case SampleType::u8:  // as it is, but for BITMAP
      return convert_words<uint8_t, false>(in, count, out,
                                           [](uint8_t v) { return static_cast<uint8_t>(v != 0); });
    case SampleType::i8:
      return convert_words<uint8_t, false>(in, count, out,
                                           [](uint8_t v) { return static_cast<uint8_t>(v ^ 0x80); });
    case SampleType::u16:
      return convert_words<uint16_t>(in, swapped, count, out, [](uint16_t v) { return v; });
    case SampleType::i16:
      return convert_words<uint16_t>(in, swapped, count, out,
                                     [](uint16_t v) { return static_cast<uint16_t>(v ^ 0x8000); });
    case SampleType::f32:
      return convert_words<uint32_t>(in, swapped, count, out, [](uint32_t v) { return v; });
    case SampleType::f16:
      return convert_words<uint16_t>(in, swapped, count, out, half_to_float);
    case SampleType::u32:
    case SampleType::i32:
    case SampleType::u64:
    case SampleType::i64:
      return from_wide(in, swapped, count, info, out);
    case SampleType::f64:
      return convert_to_float<double>(in, swapped, count, out);
  }
}

Result<std::unique_ptr<VolumeSource>> mapped_source(std::shared_ptr<const MappedFile> file, uint64_t offset,
                                                    const VolumeInfo& info, const SampleLayout& layout,
                                                    const OpenOptions& options, Context& ctx) {
  const auto voxels = checked_voxels(info.dims);
  const auto bytes = voxels ? layout.file_bytes(*voxels) : std::nullopt;
  if (!bytes) return bad_input(file->name(), "the volume is too large: expected at most 2^62 voxels");
  const uint64_t there = file->bytes().size();
  const uint64_t found = there - std::min(there, offset);
  if (*bytes > found)
    return bad_input(file->name(), fmt::format("voxel data at byte {} end after {} bytes: expected {}",
                                               offset, found, *bytes));
  VolumeInfo held = info;
  if (layout.type == SampleType::f64) {
    VOX_TRY(held.rounded, rounds_doubles(file->bytes().subspan(offset, *bytes), layout.big_endian, ctx));
    if (held.rounded) ctx.note(file->name() + ": " + rounding_note);
  }
  if (is_wide(layout.type)) {
    held.sample_type = layout.type;
    VOX_CHECK(fit_wide_integers(file->bytes().subspan(offset, *bytes), layout.big_endian, options.round_wide,
                                file->name(), held, ctx));
  }
  return std::make_unique<MappedSource>(std::move(file), offset, held, layout);
}

Result<std::unique_ptr<VolumeSource>> streamed_source(std::unique_ptr<InputStream> stream,
                                                      const VolumeInfo& info, const SampleLayout& layout,
                                                      const OpenOptions& options, Context& ctx) {
  if (layout.type == SampleType::f64) {  // whether some needs more is only known in the end
    ctx.note(stream->name() + ": " + rounding_note);
    VolumeInfo held = info;
    held.rounded = true;
    return std::make_unique<StreamedSource>(std::move(stream), held, layout);
  }
  if (!is_wide(layout.type)) return std::make_unique<StreamedSource>(std::move(stream), info, layout);
  VOX_TRY(auto file, MappedFile::spool(*stream));
  return mapped_source(std::move(file), 0, info, layout, options, ctx);
}

}  // namespace voxkit
