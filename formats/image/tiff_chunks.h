// The strips and tiles of a TIFF file: what they unpack to. TIFF 6.0, sections 9, 13 and 14, and its
// technical notes 2 (Deflate) and 3 (predictor of floats).
#pragma once

#include <cstdint>
#include <span>

#include "formats/image/tiff_file.h"

namespace voxkit {

/// Whether strips and tiles of that compression are unpacked here: none, LZW, Deflate, PackBits, Zstandard.
bool unpacks_tiff(int compression);

/// Of a page whose compression `unpacks_tiff` names: samples of a pixel within a strip or tile, bytes of a
/// row, and of all of it. Samples of less than 8 bits, or of 9 to 31 without being whole bytes, are packed,
/// the highest bit first; rows begin at bytes.
struct TiffChunkLayout {
  int samples = 1;
  uint64_t row_bytes = 0, bytes = 0;
};
/// Nothing where 63 bits do not hold it.
std::optional<TiffChunkLayout> tiff_chunk_layout(const TiffPage& page);

/// Unpacks strip or tile `chunk` of the page into `out`, which has room for as many whole rows as are wanted
/// of it; it lies `moved` bytes behind where the directory says. Samples of whole bytes come in the byte
/// order of this machine. Safe on any bytes. Errors: ErrorCode::input where the file has no such chunk, or it
/// does not unpack to so many bytes.
Status unpack_tiff_chunk(const TiffFile& file, const TiffPage& page, uint64_t chunk, std::span<std::byte> out,
                         uint64_t moved = 0);

}  // namespace voxkit
