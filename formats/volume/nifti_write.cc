// NIfTI-1 single files, .nii and .nii.gz.
#include <fmt/format.h>
#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "formats/parallel.h"
#include "formats/volume/dense_sink.h"
#include "formats/volume/facts.h"
#include "formats/volume/nifti_header.h"
#include "formats/volume/readers.h"

namespace voxkit {
namespace {

constexpr size_t most_description = 79;  // and a zero

/// Samples packed with gzip as they come: a member for each MiB, so that threads can pack them side by side
/// and bytes do not depend on how many there are. The members' headers have no time and no name.
class GzipSink final : public DenseSink {
 public:
  GzipSink(std::unique_ptr<OutputFile> file, const VolumeInfo& info, const SampleLayout& layout, Context& ctx)
      : DenseSink(std::move(file), info, layout), packing_(ctx) {
    packing_.progress = [](double) {};  // of what is written
    waiting_.reserve(static_cast<size_t>(std::max(ctx.threads, 1)) * member_bytes);
  }
  Status start(std::span<const std::byte> header) { return put(header); }

 protected:
  Status put(std::span<const std::byte> bytes) override {
    while (!bytes.empty()) {
      const size_t take = std::min(bytes.size(), waiting_.capacity() - waiting_.size());
      waiting_.insert(waiting_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(take));
      bytes = bytes.subspan(take);
      if (waiting_.size() == waiting_.capacity()) VOX_CHECK(pack());
    }
    return {};
  }
  Status complete() override { return pack(); }

 private:
  static constexpr size_t member_bytes = size_t{1} << 20;
  static constexpr int level = 6;

  Status pack() {
    const std::span<const std::byte> all = waiting_;
    std::vector<std::vector<std::byte>> members((all.size() + member_bytes - 1) / member_bytes);
    VOX_CHECK(parallel_for(packing_, static_cast<int64_t>(members.size()), [&](int64_t task) -> Status {
      const auto i = static_cast<size_t>(task);
      const auto part = all.subspan(i * member_bytes, std::min(member_bytes, all.size() - i * member_bytes));
      const std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)> compressor(
          libdeflate_alloc_compressor(level), &libdeflate_free_compressor);
      if (!compressor) return fail(ErrorCode::limit, file_->name(), "no memory to pack with gzip");
      members[i].resize(libdeflate_gzip_compress_bound(compressor.get(), part.size()));
      members[i].resize(libdeflate_gzip_compress(compressor.get(), part.data(), part.size(),
                                                 members[i].data(), members[i].size()));
      return {};
    }));
    for (const std::vector<std::byte>& member : members) VOX_CHECK(file_->write(member));
    waiting_.clear();
    return {};
  }

  Context packing_;
  std::vector<std::byte> waiting_;
};

nifti_1_header make_header(const std::string& path, const VolumeInfo& info, const SampleLayout& layout,
                           Context& ctx) {
  nifti_1_header header{};
  header.sizeof_hdr = 348;
  header.regular = 'r';
  header.dim[0] = 3;
  for (int i = 1; i < 8; ++i) header.dim[i] = i <= 3 ? static_cast<short>(info.dims[i - 1]) : 1;
  header.datatype = nifti::datatype_of(layout);
  header.bitpix = static_cast<short>(8 * layout.bytes_per_voxel());
  for (float& side : header.pixdim) side = 1;
  nifti::write_placement(path, info, header, ctx);
  header.vox_offset = 352;
  header.scl_slope = static_cast<float>(info.slope);
  header.scl_inter = static_cast<float>(info.intercept);
  if (info.is_labels) header.intent_code = NIFTI_INTENT_LABEL;
  const std::string text = cut_text(info.description, most_description);
  std::memcpy(header.descrip, text.data(), text.size());
  if (text.size() < info.description.size())
    ctx.note(
        fmt::format("{}: the description is cut to {} bytes, which NIfTI has for it", path, text.size()));
  std::memcpy(header.magic, "n+1", 4);
  return header;
}

}  // namespace

SinkResult create_nifti(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  for (int i = 0; i < 3; ++i)
    if (info.dims[i] > 32767)
      return fail(ErrorCode::usage, path,
                  fmt::format("a side of {} voxels: expected at most 32767 in NIfTI", info.dims[i]));
  SampleLayout layout = storage_layout(info);
  if (info.format == VoxelFormat::bitmap) layout.type = SampleType::u8;
  VOX_TRY(auto file, OutputFile::create(path, force));
  const nifti_1_header header = make_header(path, info, layout, ctx);
  note_dropped(path, "NIfTI",
               not_held(info, {.place = true,
                               .directions = true,
                               .world = true,
                               .unit = true,
                               .scale = true,
                               .description = true,
                               .labels = true}),
               ctx);
  std::array<std::byte, 352> bytes{};  // four zeros after the header: no extensions
  std::memcpy(bytes.data(), &header, sizeof(header));
  if (has_ending(path, ".gz")) {
    auto sink = std::make_unique<GzipSink>(std::move(file), info, layout, ctx);
    VOX_CHECK(sink->start(bytes));
    return sink;
  }
  VOX_CHECK(file->write(bytes));
  return std::make_unique<DenseSink>(std::move(file), info, layout);
}

}  // namespace voxkit
