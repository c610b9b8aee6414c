// MRC2014 and CCP4 maps, https://www.ccpem.ac.uk/mrc_format/mrc2014.php: a header, an extended header,
// samples; packed with gzip or bzip2 or not.
#include <fmt/format.h>

#include <vector>

#include "formats/mapped_file.h"
#include "formats/volume/mrc_header.h"
#include "formats/volume/parts.h"
#include "formats/volume/readers.h"
#include "formats/volume/strided_source.h"

namespace voxkit {
namespace {

using mrc::Header;
using mrc::Map;

/// Samples of 4 bits, the lower ones of a byte first, rows of whole bytes: as bytes, through a temporary
/// file.
Result<std::unique_ptr<VolumeSource>> open_nibbles(std::unique_ptr<InputStream> stream, const Map& map,
                                                   const OpenOptions& options, Context& ctx) {
  const Index3 dims = map.info.dims;
  TemporaryFile bytes(stream->name());
  std::vector<std::byte> packed(static_cast<size_t>((dims.x + 1) / 2));
  std::vector<std::byte> row(2 * packed.size());
  for (int64_t y = 0; y < dims.y * dims.z; ++y) {
    VOX_CHECK(check_interrupt());
    VOX_CHECK(stream->read_exactly(packed, "samples of 4 bits"));
    for (size_t i = 0; i < packed.size(); ++i) {
      row[2 * i] = packed[i] & std::byte{15};
      row[2 * i + 1] = packed[i] >> 4;
    }
    VOX_CHECK(bytes.write({row.data(), static_cast<size_t>(dims.x)}));
  }
  VOX_TRY(auto file, bytes.map());
  return mapped_source(std::move(file), 0, map.info, map.layout, options, ctx);
}

/// Bytes of one volume in the file.
Result<uint64_t> volume_bytes(const Map& map, const std::string& path) {
  const uint64_t rows = static_cast<uint64_t>(map.info.dims.y) * static_cast<uint64_t>(map.info.dims.z);
  const auto samples = checked_voxels(map.info.dims);
  if (map.nibbles) return rows * (static_cast<uint64_t>(map.info.dims.x + 1) / 2);
  const auto bytes = samples ? map.layout.file_bytes(*samples) : std::nullopt;
  if (!bytes || *bytes > uint64_t{1} << 62)
    return bad_input(path, "MRC header: too many voxels: expected at most 2^62 bytes");
  return *bytes;
}

}  // namespace

SourceResult open_mrc(const std::string& path, const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto file, MappedFile::open(path));
  const auto begins = [&](std::string_view magic) {
    return file->bytes().size() >= magic.size() &&
           std::memcmp(file->bytes().data(), magic.data(), magic.size()) == 0;
  };
  const bool gzip = begins("\x1f\x8b"), packed = gzip || begins("BZh");
  auto stream = stream_of(file);
  if (packed) stream = gzip ? gunzip(std::move(stream)) : bunzip2(std::move(stream));
  Header header;
  VOX_CHECK(stream->read_exactly(header.bytes, "MRC header"));
  VOX_TRY(Map map, mrc::read_map(header, path, ctx));
  map.info.files = {path};
  VOX_TRY(const auto chosen, choose_parts(path,
                                          {{"--time", "volumes", map.volumes, options.time},
                                           {"--channel", "channel", 1, options.channel}},
                                          options, map.info));
  VOX_TRY(const uint64_t bytes, volume_bytes(map, path));
  uint64_t all = 0;
  if (__builtin_mul_overflow(bytes, static_cast<uint64_t>(map.volumes), &all))
    return bad_input(path, "MRC header: too many voxels: expected at most 2^62 bytes");
  const uint64_t offset = map.offset + bytes * static_cast<uint64_t>(chosen[0]);
  if (!packed) {
    const uint64_t size = file->bytes().size(), there = size - std::min(size, map.offset);
    if (there < all)
      return bad_input(
          path, fmt::format("voxel data at byte {} end after {} bytes: expected {}", map.offset, there, all));
  }
  std::unique_ptr<VolumeSource> source;
  if (packed || map.nibbles) VOX_CHECK(stream->skip(offset - mrc::header_bytes));
  if (map.nibbles) {
    VOX_TRY(source, open_nibbles(std::move(stream), map, options, ctx));
  } else if (packed) {
    VOX_TRY(source, streamed_source(std::move(stream), map.info, map.layout, options, ctx));
  } else {
    VOX_TRY(source, mapped_source(std::move(file), offset, map.info, map.layout, options, ctx));
  }
  return reordered(std::move(source), map.order, ctx);
}

}  // namespace voxkit
