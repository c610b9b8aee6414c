// The sources behind every plain file format: samples of some type, x fastest, after a header.
#pragma once

#include <memory>
#include <optional>

#include "formats/context.h"
#include "formats/input_stream.h"
#include "formats/mapped_file.h"
#include "formats/source.h"
#include "formats/volume/open_volume.h"

namespace voxkit {

/// How the samples of a voxel lie in a file.
struct SampleLayout {
  SampleType type = SampleType::u8;  ///< of one component
  int components = 1;                ///< 1, or 3 / 4 u8 for RGB24 / RGBA32
  bool big_endian = false;
  /// For bits, which are packed, the byte that one voxel takes in memory.
  int64_t bytes_per_voxel() const { return int64_t{components} * sample_bytes(type); }
  /// Bytes that so many voxels take in a file; nothing where 64 bits do not hold them. Bits are packed
  /// without gaps.
  std::optional<uint64_t> file_bytes(uint64_t voxels) const;
};

/// Converts `count` voxels of file samples into voxels in memory: byte order, bias, narrowing, as `info` says
/// they are held. Bits start at the lowest bit of the first byte; a sample that is not zero is 1 in a BITMAP.
void convert_samples(const std::byte* in, const SampleLayout& layout, int64_t count, const VolumeInfo& info,
                     std::byte* out);

/// Random access: samples at `offset` of a mapped file, checked to be there. Rows are converted as they are
/// read. Of integers that no voxel format holds, all are looked at first (wide_integers.h).
Result<std::unique_ptr<VolumeSource>> mapped_source(std::shared_ptr<const MappedFile> file, uint64_t offset,
                                                    const VolumeInfo& info, const SampleLayout& layout,
                                                    const OpenOptions& options, Context& ctx);
/// Forward only: samples follow in a stream (gzip, bzip2, a pipe); no bits. Buffers are small, whatever the
/// box. Wide integers are spooled to a temporary file, so that they can be looked at first.
Result<std::unique_ptr<VolumeSource>> streamed_source(std::unique_ptr<InputStream> stream,
                                                      const VolumeInfo& info, const SampleLayout& layout,
                                                      const OpenOptions& options, Context& ctx);

}  // namespace voxkit
