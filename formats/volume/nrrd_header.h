// The text header of NRRD files: what nrrd.cc reads and writes before the samples.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/input_stream.h"
#include "formats/result.h"
#include "formats/volume.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/strided_source.h"
#include "formats/volume/words.h"

namespace voxkit::nrrd {

/// The value of a field or of a key, and the line it is on.
struct Field {
  std::string value;
  int line = 0;
};
using Fields = std::map<std::string, Field>;

/// The header as lines.
struct Header {
  std::string name;                 ///< of the file, for messages
  Fields fields;                    ///< by name in lower case without spaces
  Fields keys;                      ///< key/value pairs
  std::vector<std::string> listed;  ///< file names after `data file: LIST`

  const Field* find(const std::string& field) const {
    const auto it = fields.find(field);
    return it == fields.end() ? nullptr : &it->second;
  }
  /// The error that a field is not what is expected, or not there.
  tl::unexpected<Error> wrong(const std::string& field, const std::string& expected) const;
};

enum class Encoding { raw, gzip, bzip2, text, hex };

/// What the header means.
struct Nrrd {
  VolumeInfo info;
  SampleLayout layout;
  std::optional<double> fill;  ///< the sample that stands for nothing measured
  Encoding encoding = Encoding::raw;
  int64_t line_skip = 0, byte_skip = 0;  ///< byte_skip -1: the data are the last bytes of the file
  int dimension = 0;
  std::vector<int64_t> sizes;
  uint64_t bytes = 0;   ///< of all samples of the file
  uint64_t offset = 0;  ///< of the volume's first sample among them
  Strides strides;
};

/// Reads up to the blank line or, where the data are in other files, to the end. At most 16 MiB.
Result<Header> read_header(InputStream& stream);
/// nrrd_axes.cc: which axis is what, the volume chosen, where it is; notes what is dropped.
Result<Nrrd> interpret(const Header& header, const OpenOptions& options, Context& ctx);
/// nrrd_text.cc: the header to write, of raw little-endian samples after it or, if it is not empty, in
/// `data_file`.
std::string header_text(const VolumeInfo& info, const SampleLayout& layout, const std::string& data_file);

// Fields of a kind.
Result<SampleType> parse_type(const Header& header);
Result<Encoding> parse_encoding(const Header& header);
/// 0 where the field is missing.
Result<int64_t> parse_skip(const Header& header, const std::string& name, int64_t least);
/// One number for each axis; nan stands for an axis without, as for all where the field is missing.
Result<std::vector<double>> parse_axis_numbers(const Header& header, const std::string& name, int dimension);
/// Vectors such as "(1,0,0)"; "none" becomes an empty one. The field is there.
Result<std::vector<std::vector<double>>> parse_vectors(const Header& header, const std::string& name,
                                                       size_t count);
/// Texts such as "mm". The field is there.
Result<std::vector<std::string>> parse_texts(const Header& header, const std::string& name, size_t count);

// Keys of our own, for what the format has no field for.
inline constexpr std::string_view slope_key = "voxkit slope", intercept_key = "voxkit intercept",
                                  format_key = "voxkit format", fill_key = "voxkit fill",
                                  labels_key = "voxkit labels", space_key = "voxkit space code";

}  // namespace voxkit::nrrd
