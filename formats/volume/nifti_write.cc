// NIfTI-1 single files, .nii and .nii.gz.
#include <fmt/format.h>
#include <zlib.h>

#include <array>
#include <cstring>

#include "formats/volume/dense_sink.h"
#include "formats/volume/facts.h"
#include "formats/volume/nifti_header.h"
#include "formats/volume/readers.h"

namespace voxkit {
namespace {

constexpr size_t most_description = 79;  // and a zero

/// Samples packed with gzip as they come. The gzip header has no time and no name.
class GzipSink final : public DenseSink {
 public:
  using DenseSink::DenseSink;
  ~GzipSink() override { ::deflateEnd(&zlib_); }
  Status start(std::span<const std::byte> header) {
    if (::deflateInit2(&zlib_, Z_DEFAULT_COMPRESSION, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK)
      return fail(ErrorCode::limit, file_->name(), "no memory to pack with gzip");
    return put(header);
  }

 protected:
  Status put(std::span<const std::byte> bytes) override {
    while (!bytes.empty()) {
      const size_t take = std::min(bytes.size(), size_t{1} << 30);
      VOX_CHECK(pack(bytes.first(take), Z_NO_FLUSH));
      bytes = bytes.subspan(take);
    }
    return {};
  }
  Status complete() override { return pack({}, Z_FINISH); }

 private:
  Status pack(std::span<const std::byte> bytes, int flush) {
    zlib_.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes.data()));
    zlib_.avail_in = static_cast<uInt>(bytes.size());
    do {
      VOX_CHECK(check_interrupt());
      zlib_.next_out = reinterpret_cast<Bytef*>(packed_.data());
      zlib_.avail_out = static_cast<uInt>(packed_.size());
      ::deflate(&zlib_, flush);
      VOX_CHECK(file_->write(std::span(packed_).first(packed_.size() - zlib_.avail_out)));
    } while (zlib_.avail_out == 0);
    return {};
  }

  z_stream zlib_{};
  std::vector<std::byte> packed_ = std::vector<std::byte>(size_t{256} << 10);
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
    auto sink = std::make_unique<GzipSink>(std::move(file), info, layout);
    VOX_CHECK(sink->start(bytes));
    return sink;
  }
  VOX_CHECK(file->write(bytes));
  return std::make_unique<DenseSink>(std::move(file), info, layout);
}

}  // namespace voxkit
