// What the pixels of a TIFF page are as voxels, and reading rows of them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/image/tiff_file.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/open_volume.h"

namespace voxkit {

/// How samples of a page become voxels.
struct TiffPixels {
  SampleLayout layout;  ///< of what `read_tiff_rows` gives: little endian; bits as bytes of 0 and 1
  VoxelFormat format = VoxelFormat::density8;
  SampleType sample_type = SampleType::u8;
  int first = 0, count = 1;    ///< samples of a pixel that are taken
  bool colors = false;         ///< indices are looked up in the page's palette: grey, or RGB
  bool divides_alpha = false;  ///< colours are stored multiplied by alpha
  bool by_library = false;     ///< OpenImageIO unpacks it
};

/// Whether the samples of a pixel are one colour, of 8 bits each, rather than channels.
bool is_tiff_color(const TiffPage& page);

/// What the pixels of a page become; of samples that are channels, number `sample`. Errors:
/// ErrorCode::input, naming what is not read.
Result<TiffPixels> tiff_pixels(const TiffFile& file, const TiffPage& page, int sample,
                               const OpenOptions& options);

/// Rows y0 .. y1 of slice z of a page, as `pixels.layout` says; its pixels lie `moved` bytes behind where the
/// directory says. Errors: ErrorCode::input for damaged files.
Status read_tiff_rows(const TiffFile& file, const TiffPage& page, const TiffPixels& pixels, int64_t z,
                      int64_t y0, int64_t y1, std::byte* out, uint64_t moved = 0);

/// "24 x 20 with 1 channel of u16".
std::string describe(const TiffPage& page);

}  // namespace voxkit
