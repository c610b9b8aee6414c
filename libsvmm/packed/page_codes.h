// The codes of pages while a volume is encoded: as its voxels have them, and as they were decoded.
#pragma once

#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/source.h"
#include "libpage/page.h"
#include "libsvmm/packed/packed_layout.h"
#include "libsvmm/packed/raster.h"

namespace voxkit::svmm {

/// Reads pages of a level as codes.
class PageReader {
 public:
  /// What is read goes through `raster`.
  PageReader(VolumeSource& source, const PageGrid& grid, const PackedParams& params, const Raster& raster)
      : source_(source), grid_(grid), params_(params), raster_(raster) {}

  /// The sum of squared differences between the voxels of the page that was read last and what their codes
  /// stand for; where both are finite.
  double squared_error() const { return squared_error_; }

  /// Reads the pages `first` to `last`, which are in one row, and calls take(number, codes, extent) for each.
  template <class Take>
  Status read(uint64_t first, uint64_t last, const Take& take) {
    const Box row{grid_.box(first).lo, grid_.box(last - 1).hi};
    const VoxelFormat format = source_.info().format;
    voxels_.resize(static_cast<size_t>(row.voxels() * voxel_bytes(format)));
    const VoxelSpan span = packed(voxels_.data(), row.size(), format);
    if (const auto value = source_.uniform(row))
      fill(span, row.size(), format, *value);
    else
      VOX_CHECK(source_.read(row, span));
    for (uint64_t number = first; number < last; ++number) {
      const Box box = grid_.box(number);
      const ConstVoxelSpan at{span.data + (box.lo.x - row.lo.x) * voxel_bytes(format), span.row_stride,
                              span.slice_stride};
      VOX_CHECK(format == VoxelFormat::float32     ? codes_of_floats(at, box.size(), number, take)
                : format == VoxelFormat::density16 ? codes_of<uint16_t>(at, box.size(), number, take)
                                                   : codes_of<uint8_t>(at, box.size(), number, take));
    }
    return {};
  }

 private:
  template <class T, class Take>
  Status codes_of(ConstVoxelSpan in, Index3 size, uint64_t number, const Take& take) {
    T codes[page::max_voxels];
    T* out = codes;
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y, out += size.x)
        std::memcpy(out, in.row(y, z), static_cast<size_t>(size.x) * sizeof(T));
    if (!raster_.empty())
      for (T* code = codes; code != out; ++code) *code = static_cast<T>(raster_(*code));
    return take(number, std::span<const T>(codes, out), grid_.extent(number));
  }
  template <class Take>
  Status codes_of_floats(ConstVoxelSpan in, Index3 size, uint64_t number, const Take& take) {
    uint32_t codes[page::max_voxels];
    uint32_t* out = codes;
    squared_error_ = 0;
    for (int64_t z = 0; z < size.z; ++z)
      for (int64_t y = 0; y < size.y; ++y) {
        const auto* const row = reinterpret_cast<const float*>(in.row(y, z));
        for (int64_t x = 0; x < size.x; ++x) {
          *out = params_.map.code(row[x]);
          if (params_.map.kind == CodeKind::steps && std::isfinite(row[x])) {
            const double error = static_cast<double>(params_.map.value(*out)) - static_cast<double>(row[x]);
            if (!(std::abs(error) <= params_.max_error))
              return fail(ErrorCode::internal, {}, "a step further than the bound");
            squared_error_ += error * error;
          }
          ++out;
        }
      }
    return take(number, std::span<const uint32_t>(codes, out), grid_.extent(number));
  }

  VolumeSource& source_;
  const PageGrid& grid_;
  const PackedParams& params_;
  const Raster& raster_;
  std::vector<std::byte> voxels_;
  double squared_error_ = 0;
};

/// Of a page that was read, and decoded again.
template <class T>
double squared_error(const PageReader& reader, std::span<const T> codes, std::span<const T> decoded) {
  if constexpr (sizeof(T) == 4) return reader.squared_error();  // codes of floats are kept
  uint64_t sum = 0;
  for (size_t i = 0; i < decoded.size(); ++i) {
    const int64_t error = int64_t{codes[i]} - int64_t{decoded[i]};
    sum += static_cast<uint64_t>(error * error);
  }
  return static_cast<double>(sum);
}

/// The codes of a coarser level as they were decoded, in a temporary file, page by page.
class DecodedLevel {
 public:
  DecodedLevel(int level, const PageGrid& grid, int code_bytes)
      : level_(level),
        grid_(grid),
        stride_(static_cast<size_t>(grid.side * grid.side * grid.side * code_bytes)) {}
  int level() const { return level_; }
  size_t page_bytes() const { return stride_; }
  /// Pages in order, each of `page_bytes()`.
  Status write(std::span<const std::byte> pages) { return file_.write(pages); }
  Status finish() {
    VOX_TRY(mapped_, file_.map());
    return {};
  }
  /// Planes of pages before this one are not needed any more.
  void release(int64_t plane) const {
    release_bytes(mapped_->bytes().first(grid_.number({0, 0, plane}) * stride_));
  }
  /// The parents of a page of the next finer level.
  template <class T>
  page::Parent<T> parent_of(Index3 child) const {
    const uint64_t number = grid_.number(child / int64_t{2});
    page::Parent<T> parent = placed<T>(child, grid_);
    parent.samples = {reinterpret_cast<const T*>(mapped_->bytes().data() + number * stride_),
                      static_cast<size_t>(parent.extent.voxels())};
    return parent;
  }

 private:
  int level_;
  PageGrid grid_;
  size_t stride_;
  TemporaryFile file_{"a coarser level"};
  std::shared_ptr<const MappedFile> mapped_;
};

}  // namespace voxkit::svmm
