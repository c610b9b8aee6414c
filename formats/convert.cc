#include "formats/convert.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "formats/copy.h"

namespace voxkit {
namespace {

std::string describe(const Box& b) {
  return fmt::format("{},{},{}..{},{},{}", b.lo.x, b.lo.y, b.lo.z, b.hi.x, b.hi.y, b.hi.z);
}

class CroppedSource : public VolumeSource {
 public:
  CroppedSource(std::unique_ptr<VolumeSource> source, const Box& box, std::unique_ptr<Buffer> slice)
      : source_(std::move(source)), box_(box), slice_(std::move(slice)) {
    info_ = source_->info();
    info_.dims = box.size();
    info_.affine = info_.affine.moved_to(
        {static_cast<double>(box.lo.x), static_cast<double>(box.lo.y), static_cast<double>(box.lo.z)});
    info_.range.reset();  // a part may have a smaller one
  }
  bool forward_only() const override { return source_->forward_only(); }
  std::optional<Voxel> uniform(const Box& box) const override { return source_->uniform(inner(box)); }
  void expect(int64_t z0, int64_t z1) const override { source_->expect(z0 + box_.lo.z, z1 + box_.lo.z); }
  void release(int64_t z0, int64_t z1) const override { source_->release(z0 + box_.lo.z, z1 + box_.lo.z); }

  Status read(const Box& box, VoxelSpan out) override {
    if (!slice_) return source_->read(inner(box), out);
    // A forward-only source gives whole slices, of which this is a part.
    const Index3 dims = source_->info().dims;
    const VoxelSpan slice = packed(slice_->data(), dims, info_.format);
    for (int64_t z = box.lo.z; z < box.hi.z; ++z) {
      const int64_t from = z + box_.lo.z;
      VOX_CHECK(source_->read({{0, 0, from}, {dims.x, dims.y, from + 1}}, slice));
      const ConstVoxelSpan part{slice.row(box_.lo.y, 0) + box_.lo.x * voxel_bytes(info_.format),
                                slice.row_stride, slice.slice_stride};
      copy(part, {out.row(0, z - box.lo.z), out.row_stride, out.slice_stride},
           {info_.dims.x, info_.dims.y, 1}, info_.format);
    }
    return {};
  }

 private:
  Box inner(const Box& box) const { return {box.lo + box_.lo, box.hi + box_.lo}; }

  std::unique_ptr<VolumeSource> source_;
  Box box_;
  std::unique_ptr<Buffer> slice_;  ///< one slice of a forward-only source that is cut in x or y
};

/// Luma of Rec. 709 in units of 1/10000; below, rounded half up.
uint32_t luma(const uint8_t* rgb) {
  return 2126u * rgb[0] + 7152u * rgb[1] + 722u * rgb[2];
}
uint8_t luma_rgb24(const uint8_t* rgb) {
  return static_cast<uint8_t>((luma(rgb) + 5000) / 10000);
}
uint8_t luma_rgba32(const uint8_t* rgba) {
  constexpr uint64_t one = 10000 * 255;
  return static_cast<uint8_t>((uint64_t{luma(rgba)} * rgba[3] + one / 2) / one);
}

/// Makes one voxel of another, through a table where the source has few values.
class Conversion {
 public:
  /// `of_value` makes the new voxel of a sample value, with the bias removed.
  Conversion(const VolumeInfo& from, VoxelFormat to, std::function<Voxel(double)> of_value)
      : from_(from.format), to_(to), of_value_(std::move(of_value)) {
    if (from_ == VoxelFormat::float32) return;
    const int values = from_ == VoxelFormat::density16 ? 65536 : 256;
    table_.reserve(static_cast<size_t>(values));
    for (int stored = 0; stored < values; ++stored) table_.push_back(of_value_(from.sample(stored)));
  }

  void row(const std::byte* in, int64_t count, std::byte* out) const {
    switch (from_) {
      case VoxelFormat::rgba32:
        return row(in, count, out, [&](const uint8_t* v) { return table_[luma_rgba32(v)]; });
      case VoxelFormat::rgb24:
        return row(in, count, out, [&](const uint8_t* v) { return table_[luma_rgb24(v)]; });
      case VoxelFormat::density16:
        return row(in, count, out, [&](const uint8_t* v) { return table_[v[0] | v[1] << 8]; });
      case VoxelFormat::float32:
        return row(in, count, out, [&](const uint8_t* v) {
          float value;
          std::memcpy(&value, v, sizeof value);
          return of_value_(value);
        });
      default:
        return row(in, count, out, [&](const uint8_t* v) { return table_[*v]; });
    }
  }

 private:
  template <class Make>
  void row(const std::byte* in, int64_t count, std::byte* out, Make make) const {
    const auto* from = reinterpret_cast<const uint8_t*>(in);
    const size_t in_bytes = static_cast<size_t>(voxel_bytes(from_)),
                 out_bytes = static_cast<size_t>(voxel_bytes(to_));
    for (int64_t i = 0; i < count; ++i, from += in_bytes, out += out_bytes) {
      const Voxel voxel = make(from);
      std::memcpy(out, voxel.bytes.data(), out_bytes);
    }
  }

  VoxelFormat from_, to_;
  std::function<Voxel(double)> of_value_;
  std::vector<Voxel> table_;
};

using RowFunction = std::function<void(const std::byte* in, int64_t count, std::byte* out)>;

class ConvertedSource : public VolumeSource {
 public:
  ConvertedSource(std::unique_ptr<VolumeSource> source, const VolumeInfo& info, RowFunction row,
                  std::unique_ptr<Buffer> slice)
      : source_(std::move(source)), row_(std::move(row)), slice_(std::move(slice)) {
    info_ = info;
  }
  bool forward_only() const override { return source_->forward_only(); }
  void expect(int64_t z0, int64_t z1) const override { source_->expect(z0, z1); }
  void release(int64_t z0, int64_t z1) const override { source_->release(z0, z1); }

  std::optional<Voxel> uniform(const Box& box) const override {
    auto value = source_->uniform(box);
    if (!value) return value;
    Voxel out;
    row_(value->bytes.data(), 1, out.bytes.data());
    return out;
  }

  Status read(const Box& box, VoxelSpan out) override {
    const VoxelFormat format = source_->info().format;
    const Index3 size = box.size();
    const int64_t slice_bytes = size.x * size.y * voxel_bytes(format);
    // Slices are read by the few, so that the voxels between the two steps stay in the cache.
    const int64_t step = slice_ ? 1 : std::clamp<int64_t>((int64_t{1} << 20) / slice_bytes, 1, size.z);
    std::unique_ptr<std::byte[]> own;
    if (!slice_) own.reset(new std::byte[static_cast<size_t>(slice_bytes * step)]);
    std::byte* data = slice_ ? slice_->data() : own.get();
    for (int64_t z = box.lo.z; z < box.hi.z; z += step) {
      Box part = box;
      part.lo.z = z;
      part.hi.z = std::min(z + step, box.hi.z);
      const VoxelSpan in = packed(data, part.size(), format);
      VOX_CHECK(source_->read(part, in));
      for (int64_t k = 0; k < part.size().z; ++k)
        for (int64_t j = 0; j < size.y; ++j) row_(in.row(j, k), size.x, out.row(j, z - box.lo.z + k));
    }
    return {};
  }

 private:
  std::unique_ptr<VolumeSource> source_;
  RowFunction row_;
  std::unique_ptr<Buffer> slice_;  ///< one slice of a forward-only source
};

/// Memory for the slices of a forward-only source; nothing for others, whose readers ask for small boxes.
Result<std::unique_ptr<Buffer>> slice_buffer(const VolumeSource& source, Context& ctx) {
  if (!source.forward_only()) return nullptr;
  Box slice = source.info().box();
  slice.hi.z = 1;
  return Buffer::allocate(Slabs(slice, voxel_bytes(source.info().format), 0).bytes(), "a slice of voxels",
                          ctx);
}

/// Of integers that floats of 32 bits may not hold, it is said that they are rounded.
void note_rounding(const VolumeInfo& from, Context& ctx) {
  constexpr double most = 0x1p24;
  if (is_color(from.format) || from.format == VoxelFormat::float32) return;
  const double lo = from.sample(0), hi = from.labels ? from.sample(0x1p16) : lo + 65535;
  if (lo < -most || hi > most)
    ctx.note("integers of more than 24 bits become the nearest 32-bit floats, which may be equal");
}

/// Says once what becomes of NaN and infinities in integers.
class NonFiniteNote {
 public:
  explicit NonFiniteNote(const Context& ctx)
      : note_(ctx.note), said_(std::make_shared<std::atomic<bool>>(false)) {}
  void operator()() const {
    if (!said_->exchange(true)) note_("NaN and -infinity become the least integer, infinity the greatest");
  }

 private:
  std::function<void(const std::string&)> note_;
  std::shared_ptr<std::atomic<bool>> said_;
};

Result<std::unique_ptr<VolumeSource>> converted(std::unique_ptr<VolumeSource> source, const VolumeInfo& info,
                                                RowFunction row, Context& ctx) {
  VOX_TRY(auto slice, slice_buffer(*source, ctx));
  return std::make_unique<ConvertedSource>(std::move(source), info, std::move(row), std::move(slice));
}

/// Least and greatest value of the integer types; of a float they are not finite.
ValueRange limits(SampleType type) {
  switch (type) {
    case SampleType::bit:
      return {0, 1};
    case SampleType::u8:
      return {0, 255};
    case SampleType::i8:
      return {-128, 127};
    case SampleType::u16:
      return {0, 65535};
    case SampleType::i16:
      return {-32768, 32767};
    case SampleType::u32:
      return {0, 4294967295.0};
    case SampleType::i32:
      return {-2147483648.0, 2147483647.0};
    case SampleType::u64:
      return {0, 18446744073709551615.0};
    case SampleType::i64:
      return {-9223372036854775808.0, 9223372036854775807.0};
    default:
      return {-HUGE_VAL, HUGE_VAL};
  }
}

bool fits(const ValueRange& inner, const ValueRange& outer) {
  return inner.lo >= outer.lo && inner.hi <= outer.hi;
}

/// Least and greatest sample value that a volume may have.
ValueRange possible_values(const VolumeInfo& info) {
  if (info.labels) return {info.sample(0), info.sample(65535)};
  if (is_color(info.format) || info.format == VoxelFormat::density8)
    return {info.sample(0), info.sample(255)};
  return info.format == VoxelFormat::density16 ? ValueRange{info.sample(0), info.sample(65535)}
                                               : limits(info.sample_type);
}

Voxel store(double value, const TargetType& type) {
  const double stored = value + storage_bias(type.sample_type);
  switch (type.format) {
    case VoxelFormat::density16:
      return Voxel::of(static_cast<uint16_t>(stored));
    case VoxelFormat::float32:
      return Voxel::of(static_cast<float>(value));
    case VoxelFormat::rgba32:
      return Voxel::of(static_cast<uint32_t>(value) * 0x01010101u);
    default:
      return Voxel::of(static_cast<uint8_t>(stored));
  }
}

/// The rows of a conversion that a table of sample values cannot express; empty if it can.
RowFunction special_rows(VoxelFormat from, const TargetType& to) {
  if (from == VoxelFormat::rgb24 && to.format == VoxelFormat::rgba32) {
    return [](const std::byte* in, int64_t count, std::byte* out) {
      for (int64_t i = 0; i < count; ++i, in += 3, out += 4) {
        std::memcpy(out, in, 3);
        out[3] = std::byte{255};
      }
    };
  }
  if (!is_color(from) || to.format != VoxelFormat::bitmap) return {};
  return [from](const std::byte* in, int64_t count, std::byte* out) {
    const int bytes = voxel_bytes(from);
    for (int64_t i = 0; i < count; ++i, in += bytes)
      out[i] = std::byte{from == VoxelFormat::rgba32 ? in[3] != std::byte{0}
                                                     : (in[0] | in[1] | in[2]) != std::byte{0}};
  };
}

}  // namespace

Result<std::unique_ptr<VolumeSource>> crop(std::unique_ptr<VolumeSource> source, const Box& box,
                                           Context& ctx) {
  const Box whole = source->info().box();
  if (box == whole) return source;
  if (box.empty() || !whole.contains(box))
    return bad_usage(fmt::format("the box {} is empty or not inside the volume: expected a box inside {}",
                                 describe(box), describe(whole)));
  std::unique_ptr<Buffer> slice;
  if (box.size().x != whole.size().x || box.size().y != whole.size().y) {
    VOX_TRY(slice, slice_buffer(*source, ctx));
  }
  return std::make_unique<CroppedSource>(std::move(source), box, std::move(slice));
}

namespace {

constexpr std::pair<std::string_view, TargetType> target_types[] = {
    {"u8", {VoxelFormat::density8, SampleType::u8}},    {"i8", {VoxelFormat::density8, SampleType::i8}},
    {"u16", {VoxelFormat::density16, SampleType::u16}}, {"i16", {VoxelFormat::density16, SampleType::i16}},
    {"f32", {VoxelFormat::float32, SampleType::f32}},   {"rgba8", {VoxelFormat::rgba32, SampleType::u8}},
    {"bit", {VoxelFormat::bitmap, SampleType::bit}}};

}  // namespace

std::vector<std::string> target_type_names() {
  std::vector<std::string> names;
  for (const auto& [known, type] : target_types) names.emplace_back(known);
  return names;
}

Result<TargetType> parse_target_type(std::string_view name) {
  for (const auto& [known, type] : target_types)
    if (known == name) return type;
  return bad_usage(fmt::format("unknown type \"{}\": expected u8, i8, u16, i16, f32, rgba8 or bit", name));
}

bool needs_range(const VolumeInfo& info, const TargetType& type) {
  if (is_color(info.format) && type.format == VoxelFormat::rgba32) return false;
  if (type.format == VoxelFormat::bitmap || type.format == VoxelFormat::float32) return false;
  return !fits(possible_values(info), limits(type.sample_type));
}

Result<std::unique_ptr<VolumeSource>> convert_type(std::unique_ptr<VolumeSource> source,
                                                   const TargetType& type, const ValueRange& range,
                                                   Context& ctx) {
  const VolumeInfo& from = source->info();
  if (from.format == type.format && (is_color(from.format) || from.sample_type == type.sample_type))
    return source;
  VolumeInfo info = from;
  info.format = type.format;
  info.sample_type = type.sample_type;
  info.range.reset();
  info.labels.reset();
  info.wide_base = 0;
  if (auto rows = special_rows(from.format, type)) {
    return converted(std::move(source), info, std::move(rows), ctx);
  }

  // Sample values -> values of the new type: kept, or lo + (v - lo) stretched.
  const ValueRange target = limits(type.sample_type);
  const ValueRange values{from.sample(range.lo), from.sample(range.hi)};
  const bool integers = std::isfinite(possible_values(from).lo);
  const bool stretch = needs_range(from, type) && !(integers && fits(values, target));
  if (stretch && !(values.lo <= values.hi && std::isfinite(values.hi - values.lo)))
    return bad_usage(fmt::format("the range {}..{} is not a range: expected finite values, the least first",
                                 values.lo, values.hi));
  // A flat volume has one value, which becomes the least of the type with a step of one.
  const double step = values.hi > values.lo ? (values.hi - values.lo) / (target.hi - target.lo) : 1;
  if (type.format == VoxelFormat::float32) note_rounding(from, ctx);
  std::function<Voxel(double)> make;
  if (type.format == VoxelFormat::bitmap) {
    make = [type](double v) { return store(v < 0 || v > 0 ? 1 : 0, type); };
  } else if (type.format == VoxelFormat::float32) {
    make = [type](double v) { return store(v, type); };
  } else if (from.format == VoxelFormat::bitmap && type.format == VoxelFormat::rgba32) {
    make = [type](double v) { return store(v > 0 ? 255 : 0, type); };
  } else if (stretch) {
    make = [type, target, values, note = NonFiniteNote(ctx)](double v) {
      if (!std::isfinite(v)) note();
      if (!(v > values.lo)) return store(target.lo, type);  // NaN too
      if (v >= values.hi) return store(values.hi > values.lo ? target.hi : target.lo, type);
      // One division of (for integers) exact numbers: the quotient is never rounded across a half.
      const double scaled = (v - values.lo) * (target.hi - target.lo) / (values.hi - values.lo);
      return store(target.lo + std::floor(scaled + 0.5), type);
    };
  } else {
    make = [type, target, note = NonFiniteNote(ctx)](double v) {
      if (!std::isfinite(v)) note();
      return store(std::isnan(v) ? target.lo : std::clamp(std::floor(v + 0.5), target.lo, target.hi), type);
    };
  }
  if (type.format == VoxelFormat::bitmap || type.format == VoxelFormat::rgba32) {
    info.slope = 1;
    info.intercept = 0;
  } else if (stretch) {
    info.intercept = from.slope * (values.lo - target.lo * step) + from.intercept;
    info.slope = from.slope * step;
  }
  return converted(
      std::move(source), info,
      [conversion = std::make_shared<Conversion>(from, type.format, std::move(make))](
          const std::byte* in, int64_t count, std::byte* out) { conversion->row(in, count, out); },
      ctx);
}

Result<std::unique_ptr<VolumeSource>> apply_scale(std::unique_ptr<VolumeSource> source, Context& ctx) {
  const VolumeInfo& from = source->info();
  if (is_color(from.format))
    return bad_usage("colours have no slope and intercept: expected a scalar volume");
  VolumeInfo info = from;
  info.format = VoxelFormat::float32;
  info.sample_type = SampleType::f32;
  info.slope = 1;
  info.intercept = 0;
  info.range.reset();
  info.labels.reset();
  info.wide_base = 0;
  note_rounding(from, ctx);
  const auto make = [slope = from.slope, intercept = from.intercept](double v) {
    return Voxel::of(static_cast<float>(slope * v + intercept));
  };
  return converted(
      std::move(source), info,
      [conversion = std::make_shared<Conversion>(from, VoxelFormat::float32, make)](
          const std::byte* in, int64_t count, std::byte* out) { conversion->row(in, count, out); },
      ctx);
}

}  // namespace voxkit
