// The header of a DICOM slice, and where its pixels lie: PS3.5 sections 7, 8 and A.4, PS3.10 section 7.
//
// Read here and not by GDCM, whose parser aborts the process on some damaged files.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/result.h"

namespace voxkit {

/// A run of bytes in a file.
struct FilePart {
  int64_t offset = 0, bytes = 0;
};

/// What a slice's header says; vectors are empty where it does not say.
struct DicomHeader {
  std::string path, series, photometric, transfer_syntax;
  int64_t columns = 0, rows = 0, samples = 1;
  double frames = 1;
  int bits_allocated = 0, bits_stored = 0, high_bit = 0;
  bool is_signed = false;
  double slope = 1, intercept = 0;
  std::optional<int64_t> instance;
  std::vector<double> position;       ///< 3, in mm
  std::vector<double> orientation;    ///< 6: directions of a row and of a column
  std::vector<double> pixel_spacing;  ///< 2: distance of rows, distance of columns, in mm
  double thickness = 1;               ///< distance of slices, else their thickness, in mm
  bool big_endian = false;
  bool encapsulated = false;     ///< compressed: `pixels` are fragments of a code stream
  std::vector<FilePart> pixels;  ///< all inside the file; one where not encapsulated

  int64_t slice_bytes() const { return columns * rows * (bits_allocated / 8); }
};

/// Reads the header of a file that starts as DICOM files do. Nothing where the file is none, or holds no
/// image (a DICOMDIR, a report). Every length is checked against the file.
Result<std::optional<DicomHeader>> read_dicom_header(const std::string& path);

}  // namespace voxkit
