#include "formats/volume.h"

#include <algorithm>

namespace voxkit {

std::string_view name(VoxelFormat f) {
  switch (f) {
    case VoxelFormat::rgba32:
      return "RGBA32";
    case VoxelFormat::rgb24:
      return "RGB24";
    case VoxelFormat::density8:
      return "DENSITY8";
    case VoxelFormat::density16:
      return "DENSITY16";
    case VoxelFormat::float32:
      return "FLOAT32";
    case VoxelFormat::bitmap:
      return "BITMAP";
  }
  return "?";
}

std::string_view name(SampleType type) {
  constexpr std::string_view names[] = {"",    "u8",  "i8",  "u16", "i16", "u32", "i32",
                                        "u64", "i64", "f32", "f64", "bit", "f16"};
  return names[static_cast<size_t>(type)];
}

VoxelFormat scalar_format(SampleType t) {
  switch (t) {
    case SampleType::u8:
    case SampleType::i8:
      return VoxelFormat::density8;
    case SampleType::u16:
    case SampleType::i16:
      return VoxelFormat::density16;
    case SampleType::bit:
      return VoxelFormat::bitmap;
    default:
      return VoxelFormat::float32;
  }
}

std::string_view type_name(const VolumeInfo& info) {
  return !is_color(info.format) && is_wide(info.sample_type) ? name(info.sample_type) : name(info.format);
}

std::optional<uint64_t> checked_voxels(Index3 dims) {
  uint64_t product = 1;
  for (int axis = 0; axis < 3; ++axis) {
    if (dims[axis] < 1 || dims[axis] > max_side) return std::nullopt;
    if (__builtin_mul_overflow(product, static_cast<uint64_t>(dims[axis]), &product) || product > uint64_t{1}
                                                                                                      << 62)
      return std::nullopt;
  }
  return product;
}

uint64_t raw_bytes(const VolumeInfo& info) {
  const uint64_t voxels = checked_voxels(info.dims).value_or(0);
  return info.format == VoxelFormat::bitmap ? (voxels + 7) / 8 : voxels * voxel_bytes(info.format);
}

void fill(VoxelSpan out, Index3 size, VoxelFormat f, const Voxel& value) {
  const size_t bytes = static_cast<size_t>(voxel_bytes(f));
  const bool one_byte = std::all_of(value.bytes.begin(), value.bytes.begin() + bytes,
                                    [&](std::byte b) { return b == value.bytes[0]; });
  for (int64_t z = 0; z < size.z; ++z)
    for (int64_t y = 0; y < size.y; ++y) {
      std::byte* row = out.row(y, z);
      if (one_byte) {
        std::memset(row, static_cast<int>(value.bytes[0]), static_cast<size_t>(size.x) * bytes);
        continue;
      }
      // Doubling copies: a memcpy moves any voxel size at full speed.
      const size_t total = static_cast<size_t>(size.x) * bytes;
      std::memcpy(row, value.bytes.data(), bytes);
      for (size_t done = bytes; done < total; done *= 2)
        std::memcpy(row + done, row, std::min(done, total - done));
    }
}

void copy(ConstVoxelSpan in, VoxelSpan out, Index3 size, VoxelFormat f) {
  const size_t row_bytes = static_cast<size_t>(size.x) * static_cast<size_t>(voxel_bytes(f));
  for (int64_t z = 0; z < size.z; ++z)
    for (int64_t y = 0; y < size.y; ++y) std::memcpy(out.row(y, z), in.row(y, z), row_bytes);
}

}  // namespace voxkit
