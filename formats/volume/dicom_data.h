// The elements of a DICOM file: PS3.5 sections 7 and A.4, PS3.10 section 7.
//
// Read here and not by GDCM, whose parser aborts the process on some damaged files.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/result.h"

namespace voxkit {

/// Group and element number of an attribute.
constexpr uint32_t dicom_tag(uint32_t group, uint32_t element) {
  return group << 16 | element;
}

/// A run of bytes in a file.
struct FilePart {
  int64_t offset = 0, bytes = 0;
};

/// Attributes of a file, or of an item of a sequence: those that are wanted (dicom_data.cc lists them).
class DicomData {
 public:
  /// Without the blanks at both ends; empty where there is none.
  std::string text(uint32_t tag) const;
  std::optional<int> number(uint32_t tag) const;
  /// A 16-bit number as the signed one that its type says it is.
  std::optional<int> signed_number(uint32_t tag) const;
  /// Decimal numbers separated by backslashes: exactly `count` finite ones (0: any number), or none.
  std::vector<double> decimals(uint32_t tag, size_t count) const;
  double decimal(uint32_t tag, double otherwise) const;
  /// Words of 16 bits.
  std::vector<uint16_t> words(uint32_t tag) const;
  bool has(uint32_t tag) const { return values.contains(tag); }
  /// The items of a sequence; none where there is none.
  const std::vector<DicomData>& items(uint32_t tag) const;
  /// The first item of a sequence; one without attributes where there is none.
  const DicomData& item(uint32_t tag) const;

  std::map<uint32_t, std::string> values;
  std::map<uint32_t, std::vector<DicomData>> sequences;
  bool big_endian = false;
};

/// A file up to the end of its pixels.
struct DicomContents {
  DicomData data;
  std::string transfer_syntax;
  bool encapsulated = false;            ///< pixels are compressed
  bool words = false;                   ///< pixels are 16-bit words
  uint32_t pixel_tag = 0;               ///< 0: no pixels
  std::vector<FilePart> pixels;         ///< all inside the file: one, or fragments of code streams
  std::vector<uint32_t> frame_offsets;  ///< of compressed frames, from the first fragment's item
};

/// Whether bytes start as a DICOM file does.
bool starts_as_dicom(std::span<const std::byte> file);

/// Parses a file that starts_as_dicom. Every length is checked against it. Errors: ErrorCode::input.
Result<DicomContents> parse_dicom(std::span<const std::byte> file, const std::string& name);

}  // namespace voxkit
