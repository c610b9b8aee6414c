// NIfTI-1, NIfTI-2 and Analyze 7.5, https://nifti.nimh.nih.gov/nifti-1: single files and pairs, packed with
// gzip or not.
#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <optional>

#include "formats/mapped_file.h"
#include "formats/volume/nifti_header.h"
#include "formats/volume/parts.h"
#include "formats/volume/readers.h"
#include "formats/volume/strided_source.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;
using nifti::Header;

/// A file, unpacked where it is packed.
struct Opened {
  std::unique_ptr<InputStream> stream;
  bool packed = false;
};

Result<Opened> open_unpacked(const std::string& path) {
  VOX_TRY(auto stream, open_stream(path));
  std::string first(2, '\0');
  VOX_TRY(const size_t count, stream->read(std::as_writable_bytes(std::span(first))));
  first.resize(count);
  const bool packed = first == "\x1f\x8b";
  stream = prepend(std::move(first), std::move(stream));
  if (packed) stream = gunzip(std::move(stream));
  return Opened{std::move(stream), packed};
}

/// The files of a volume: one and the same, or header and image.
struct Names {
  std::string header, image;
  bool pair = false;
};

Result<Names> names_of(const std::string& path) {
  constexpr std::array<std::string_view, 4> headers{".hdr", ".hdr.gz", ".HDR", ".HDR.GZ"},
      images{".img", ".img.gz", ".IMG", ".IMG.GZ"};
  for (const bool is_header : {true, false})
    for (const std::string_view ending : is_header ? headers : images) {
      if (!has_ending(path, ending)) continue;
      const std::string stem = path.substr(0, path.size() - ending.size());
      for (const std::string_view other : is_header ? images : headers) {
        const std::string name = stem + std::string(other);
        std::error_code error;
        if (!fs::is_regular_file(name, error)) continue;
        return is_header ? Names{path, name, true} : Names{name, path, true};
      }
      return bad_input(
          path, fmt::format("no {} beside it: expected {}{} or {}{}", is_header ? "image" : "header", stem,
                            is_header ? images[0] : headers[0], stem, is_header ? images[1] : headers[1]));
    }
  return Names{path, path, false};
}

/// A volume of the file, and where its samples lie.
struct Volume {
  VolumeInfo info;
  SampleLayout layout;
  Strides strides;
  uint64_t offset = 0;  ///< of the first sample
  uint64_t end = 0;     ///< of the samples of all volumes
};

Result<Volume> choose_volume(const Header& header, const OpenOptions& options) {
  const auto& dim = header.dim;
  if (dim[0] < 1 || dim[0] > 7)
    return header.wrong(fmt::format("dim[0] is {}: expected 1 to 7 dimensions", dim[0]));
  const auto dimensions = static_cast<size_t>(dim[0]);
  std::array<int64_t, 8> sides{};
  sides.fill(1);
  for (size_t i = 1; i <= dimensions; ++i) {
    if (dim[i] < 1 || dim[i] > max_side)
      return header.wrong(fmt::format("dim[{}] is {}: expected 1 to 2^31", i, dim[i]));
    if (i > 5 && dim[i] != 1)
      return header.wrong(
          fmt::format("dim[{}] is {}: unsupported: expected 1 beyond five dimensions", i, dim[i]));
    sides[i] = dim[i];
  }
  Volume volume;
  VolumeInfo& info = volume.info;
  info.dims = {sides[1], sides[2], sides[3]};
  VOX_TRY(volume.layout, nifti::sample_layout(header));
  const uint64_t bytes = static_cast<uint64_t>(volume.layout.bytes_per_voxel());
  const auto voxels = checked_voxels(info.dims);
  uint64_t one = 0, all = 0;
  if (!voxels || __builtin_mul_overflow(*voxels, bytes, &one) ||
      __builtin_mul_overflow(one, static_cast<uint64_t>(sides[4]), &all) ||
      __builtin_mul_overflow(all, static_cast<uint64_t>(sides[5]), &all) || all > uint64_t{1} << 62 ||
      __builtin_add_overflow(all, header.offset, &volume.end))
    return header.wrong("too many voxels: expected at most 2^62");

  // Colours as planes: the fifth dimension is that of the numbers of a voxel.
  const bool says_colors = header.intent == 0 || header.intent == NIFTI_INTENT_VECTOR ||
                           header.intent == NIFTI_INTENT_RGB_VECTOR ||
                           header.intent == NIFTI_INTENT_RGBA_VECTOR;
  const bool planes = (sides[5] == 3 || sides[5] == 4) && volume.layout.type == SampleType::u8 &&
                      volume.layout.components == 1 && says_colors && !options.channel;
  info.sample_type = volume.layout.type;
  if (planes) volume.layout.components = static_cast<int>(sides[5]);
  info.format = volume.layout.components == 4   ? VoxelFormat::rgba32
                : volume.layout.components == 3 ? VoxelFormat::rgb24
                                                : scalar_format(info.sample_type);
  VOX_TRY(const auto chosen, choose_parts(header.name,
                                          {{"--time", "time steps", sides[4], options.time},
                                           {"--channel", "channels", planes ? 1 : sides[5], options.channel}},
                                          options, info));
  const auto number = static_cast<uint64_t>(chosen[0] + sides[4] * chosen[1]);
  volume.offset = header.offset + number * one;
  volume.strides = Strides::packed(info.dims, volume.layout);
  if (planes)
    volume.strides = {1, info.dims.x, info.dims.x * info.dims.y, static_cast<int64_t>(one) * sides[4]};
  return volume;
}

}  // namespace

SourceResult open_nifti(const std::string& path, const OpenOptions& options, Context& ctx) {
  VOX_TRY(const Names names, names_of(path));
  VOX_TRY(Opened opened, open_unpacked(names.header));
  VOX_TRY(const Header header, nifti::read_header(*opened.stream));
  if (!names.pair && header.kind == nifti::Kind::analyze)
    return header.wrong("no magic at byte 344: expected n+1");
  if (!names.pair && header.pair)
    return header.wrong("of a pair of files: expected its name to end in .hdr, and the image's in .img");
  VOX_CHECK(nifti::skip_extensions(header, *opened.stream, ctx));
  VOX_TRY(Volume volume, choose_volume(header, options));
  VolumeInfo& info = volume.info;
  nifti::read_placement(header, info, ctx);
  nifti::read_meaning(header, info, ctx);
  info.files = {names.header};
  const std::string& image = header.pair ? names.image : names.header;  // a single file may be called .hdr
  if (header.pair) {
    info.files.push_back(image);
    VOX_TRY(opened, open_unpacked(image));
  }
  std::error_code error;
  if (!opened.packed && fs::is_regular_file(image, error)) {
    VOX_TRY(auto file, MappedFile::open(image));
    if (file->bytes().size() < volume.end)
      return bad_input(
          image, fmt::format("voxel data at byte {} end after {} bytes: expected {}", header.offset,
                             file->bytes().size() - std::min<uint64_t>(file->bytes().size(), header.offset),
                             volume.end - header.offset));
    return strided_source(std::move(file), volume.offset, volume.strides, info, volume.layout, options, ctx);
  }
  VOX_CHECK(opened.stream->skip(volume.offset - opened.stream->position()));
  return strided_source(std::move(opened.stream), volume.strides, info, volume.layout, options, ctx);
}

}  // namespace voxkit
