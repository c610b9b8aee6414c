// The directories of a TIFF file: TIFF 6.0, sections 2 and 8, BigTIFF, and the tags of SGI for volumes.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/result.h"

namespace voxkit {

/// Numbers of a tag: `count` of a TIFF type, at byte `at` of the file; all of them lie inside it.
struct TiffField {
  uint16_t type = 0;
  uint64_t count = 0, at = 0;
};

/// A directory: one image, or several slices of one where `depth` says so. Numbers are as the file has them,
/// or what the specification takes where it does not.
struct TiffPage {
  int64_t number = 0;  ///< in the chain of directories, from 0
  int64_t width = 0, height = 0, depth = 1;
  bool tiled = false;
  int64_t chunk_width = 0, chunk_height = 0, chunk_depth = 1;  ///< of a tile or a strip
  int bits = 1, samples = 1, sample_format = 1, photometric = 1;
  int compression = 1, predictor = 1, planar = 1, fill_order = 1, orientation = 1, subfile = 0;
  bool same_bits = true;     ///< all samples of a pixel have as many bits and one format
  std::optional<int> extra;  ///< of the first of the samples that are not colours: 1 associated alpha, 2 not
  bool has_photometric = false;
  TiffField offsets, counts;  ///< of strips or tiles
  TiffField colors, description;
  std::optional<std::array<uint32_t, 2>> x_resolution, y_resolution;  ///< pixels: numerator, denominator
  int resolution_unit = 2;                                            ///< 1 none, 2 inch, 3 centimetre
  bool imagej_metadata = false;

  /// A smaller copy of another page, or a mask of one: not part of a stack.
  bool is_auxiliary() const { return (subfile & 5) != 0; }
};

class TiffFile {
 public:
  /// Maps the file and reads all directories of its chain, no pixels. Errors: ErrorCode::input, where it is
  /// none, or a directory or a value lies past its end.
  static Result<std::unique_ptr<const TiffFile>> open(const std::string& path);

  const std::string& name() const { return file_->name(); }
  const std::vector<TiffPage>& pages() const { return pages_; }
  std::span<const std::byte> bytes() const { return file_->bytes(); }
  bool big_endian() const { return big_endian_; }
  /// Number i of a field of whole numbers; 0 past its end, or of other types.
  uint64_t number(const TiffField& field, uint64_t i) const;
  /// The text of a field, up to its first zero byte; at most 64 MiB.
  std::string text(const TiffField& field) const;

 private:
  TiffFile() = default;
  uint64_t load(uint64_t at, int bytes) const;
  bool read_entry(uint64_t at, bool big, TiffPage& page) const;

  std::shared_ptr<const MappedFile> file_;
  std::vector<TiffPage> pages_;
  bool big_endian_ = false;
};

/// How many directories a TIFF file has. Errors: those of TiffFile::open.
Result<int64_t> count_tiff_pages(const std::string& path);

/// "JPEG", "LZW" … or "number N".
std::string tiff_compression_name(int compression);

}  // namespace voxkit
