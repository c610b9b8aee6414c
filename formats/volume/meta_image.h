// MetaImage: what the headers of meta_image.cc mean, and how they are written.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "formats/volume/dense_source.h"
#include "formats/volume/strided_source.h"

namespace voxkit::meta {

/// The lines `Name = value` of a header; the last of them is ElementDataFile.
struct Header {
  std::string name;                           ///< of the file, for messages
  std::map<std::string, std::string> fields;  ///< by name in lower case
  std::vector<std::string> listed;            ///< file names after `ElementDataFile = LIST`

  /// Null where there is no such field.
  const std::string* find(const std::string& field) const;
  /// The error that a field is not what is expected, or not there.
  tl::unexpected<Error> wrong(const std::string& field, const std::string& expected) const;
};

/// What the header means.
struct Image {
  VolumeInfo info;
  SampleLayout layout;
  bool compressed = false, text = false;
  int64_t header_size = 0;  ///< bytes before the samples of a file; -1: the samples are its last bytes
  std::vector<int64_t> sides;
  uint64_t bytes = 0;   ///< of all samples
  uint64_t offset = 0;  ///< of the volume's first sample among them
  Strides strides;
};

/// Reads up to the line of ElementDataFile and, where that lists files, to the end. At most 1 MiB.
Result<Header> read_header(InputStream& stream);
/// What is where, and the volume chosen; notes what is dropped.
Result<Image> interpret(const Header& header, const OpenOptions& options, Context& ctx);
/// The header to write, of raw little-endian samples in `data_file`, or after it where that is "LOCAL"; notes
/// what is dropped.
std::string header_text(const std::string& path, const VolumeInfo& info, const SampleLayout& layout,
                        const std::string& data_file, Context& ctx);

}  // namespace voxkit::meta
