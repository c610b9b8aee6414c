// Slices whose samples must all be looked at before it is known how voxels hold them: integers of 32 and 64
// bits, and 64-bit floats.
#pragma once

#include <functional>

#include "formats/copy.h"
#include "formats/mapped_file.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/wide_integers.h"

namespace voxkit {

/// Whether samples of a type are such.
constexpr bool needs_look(SampleType type) {
  return is_wide(type) || type == SampleType::f64;
}

/// Decodes all slices once, into an unlinked temporary file, and makes a source of that (`mapped_source`).
/// `decode` gives the samples of slice z: info.dims.x * info.dims.y of layout.type, little endian.
inline Result<std::unique_ptr<VolumeSource>> spooled_samples(
    const std::string& name, const VolumeInfo& info, const SampleLayout& layout,
    const std::function<Status(int64_t z, std::byte* samples)>& decode, const OpenOptions& options,
    Context& ctx) {
  const auto bytes = static_cast<uint64_t>(info.dims.x * info.dims.y * layout.bytes_per_voxel());
  VOX_TRY(const auto slice, Buffer::allocate(bytes, "a slice", ctx));
  TemporaryFile file(name);
  for (int64_t z = 0; z < info.dims.z; ++z) {
    VOX_CHECK(check_interrupt());
    VOX_CHECK(decode(z, slice->data()));
    VOX_CHECK(file.write({slice->data(), static_cast<size_t>(bytes)}));
  }
  VOX_TRY(auto mapped, file.map());
  return mapped_source(std::move(mapped), 0, info, layout, options, ctx);
}

}  // namespace voxkit
