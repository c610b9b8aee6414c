// NIfTI-1 and NIfTI-2 single files, https://nifti.nimh.nih.gov/nifti-1: a binary header, extensions, samples.
#include <fmt/format.h>
#include <nifti1_io.h>
#include <nifti2.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>

#include "formats/mapped_file.h"
#include "formats/volume/dense_sink.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/readers.h"

namespace voxkit {
namespace {

static_assert(sizeof(nifti_1_header) == 348 && sizeof(nifti_2_header) == 540);

struct NiftiType {
  int code;
  SampleType type;
  int components;
};
constexpr NiftiType nifti_types[] = {
    {DT_UINT8, SampleType::u8, 1},    {DT_INT8, SampleType::i8, 1},    {DT_INT16, SampleType::i16, 1},
    {DT_UINT16, SampleType::u16, 1},  {DT_INT32, SampleType::i32, 1},  {DT_UINT32, SampleType::u32, 1},
    {DT_INT64, SampleType::i64, 1},   {DT_UINT64, SampleType::u64, 1}, {DT_FLOAT32, SampleType::f32, 1},
    {DT_FLOAT64, SampleType::f64, 1}, {DT_RGB24, SampleType::u8, 3},   {DT_RGBA32, SampleType::u8, 4},
};

/// What both versions of the header say.
struct Nifti {
  VolumeInfo info;
  SampleLayout layout;
  uint64_t offset = 0;  ///< of the first sample
};

template <class T>
void reverse(T& value) {
  auto* bytes = reinterpret_cast<std::byte*>(&value);
  std::reverse(bytes, bytes + sizeof(T));
}
template <class T, size_t n>
void reverse(T (&values)[n]) {
  for (T& value : values) reverse(value);
}

/// Dimensions and type, which both versions of the header have.
template <class Side>
Status parse_dims(const std::string& name, const Side (&dim)[8], int datatype, Nifti& out) {
  if (dim[0] < 1 || dim[0] > 7)
    return bad_input(name, fmt::format("NIfTI header: dim[0] is {}: expected 1 to 7 dimensions", dim[0]));
  for (int i = 1; i <= static_cast<int>(dim[0]); ++i) {
    if (dim[i] < 1 || dim[i] > max_side)
      return bad_input(name, fmt::format("NIfTI header: dim[{}] is {}: expected 1 to 2^31", i, dim[i]));
    if (i > 3 && dim[i] != 1)
      return bad_input(
          name, fmt::format("NIfTI header: dim[{}] is {}: unsupported: expected one volume, one time step", i,
                            dim[i]));
  }
  out.info.dims = {1, 1, 1};
  for (int i = 1; i <= std::min(static_cast<int>(dim[0]), 3); ++i) out.info.dims[i - 1] = dim[i];
  for (const NiftiType& t : nifti_types) {
    if (t.code != datatype) continue;
    out.layout.type = out.info.sample_type = t.type;
    out.layout.components = t.components;
    out.info.format = t.components == 4   ? VoxelFormat::rgba32
                      : t.components == 3 ? VoxelFormat::rgb24
                                          : scalar_format(t.type);
    return {};
  }
  return bad_input(
      name,
      fmt::format("NIfTI header: datatype {} is unsupported: expected integers of 8 to 64 bits, float32, "
                  "float64, RGB24 or RGBA32",
                  datatype));
}

Status parse_scale(double slope, double intercept, VolumeInfo& info) {
  if (slope == 0 || !std::isfinite(slope) || !std::isfinite(intercept) || is_colour(info.format)) return {};
  info.slope = slope;
  info.intercept = intercept;
  return {};
}

void place(int axis, double spacing, double origin, VolumeInfo& info) {
  const size_t i = static_cast<size_t>(axis);
  spacing = std::abs(spacing);
  if (spacing > 0 && std::isfinite(spacing)) info.affine.axes[i][i] = spacing;
  if (std::isfinite(origin)) info.affine.origin[i] = origin;
}

Result<Nifti> parse_nifti1(const std::string& name, nifti_1_header header) {
  Nifti out;
  if (header.sizeof_hdr != 348) {
    ::swap_nifti_header(&header, 1);
    out.layout.big_endian = true;
  }
  if (std::memcmp(header.magic, "ni1", 4) == 0)
    return bad_input(
        name, "NIfTI header: of a pair of files (.hdr and .img): unsupported: expected a single .nii file");
  if (std::memcmp(header.magic, "n+1", 4) != 0)
    return bad_input(name, "NIfTI header: no magic at byte 344: expected n+1");
  VOX_CHECK(parse_dims(name, header.dim, header.datatype, out));
  if (!(header.vox_offset >= 348) || header.vox_offset > 1e15f ||
      header.vox_offset != std::floor(header.vox_offset))
    return bad_input(
        name, fmt::format("NIfTI header: vox_offset is {}: expected an integer from 348", header.vox_offset));
  out.offset = static_cast<uint64_t>(header.vox_offset);

  // Checked above: the library trusts dimensions and type. It works out the placement.
  ::nifti_set_debug_level(0);
  const std::unique_ptr<nifti_image, decltype(&::nifti_image_free)> image(
      ::nifti_convert_nhdr2nim(header, nullptr), &::nifti_image_free);
  if (!image) return bad_input(name, "NIfTI header: refused by niftiio: expected a valid NIfTI-1 header");
  const double spacing[3] = {image->dx, image->dy, image->dz};
  for (int i = 0; i < 3; ++i)
    place(i, spacing[i],
          image->sform_code > 0   ? image->sto_xyz.m[i][3]
          : image->qform_code > 0 ? image->qto_xyz.m[i][3]
                                  : 0,
          out.info);
  VOX_CHECK(parse_scale(image->scl_slope, image->scl_inter, out.info));
  return out;
}

/// By hand: the library knows version 1 only.
Result<Nifti> parse_nifti2(const std::string& name, nifti_2_header header) {
  Nifti out;
  if (header.sizeof_hdr != 540) {
    out.layout.big_endian = true;
    reverse(header.datatype), reverse(header.dim), reverse(header.vox_offset), reverse(header.pixdim);
    reverse(header.scl_slope), reverse(header.scl_inter), reverse(header.qform_code),
        reverse(header.sform_code);
    reverse(header.qoffset_x), reverse(header.qoffset_y), reverse(header.qoffset_z);
    reverse(header.srow_x), reverse(header.srow_y), reverse(header.srow_z);
  }
  if (std::memcmp(header.magic, "ni2", 4) == 0)
    return bad_input(
        name, "NIfTI header: of a pair of files (.hdr and .img): unsupported: expected a single .nii file");
  if (std::memcmp(header.magic, "n+2\0\r\n\032\n", 8) != 0)
    return bad_input(name, "NIfTI header: no magic at byte 4: expected n+2 and its line ends");
  VOX_CHECK(parse_dims(name, header.dim, header.datatype, out));
  if (header.vox_offset < 540)
    return bad_input(
        name, fmt::format("NIfTI header: vox_offset is {}: expected an integer from 540", header.vox_offset));
  out.offset = static_cast<uint64_t>(header.vox_offset);
  const double s[3] = {header.srow_x[3], header.srow_y[3], header.srow_z[3]};
  const double q[3] = {header.qoffset_x, header.qoffset_y, header.qoffset_z};
  for (int i = 0; i < 3; ++i)
    place(i, header.pixdim[i + 1], header.sform_code > 0 ? s[i] : header.qform_code > 0 ? q[i] : 0, out.info);
  VOX_CHECK(parse_scale(header.scl_slope, header.scl_inter, out.info));
  return out;
}

Result<Nifti> read_header(InputStream& stream) {
  std::array<std::byte, 540> bytes{};
  VOX_CHECK(stream.read_exactly(std::span(bytes).first(348), "NIfTI header"));
  int32_t size = 0;
  std::memcpy(&size, bytes.data(), sizeof(size));
  if (size == 348 || size == __builtin_bswap32(348)) {
    nifti_1_header header;
    std::memcpy(&header, bytes.data(), sizeof(header));
    return parse_nifti1(stream.name(), header);
  }
  if (size == 540 || size == static_cast<int32_t>(__builtin_bswap32(540))) {
    VOX_CHECK(stream.read_exactly(std::span(bytes).subspan(348), "NIfTI-2 header"));
    nifti_2_header header;
    std::memcpy(&header, bytes.data(), sizeof(header));
    return parse_nifti2(stream.name(), header);
  }
  return bad_input(stream.name(), "not a NIfTI file: expected 348 or 540 in the first four bytes");
}

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

nifti_1_header make_header(const VolumeInfo& info, const SampleLayout& layout) {
  nifti_1_header header{};
  header.sizeof_hdr = 348;
  header.regular = 'r';
  header.dim[0] = 3;
  for (int i = 1; i < 8; ++i) header.dim[i] = i <= 3 ? static_cast<short>(info.dims[i - 1]) : 1;
  for (const NiftiType& t : nifti_types)
    if (t.type == layout.type && t.components == layout.components)
      header.datatype = static_cast<short>(t.code);
  header.bitpix = static_cast<short>(8 * layout.bytes_per_voxel());
  for (float& side : header.pixdim) side = 1;
  for (size_t i = 0; i < 3; ++i) header.pixdim[i + 1] = static_cast<float>(info.affine.axes[i][i]);
  header.vox_offset = 352;
  header.scl_slope = static_cast<float>(info.slope);
  header.scl_inter = static_cast<float>(info.intercept);
  // The placement in both forms, since readers differ in which they look at.
  header.qform_code = header.sform_code = NIFTI_XFORM_SCANNER_ANAT;
  header.qoffset_x = header.srow_x[3] = static_cast<float>(info.affine.origin[0]);
  header.qoffset_y = header.srow_y[3] = static_cast<float>(info.affine.origin[1]);
  header.qoffset_z = header.srow_z[3] = static_cast<float>(info.affine.origin[2]);
  header.srow_x[0] = header.pixdim[1];
  header.srow_y[1] = header.pixdim[2];
  header.srow_z[2] = header.pixdim[3];
  std::memcpy(header.magic, "n+1", 4);
  return header;
}

}  // namespace

SourceResult open_nifti(const std::string& path, const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto stream, open_stream(path));
  std::string first(2, '\0');
  VOX_TRY(const size_t count, stream->read(std::as_writable_bytes(std::span(first))));
  first.resize(count);
  const bool packed = first == "\x1f\x8b";
  stream = prepend(std::move(first), std::move(stream));
  if (packed) stream = gunzip(std::move(stream));
  VOX_TRY(const Nifti nifti, read_header(*stream));
  std::error_code error;
  if (!packed && std::filesystem::is_regular_file(path, error)) {
    VOX_TRY(auto file, MappedFile::open(path));
    return mapped_source(std::move(file), nifti.offset, nifti.info, nifti.layout, options, ctx);
  }
  const auto voxels = checked_voxels(nifti.info.dims);
  if (!voxels || !nifti.layout.file_bytes(*voxels))
    return bad_input(path, "NIfTI header: too many voxels: expected at most 2^62");
  VOX_CHECK(stream->skip(nifti.offset - stream->position()));
  return streamed_source(std::move(stream), nifti.info, nifti.layout, options, ctx);
}

SinkResult create_nifti(const std::string& path, const VolumeInfo& info, bool force, Context&) {
  for (int i = 0; i < 3; ++i)
    if (info.dims[i] > 32767)
      return fail(ErrorCode::usage, path,
                  fmt::format("a side of {} voxels: expected at most 32767 in NIfTI", info.dims[i]));
  SampleLayout layout = storage_layout(info);
  if (info.format == VoxelFormat::bitmap) layout.type = SampleType::u8;
  const nifti_1_header header = make_header(info, layout);
  std::array<std::byte, 352> bytes{};  // four zeros after the header: no extensions
  std::memcpy(bytes.data(), &header, sizeof(header));
  VOX_TRY(auto file, OutputFile::create(path, force));
  if (has_ending(path, ".gz")) {
    auto sink = std::make_unique<GzipSink>(std::move(file), info, layout);
    VOX_CHECK(sink->start(bytes));
    return sink;
  }
  VOX_CHECK(file->write(bytes));
  return std::make_unique<DenseSink>(std::move(file), info, layout);
}

}  // namespace voxkit
