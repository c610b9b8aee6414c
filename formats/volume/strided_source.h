// Samples that lie in any order: planes of colours, time that runs fastest.
#pragma once

#include <memory>

#include "formats/context.h"
#include "formats/input_stream.h"
#include "formats/mapped_file.h"
#include "formats/volume/dense_source.h"

namespace voxkit {

/// Bytes from a sample to its neighbours: along x, y, z, and of the next component of the same voxel. None
/// is below 0.
struct Strides {
  int64_t x = 0, y = 0, z = 0, component = 0;
  /// x fastest, components beside each other: as mapped_source and streamed_source have it.
  static Strides packed(Index3 dims, const SampleLayout& layout);
  friend bool operator==(const Strides&, const Strides&) = default;
};

/// Random access to the samples at `offset` of a file, checked to be there. What must be looked at as a whole
/// (integers of more than 16 bits, 64-bit floats) is brought into order in a temporary file first. No bits.
/// Errors: ErrorCode::input; ErrorCode::output where there is no room.
Result<std::unique_ptr<VolumeSource>> strided_source(std::shared_ptr<const MappedFile> file, uint64_t offset,
                                                     const Strides& strides, const VolumeInfo& info,
                                                     const SampleLayout& layout, const OpenOptions& options,
                                                     Context& ctx);
/// The same of a stream that stands at the first byte of the first voxel. What is packed is streamed on, all
/// else goes through a temporary file.
Result<std::unique_ptr<VolumeSource>> strided_source(std::unique_ptr<InputStream> stream,
                                                     const Strides& strides, const VolumeInfo& info,
                                                     const SampleLayout& layout, const OpenOptions& options,
                                                     Context& ctx);

}  // namespace voxkit
