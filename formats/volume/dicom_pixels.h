// The pixels of a DICOM frame: PS3.5 section 8 and annexes A.4 and G, PS3.3 section C.7.6.3.
#pragma once

#include <vector>

#include "formats/volume.h"
#include "formats/volume/dicom_header.h"
#include "formats/volume/open_volume.h"

namespace voxkit {

/// What pixels become.
struct DicomPixels {
  SampleType type = SampleType::u8;  ///< of samples, once bits that are no part of them are gone
  int components = 1;                ///< of what `read_dicom_samples` gives: 3 for colours
  VoxelFormat format = VoxelFormat::density8;
  bool colors = false;  ///< indices are looked up in the palette
};

/// Errors: ErrorCode::input, naming what is not read; ErrorCode::limit where a frame takes more than half of
/// `memory_limit`.
Result<DicomPixels> dicom_pixels(const DicomHeader& header, const OpenOptions& options,
                                 uint64_t memory_limit);

/// All samples of a frame, little endian; colours as RGB, pixel by pixel; bits as bytes of 0 and 1.
Status read_dicom_samples(const DicomHeader& header, const DicomFrame& frame, const DicomPixels& pixels,
                          std::vector<std::byte>& samples);

}  // namespace voxkit
