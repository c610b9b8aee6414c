// The sinks behind every plain file format: slabs become little-endian samples, x fastest, after a header.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "formats/output_file.h"
#include "formats/source.h"
#include "formats/volume/dense_source.h"

namespace voxkit {

/// The samples in which a volume is written: its sample_type where that is an integer or f32 (and what the
/// format holds), else the plain type of the format; colours as 3 or 4 u8. Half floats are f32, unless
/// `halves` says that the file can have them. Little endian.
SampleLayout storage_layout(const VolumeInfo& info, bool halves = false);

/// Writes slabs as samples to an OutputFile, in bounded buffers; `finish` commits it.
class DenseSink : public VolumeSink {
 public:
  /// The header is in `file` already. The layout is that of `storage_layout`; or f32 for voxels that are no
  /// floats, of which the sample values are written then.
  DenseSink(std::unique_ptr<OutputFile> file, const VolumeInfo& info, const SampleLayout& layout);
  Status write(int64_t z0, int64_t z1, ConstVoxelSpan voxels) final;
  Status finish() final;

 protected:
  /// Where the samples go; a packed format overrides it.
  virtual Status put(std::span<const std::byte> bytes) { return file_->write(bytes); }
  /// After the last sample, before the file is committed.
  virtual Status complete() { return {}; }
  /// After the file has its name.
  virtual Status committed() { return {}; }

  std::unique_ptr<OutputFile> file_;

 private:
  Status put_bits(const std::byte* voxels, int64_t count);
  Status put_voxels(const std::byte* voxels, int64_t count);

  VolumeInfo info_;
  SampleLayout layout_;
  int64_t next_z_ = 0;
  std::vector<std::byte> buffer_;
  std::vector<float> floats_;  ///< of each stored value, where these are not what is written
  std::byte bits_{0};          ///< of a byte begun, where samples are bits
  int bit_count_ = 0;
};

/// Samples in a file of their own, then the header: who finds the header finds the data.
class DetachedSink final : public DenseSink {
 public:
  DetachedSink(std::unique_ptr<OutputFile> header, std::unique_ptr<OutputFile> data, const VolumeInfo& info,
               const SampleLayout& layout)
      : DenseSink(std::move(data), info, layout), header_(std::move(header)) {}

 private:
  Status committed() override { return header_->commit(); }
  std::unique_ptr<OutputFile> header_;
};

}  // namespace voxkit
