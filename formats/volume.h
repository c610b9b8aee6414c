// What a volume is: voxel formats, extents, boxes, and the facts that travel with the voxels.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <glm/ext/vector_int3_sized.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/affine.h"
#include "formats/hd.h"

namespace voxkit {

/// Voxel coordinates and extents: 64 bits, so that products of extents to 2^20 a side stay exact.
using Index3 = glm::i64vec3;

/// Largest extent a side. Products of three are formed with `checked_voxels`.
inline constexpr int64_t max_side = int64_t{1} << 31;

/// How one voxel is held in memory and in files of ours (thesis section 2.2.1). Numbers are part of
/// FORMAT.md.
enum class VoxelFormat : uint8_t {
  rgba32 = 1,     ///< 4 bytes R, G, B, A, 0..255; alpha is coverage, 0 = void
  rgb24 = 2,      ///< 3 bytes R, G, B
  density8 = 3,   ///< 1 byte, 0..255
  density16 = 4,  ///< 2 bytes little endian, 0..65535
  float32 = 5,    ///< 4 bytes, IEEE 754
  bitmap = 6,     ///< 0 or 1; one byte a voxel in memory, one bit in raw_bytes
};

/// Bytes of one voxel in a memory box.
constexpr int voxel_bytes(VoxelFormat f) {
  switch (f) {
    case VoxelFormat::rgba32:
      return 4;
    case VoxelFormat::rgb24:
      return 3;
    case VoxelFormat::density8:
      return 1;
    case VoxelFormat::density16:
      return 2;
    case VoxelFormat::float32:
      return 4;
    case VoxelFormat::bitmap:
      return 1;
  }
  return 0;
}
/// Number of attributes n of a voxel, as in the thesis' quality rule (section 2.1.1).
constexpr int attributes(VoxelFormat f) {
  return f == VoxelFormat::rgba32 ? 4 : f == VoxelFormat::rgb24 ? 3 : 1;
}
constexpr bool is_color(VoxelFormat f) {
  return attributes(f) > 1;
}
/// "RGBA32", "RGB24", "DENSITY8", "DENSITY16", "FLOAT32", "BITMAP".
std::string_view name(VoxelFormat f);

/// One voxel of any format in its memory bytes; bytes past voxel_bytes are zero.
struct Voxel {
  std::array<std::byte, 4> bytes{};
  friend bool operator==(const Voxel&, const Voxel&) = default;
  template <class T>
  VOX_HD static Voxel of(T value) {
    static_assert(sizeof(T) <= 4);
    Voxel v;
    std::memcpy(v.bytes.data(), &value, sizeof(T));
    return v;
  }
  template <class T>
  VOX_HD T as() const {
    static_assert(sizeof(T) <= 4);
    T value;
    std::memcpy(&value, bytes.data(), sizeof(T));
    return value;
  }
};

/// Half-open box of voxels: lo <= v < hi.
struct Box {
  Index3 lo{0}, hi{0};
  Index3 size() const { return hi - lo; }
  bool empty() const { return hi.x <= lo.x || hi.y <= lo.y || hi.z <= lo.z; }
  /// Number of voxels; the box is known to be small enough for 63 bits.
  int64_t voxels() const { return empty() ? 0 : (hi.x - lo.x) * (hi.y - lo.y) * (hi.z - lo.z); }
  bool contains(Index3 v) const {
    return v.x >= lo.x && v.y >= lo.y && v.z >= lo.z && v.x < hi.x && v.y < hi.y && v.z < hi.z;
  }
  bool contains(const Box& b) const {
    return b.lo.x >= lo.x && b.lo.y >= lo.y && b.lo.z >= lo.z && b.hi.x <= hi.x && b.hi.y <= hi.y &&
           b.hi.z <= hi.z;
  }
  friend bool operator==(const Box&, const Box&) = default;
};
inline Box intersect(const Box& a, const Box& b) {
  return {{std::max(a.lo.x, b.lo.x), std::max(a.lo.y, b.lo.y), std::max(a.lo.z, b.lo.z)},
          {std::min(a.hi.x, b.hi.x), std::min(a.hi.y, b.hi.y), std::min(a.hi.z, b.hi.z)}};
}

/// The type of a sample in the file that a volume was read from; decoding to the same kind of file restores
/// it.
enum class SampleType : uint8_t { u8 = 1, i8, u16, i16, u32, i32, u64, i64, f32, f64, bit, f16 };
constexpr int sample_bytes(SampleType t) {
  switch (t) {
    case SampleType::u8:
    case SampleType::i8:
    case SampleType::bit:
      return 1;
    case SampleType::u16:
    case SampleType::i16:
    case SampleType::f16:
      return 2;
    case SampleType::u32:
    case SampleType::i32:
    case SampleType::f32:
      return 4;
    default:
      return 8;
  }
}
/// "u8", "i16", "f32" …, "bit".
std::string_view name(SampleType t);
/// Integers of more than 16 bits: no voxel format holds all of them.
constexpr bool is_wide(SampleType t) {
  return t == SampleType::u32 || t == SampleType::i32 || t == SampleType::u64 || t == SampleType::i64;
}
/// The format in which samples of a type are held, as a rule: u8, i8 -> DENSITY8; u16, i16 -> DENSITY16; bit
/// -> BITMAP; all others -> FLOAT32. Of 64-bit floats it holds the nearest. Of wide integers it holds only
/// those up to 2^24, but a volume of them may be held as VolumeInfo::wide_base or VolumeInfo::labels say
/// (volume/wide_integers.h).
VoxelFormat scalar_format(SampleType t);
/// What is added to a sample to store it: 128 for i8, 32768 for i16, else 0. The round trip is exact.
constexpr int32_t storage_bias(SampleType t) {
  return t == SampleType::i8 ? 128 : t == SampleType::i16 ? 32768 : 0;
}

/// Least and greatest *stored* value of a scalar volume (bias included). NaN is not counted.
struct ValueRange {
  double lo = 0, hi = 0;
  friend bool operator==(const ValueRange&, const ValueRange&) = default;
};

/// The facts about a volume that are known before any voxel is read.
struct VolumeInfo {
  Index3 dims{0};  ///< voxels along x (fastest), y, z; each 1..2^31
  VoxelFormat format = VoxelFormat::density8;
  SampleType sample_type = SampleType::u8;  ///< type in the file; scalars only
  Affine affine;                            ///< from the index of a voxel to the place of its centre
  World world = World::unknown;             ///< that places are in
  Unit unit = Unit::unknown;                ///< of places
  uint8_t space_code = 0;                   ///< NIFTI_XFORM_*: what kind of space the world is; 0: not said
  std::string description;                  ///< a line of text that the file has for people; UTF-8
  double slope = 1, intercept = 0;  ///< real value = slope * sample + intercept (recorded, not applied)
  std::optional<ValueRange> range;  ///< of stored values, where the file states it
  /// Of wide integers in DENSITY8 or DENSITY16 without a table of labels: the sample that 0 stands for.
  int64_t wide_base = 0;
  /// Of DENSITY8 and DENSITY16: the sample that each stored value stands for, ascending, as the bits of its
  /// sample type, sign-extended; null: none. Values from its size on do not occur.
  std::shared_ptr<const std::vector<int64_t>> labels;
  /// Values are names of things: there is no average of two of them. With or without a table.
  bool is_labels = false;
  /// The stored value that stands for "nothing was measured here"; it has no part in ranges and averages.
  std::optional<double> fill;
  bool rounded = false;  ///< voxels may be nearest to, not equal to, the samples of the file
  /// What the file has more than one of, and this volume is one of: for people, as "--time 0 of 0..9".
  std::vector<std::string> parts;
  /// Regular files that the voxels are read from, as far as the reader knows them: not to be written over.
  std::vector<std::string> files;

  Box box() const { return {{0, 0, 0}, dims}; }
  /// The sample that a stored value stands for. Of labels: a stored value beyond the table stands for the
  /// last.
  double sample(double stored) const {
    if (!labels) return has_wide_base() ? base_value() + stored : stored - static_cast<double>(bias());
    const int64_t label = (*labels)[std::min(static_cast<size_t>(stored), labels->size() - 1)];
    return sample_type == SampleType::u64 ? static_cast<double>(static_cast<uint64_t>(label))
                                          : static_cast<double>(label);
  }
  /// The stored value of a sample; of labels: that of the first one that is not below it.
  double stored(double value) const {
    if (!labels) return has_wide_base() ? value - base_value() : value + static_cast<double>(bias());
    double index = 0;
    while (index + 1 < static_cast<double>(labels->size()) && sample(index) < value) ++index;
    return index;
  }
  /// The sample that 0 stands for is `wide_base`, as the bits of a u64 or of a signed integer.
  bool has_wide_base() const {
    return is_wide(sample_type) && format != VoxelFormat::float32 && !is_color(format);
  }
  double base_value() const {
    return sample_type == SampleType::u64 ? static_cast<double>(static_cast<uint64_t>(wide_base))
                                          : static_cast<double>(wide_base);
  }
  /// What was added to samples to store them, modulo 2^64, where there is no table of labels.
  int64_t bias() const {
    return is_color(format) ? 0 : has_wide_base() ? -wide_base : storage_bias(sample_type);
  }
};

/// What people call voxels: of wide integers their own type, such as "i32", however they are held; else the
/// name of the format.
std::string_view type_name(const VolumeInfo& info);

/// dims.x * dims.y * dims.z, or nothing if a side is outside 1..2^31 or the product exceeds 2^62.
std::optional<uint64_t> checked_voxels(Index3 dims);
/// Bytes of a volume uncompressed: voxels * voxel_bytes, or one bit a voxel (rounded up to bytes) for BITMAP.
uint64_t raw_bytes(const VolumeInfo& info);

/// Memory that receives or holds the voxels of a box, x fastest, rows and slices any distance apart.
template <class Byte>
struct BasicVoxelSpan {
  Byte* data = nullptr;      ///< the voxel at the box's lo corner
  int64_t row_stride = 0;    ///< bytes from (x, y, z) to (x, y + 1, z)
  int64_t slice_stride = 0;  ///< bytes from (x, y, z) to (x, y, z + 1)
  Byte* row(int64_t y, int64_t z) const { return data + y * row_stride + z * slice_stride; }
};
using VoxelSpan = BasicVoxelSpan<std::byte>;
using ConstVoxelSpan = BasicVoxelSpan<const std::byte>;

/// Rows and slices of a box of that size without gaps.
inline VoxelSpan packed(std::byte* data, Index3 size, VoxelFormat f) {
  return {data, size.x * voxel_bytes(f), size.x * size.y * voxel_bytes(f)};
}
inline ConstVoxelSpan packed(const std::byte* data, Index3 size, VoxelFormat f) {
  return {data, size.x * voxel_bytes(f), size.x * size.y * voxel_bytes(f)};
}
/// Sets every voxel of the memory of a box of that size to one value.
void fill(VoxelSpan out, Index3 size, VoxelFormat f, const Voxel& value);
/// Copies the voxels of a box of that size.
void copy(ConstVoxelSpan in, VoxelSpan out, Index3 size, VoxelFormat f);

}  // namespace voxkit
