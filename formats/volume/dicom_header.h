// What the header of a DICOM file says about its frames, and where their pixels lie: PS3.3 sections C.7.6,
// C.8.8.3 and C.8.4.9.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formats/result.h"
#include "formats/volume/dicom_data.h"

namespace voxkit {

/// One slice; vectors are empty where nothing is said.
struct DicomFrame {
  std::vector<double> position;       ///< 3, in mm
  std::vector<double> orientation;    ///< 6: directions of a row and of a column
  std::vector<double> pixel_spacing;  ///< 2, above 0: distance of rows, distance of columns, in mm
  double thickness = 0;               ///< distance of slices, else their thickness, in mm; 0: not said
  bool odd_spacing = false;           ///< the file's distances of pixels are no two numbers above 0
  bool odd_thickness = false;         ///< its distance of slices, else their thickness, is no number above 0
  double slope = 1, intercept = 0;
  double time = 0;  ///< number of its time step
  /// Where its pixels begin in DicomHeader::pixels: bytes of the one part there (bits of pixels of one bit),
  /// or the first fragment, and how many.
  int64_t first = 0, fragments = 1;
};

/// Colours of indices, 16 bits each.
struct DicomPalette {
  int first = 0;  ///< the index of the first entry
  std::vector<std::array<uint16_t, 3>> colors;
};

/// What a file says of all its frames.
struct DicomHeader {
  std::string path, series, description, photometric, transfer_syntax, instance_id;
  int64_t columns = 0, rows = 0, samples = 1;
  bool planar = false;  ///< a picture of each colour after the other
  int bits_allocated = 0, bits_stored = 0, high_bit = 0;
  bool is_signed = false, is_float = false;
  std::optional<int64_t> padding;  ///< the sample that stands for nothing measured
  bool padding_range = false;      ///< others do, too
  std::optional<int64_t> instance;
  std::shared_ptr<const DicomPalette> palette;
  bool big_endian = false;
  bool encapsulated = false;     ///< compressed: `pixels` are fragments of code streams
  std::vector<FilePart> pixels;  ///< all inside the file; one where not encapsulated
  std::vector<DicomFrame> frames;
  bool frames_are_times = false;  ///< a film: no places of slices
  bool has_table = false;         ///< values have a meaning that is no straight line
  bool has_time = false;          ///< the file numbers its time step

  /// Of one frame, uncompressed; of pixels of one bit rounded up to bytes.
  int64_t slice_bytes() const { return (columns * rows * samples * bits_allocated + 7) / 8; }
};

/// Reads the header of a file that starts as DICOM files do. Nothing where the file is none, or holds no
/// image (a DICOMDIR, a report). Every length is checked against the file. Errors: ErrorCode::input.
Result<std::optional<DicomHeader>> read_dicom_header(const std::string& path);

}  // namespace voxkit
