#include "formats/image/tiff_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <unordered_set>

namespace voxkit {
namespace {

constexpr uint64_t longest_text = uint64_t{64} << 20;

/// Bytes of one number of a TIFF type; 0 for those that are not known.
constexpr uint64_t type_bytes(uint16_t type) {
  constexpr uint8_t sizes[] = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4, 0, 0, 8, 8, 8};
  return type < std::size(sizes) ? sizes[type] : 0;
}

template <class T>
T limited(uint64_t value) {
  return static_cast<T>(std::min<uint64_t>(value, std::numeric_limits<T>::max()));
}

}  // namespace

uint64_t TiffFile::load(uint64_t at, int bytes) const {
  uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) {
    const auto byte = std::to_integer<uint64_t>(file_->bytes()[at + static_cast<uint64_t>(i)]);
    value |= byte << (8 * (big_endian_ ? bytes - 1 - i : i));
  }
  return value;
}

uint64_t TiffFile::number(const TiffField& field, uint64_t i) const {
  const bool whole = field.type == 1 || field.type == 3 || field.type == 4 || field.type == 13 ||
                     field.type == 16 || field.type == 18;
  if (!whole || i >= field.count) return 0;
  const uint64_t bytes = type_bytes(field.type);
  return load(field.at + i * bytes, static_cast<int>(bytes));
}

std::string TiffFile::text(const TiffField& field) const {
  if (type_bytes(field.type) != 1) return {};
  const auto* first = reinterpret_cast<const char*>(file_->bytes().data() + field.at);
  const std::string all(first, std::min(field.count, longest_text));
  return all.substr(0, all.find('\0'));
}

/// Takes what one entry of a directory says; false where its values lie past the end of the file.
bool TiffFile::read_entry(uint64_t at, bool big, TiffPage& page) const {
  const auto tag = static_cast<uint16_t>(load(at, 2));
  TiffField field{static_cast<uint16_t>(load(at + 2, 2)), load(at + 4, big ? 8 : 4), at + (big ? 12 : 8)};
  const uint64_t bytes = type_bytes(field.type), size = file_->bytes().size();
  if (bytes == 0 || field.count == 0) return true;  // nothing that is known
  if (field.count > size / bytes) return false;
  if (field.count * bytes > (big ? 8 : 4)) {
    field.at = load(field.at, big ? 8 : 4);
    if (field.at > size || field.count * bytes > size - field.at) return false;
  }
  const uint64_t first = number(field, 0);
  const auto rational = [&]() -> std::optional<std::array<uint32_t, 2>> {
    if (field.type != 5) return std::nullopt;
    return {{static_cast<uint32_t>(load(field.at, 4)), static_cast<uint32_t>(load(field.at + 4, 4))}};
  };
  const auto all_alike = [&] {
    for (uint64_t i = 1; i < std::min<uint64_t>(field.count, 65535); ++i)
      if (number(field, i) != first) page.same_bits = false;
  };
  switch (tag) {
    case 254:
      page.subfile = limited<int>(first);
      break;
    case 255:  // the old tag: 2 is a smaller copy
      if (first == 2) page.subfile |= 1;
      break;
    case 256:
      page.width = limited<int64_t>(first);
      break;
    case 257:
      page.height = limited<int64_t>(first);
      break;
    case 258:
      page.bits = limited<int>(first);
      all_alike();
      break;
    case 259:
      page.compression = limited<int>(first);
      break;
    case 262:
      page.photometric = limited<int>(first);
      page.has_photometric = true;
      break;
    case 266:
      page.fill_order = limited<int>(first);
      break;
    case 270:
      page.description = field;
      break;
    case 273:
    case 324:
      page.offsets = field;
      break;
    case 274:
      page.orientation = limited<int>(first);
      break;
    case 277:
      page.samples = limited<int>(first);
      break;
    case 278:
      if (!page.tiled) page.chunk_height = limited<int64_t>(first);
      break;
    case 279:
    case 325:
      page.counts = field;
      break;
    case 282:
      page.x_resolution = rational();
      break;
    case 283:
      page.y_resolution = rational();
      break;
    case 284:
      page.planar = limited<int>(first);
      break;
    case 296:
      page.resolution_unit = limited<int>(first);
      break;
    case 317:
      page.predictor = limited<int>(first);
      break;
    case 320:
      page.colors = field;
      break;
    case 322:
      page.tiled = true;
      page.chunk_width = limited<int64_t>(first);
      break;
    case 323:
      page.tiled = true;
      page.chunk_height = limited<int64_t>(first);
      break;
    case 338:
      page.extra = limited<int>(first);
      break;
    case 339:
      page.sample_format = limited<int>(first);
      all_alike();
      break;
    case 32997:
      page.depth = limited<int64_t>(first);
      break;
    case 32998:
      page.chunk_depth = limited<int64_t>(first);
      break;
    case 50838:
    case 50839:
      page.imagej_metadata = true;
      break;
    default:
      break;
  }
  return true;
}

Result<std::unique_ptr<const TiffFile>> TiffFile::open(const std::string& path) {
  std::unique_ptr<TiffFile> tiff(new TiffFile);
  VOX_TRY(tiff->file_, MappedFile::open(path));
  const auto bytes = tiff->file_->bytes();
  const uint64_t size = bytes.size();
  const auto none = [&] { return bad_input(path, "not a TIFF file: expected its mark at byte 0"); };
  if (size < 8) return none();
  const uint64_t order = tiff->load(0, 2);
  tiff->big_endian_ = order == 0x4d4d;
  const uint64_t version = tiff->load(2, 2);
  const bool big = version == 43;
  if ((order != 0x4d4d && order != 0x4949) || (version != 42 && !big) || (big && size < 16)) return none();
  const int offset_bytes = big ? 8 : 4, count_bytes = big ? 8 : 2;
  const uint64_t entry_bytes = big ? 20 : 12;

  std::unordered_set<uint64_t> seen;
  uint64_t used = 0;  // by directories: more than the file has where some lie over each other
  for (uint64_t at = tiff->load(big ? 8 : 4, offset_bytes); at != 0;) {
    const auto broken = [&](const char* why) {
      return bad_input(
          path, fmt::format("corrupt TIFF file: the directory of page {} {}", tiff->pages_.size(), why));
    };
    const auto fixed = static_cast<uint64_t>(count_bytes + offset_bytes);
    if (size < fixed || at > size - fixed || !seen.insert(at).second)
      return broken("leads past the end of the file or back");
    const uint64_t entries = tiff->load(at, count_bytes);
    at += static_cast<uint64_t>(count_bytes);
    if (entries > (size - at - static_cast<uint64_t>(offset_bytes)) / entry_bytes)
      return broken("leads past the end of the file or back");
    used += fixed + entries * entry_bytes;
    if (used > size) return broken("lies over others");
    TiffPage page;
    page.number = static_cast<int64_t>(tiff->pages_.size());
    for (uint64_t i = 0; i < entries; ++i, at += entry_bytes)
      if (!tiff->read_entry(at, big, page)) return broken("has values past the end of the file");
    if (!page.tiled) {
      page.chunk_width = page.width;
      page.chunk_height = page.chunk_height > 0 ? std::min(page.chunk_height, page.height) : page.height;
      page.chunk_depth = 1;
      // One strip for all slices is a tile of them all.
      if (page.depth > 1 && page.offsets.count == 1) {
        page.tiled = true;
        page.chunk_height = page.height;
        page.chunk_depth = page.depth;
      }
    }
    tiff->pages_.push_back(page);
    at = tiff->load(at, offset_bytes);
  }
  if (tiff->pages_.empty()) return bad_input(path, "corrupt TIFF file: it has no pages");
  return tiff;
}

Result<int64_t> count_tiff_pages(const std::string& path) {
  VOX_TRY(const auto file, TiffFile::open(path));
  return std::ssize(file->pages());
}

std::string tiff_compression_name(int compression) {
  struct Name {
    int number;
    const char* text;
  };
  constexpr Name names[] = {{1, "none"},
                            {2, "CCITT RLE"},
                            {3, "CCITT G3"},
                            {4, "CCITT G4"},
                            {5, "LZW"},
                            {6, "old JPEG"},
                            {7, "JPEG"},
                            {8, "Deflate"},
                            {9, "JBIG"},
                            {10, "JBIG"},
                            {32766, "NeXT"},
                            {32771, "CCITT RLE of words"},
                            {32773, "PackBits"},
                            {32809, "ThunderScan"},
                            {32946, "Deflate"},
                            {34661, "JBIG"},
                            {34676, "SGI Log"},
                            {34677, "SGI Log24"},
                            {33003, "JPEG 2000"},
                            {33005, "JPEG 2000"},
                            {34712, "JPEG 2000"},
                            {34887, "LERC"},
                            {34892, "lossy JPEG of DNG"},
                            {34925, "LZMA"},
                            {34933, "PNG"},
                            {34934, "JPEG XR"},
                            {50000, "Zstandard"},
                            {50001, "WebP"},
                            {50002, "JPEG XL"}};
  for (const Name& name : names)
    if (name.number == compression) return name.text;
  return fmt::format("number {}", compression);
}

}  // namespace voxkit
