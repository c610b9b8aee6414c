#include "formats/volume/dense_sink.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "formats/volume/half.h"
#include "formats/volume/wide_integers.h"

namespace voxkit {
namespace {

constexpr size_t buffer_bytes = size_t{1} << 20;

}  // namespace

SampleLayout storage_layout(const VolumeInfo& info, bool halves) {
  if (is_color(info.format)) return {SampleType::u8, attributes(info.format), false};
  if (is_wide(info.sample_type)) return {info.sample_type, 1, false};
  if (info.format == VoxelFormat::float32)
    return {halves && info.sample_type == SampleType::f16 ? SampleType::f16 : SampleType::f32, 1, false};
  if (scalar_format(info.sample_type) == info.format) return {info.sample_type, 1, false};
  if (info.format == VoxelFormat::density16) return {SampleType::u16, 1, false};
  return {info.format == VoxelFormat::bitmap ? SampleType::bit : SampleType::u8, 1, false};
}

DenseSink::DenseSink(std::unique_ptr<OutputFile> file, const VolumeInfo& info, const SampleLayout& layout)
    : file_(std::move(file)), info_(info), layout_(layout), buffer_(buffer_bytes) {
  if (layout.type != SampleType::f32 || info.format == VoxelFormat::float32) return;
  floats_.resize(size_t{1} << (8 * voxel_bytes(info.format)));
  for (size_t i = 0; i < floats_.size(); ++i)
    floats_[i] = static_cast<float>(info.sample(static_cast<double>(i)));
}

Status DenseSink::write(int64_t z0, int64_t z1, ConstVoxelSpan voxels) {
  if (z0 != next_z_ || z1 < z0 || z1 > info_.dims.z)
    return fail(
        ErrorCode::internal, file_->name(),
        fmt::format("slices {} to {} written: expected slices from {} of {}", z0, z1, next_z_, info_.dims.z));
  const int64_t bytes = voxel_bytes(info_.format);
  const Index3 size = info_.dims;
  const bool whole_slices = voxels.row_stride == size.x * bytes;
  const bool whole_slab = whole_slices && voxels.slice_stride == size.x * size.y * bytes;
  if (whole_slab) {
    VOX_CHECK(put_voxels(voxels.data, size.x * size.y * (z1 - z0)));
  } else {
    for (int64_t z = 0; z < z1 - z0; ++z) {
      if (whole_slices) {
        VOX_CHECK(put_voxels(voxels.row(0, z), size.x * size.y));
        continue;
      }
      for (int64_t y = 0; y < size.y; ++y) VOX_CHECK(put_voxels(voxels.row(y, z), size.x));
    }
  }
  next_z_ = z1;
  return {};
}

Status DenseSink::put_bits(const std::byte* voxels, int64_t count) {
  size_t filled = 0;
  for (int64_t i = 0; i < count;) {
    if (bit_count_ == 0 && i + 8 <= count) {
      // Moves bit 0 of byte k to bit 56 + k, and from there down.
      uint64_t eight;
      std::memcpy(&eight, voxels + i, 8);
      bits_ = static_cast<std::byte>((eight & 0x0101010101010101) * 0x0102040810204080 >> 56);
      bit_count_ = 8;
      i += 8;
    } else {
      bits_ |= (voxels[i++] & std::byte{1}) << bit_count_++;
    }
    if (bit_count_ < 8) continue;
    buffer_[filled++] = bits_;
    bits_ = std::byte{0};
    bit_count_ = 0;
    if (filled == buffer_.size()) {
      VOX_CHECK(put(buffer_));
      filled = 0;
    }
  }
  return put(std::span(buffer_).first(filled));
}

Status DenseSink::put_voxels(const std::byte* voxels, int64_t count) {
  if (layout_.type == SampleType::bit) return put_bits(voxels, count);
  const int64_t in_bytes = voxel_bytes(info_.format), out_bytes = layout_.bytes_per_voxel();
  const bool wide = is_wide(layout_.type), half = layout_.type == SampleType::f16, mapped = !floats_.empty();
  const bool as_it_is = storage_bias(layout_.type) == 0 && !wide && !half &&
                        !mapped;  // samples of such types lie in files as they do in memory
  const int64_t batch = as_it_is ? std::max<int64_t>(count, 1)
                                 : static_cast<int64_t>(buffer_.size()) / std::max(in_bytes, out_bytes);
  for (int64_t done = 0; done < count; done += batch) {
    const int64_t n = std::min(batch, count - done);
    const std::byte* from = voxels + done * in_bytes;
    if (wide) {
      to_wide(from, n, info_, buffer_.data());
    } else if (half) {
      for (int64_t i = 0; i < n; ++i) {
        float value;
        std::memcpy(&value, from + 4 * i, 4);
        const uint16_t sample = float_to_half(value);
        std::memcpy(buffer_.data() + 2 * i, &sample, 2);
      }
    } else if (mapped) {
      for (int64_t i = 0; i < n; ++i) {
        uint16_t stored = 0;
        std::memcpy(&stored, from + i * in_bytes, static_cast<size_t>(in_bytes));
        std::memcpy(buffer_.data() + 4 * i, &floats_[stored], 4);
      }
    } else if (!as_it_is) {
      // Adding the bias turns the sign bit over, and so does taking it away: conversion is its own inverse.
      convert_samples(from, layout_, n, info_, buffer_.data());
    }
    VOX_CHECK(put({as_it_is ? from : buffer_.data(), static_cast<size_t>(n * out_bytes)}));
  }
  return {};
}

Status DenseSink::finish() {
  if (next_z_ != info_.dims.z)
    return fail(ErrorCode::internal, file_->name(),
                fmt::format("{} slices written: expected {}", next_z_, info_.dims.z));
  if (bit_count_ > 0) VOX_CHECK(put({&bits_, 1}));
  VOX_CHECK(complete());
  VOX_CHECK(file_->commit());
  return committed();
}

}  // namespace voxkit
