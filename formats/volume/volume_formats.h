// The table of volume formats: what a name's ending, or the first bytes of a stream, mean, and what files can
// hold.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "formats/volume/readers.h"

namespace voxkit {

struct VolumeFormat {
  std::string_view name;                      ///< in reports
  std::span<const std::string_view> endings;  ///< of files that are read
  /// The first so many of them are also written, and the first so many of these to standard output as well.
  size_t written, piped;
  /// Types of voxels that files hold: those written, or of formats that are only read, those read.
  std::string_view types;
  std::string_view random_access;  ///< "yes" where any box is read without what is around it; else where not
  SourceResult (*open)(const std::string& name, const OpenOptions& options, Context& ctx);
  SinkResult (*create)(const std::string& name, const VolumeInfo& info, bool force, Context& ctx);
  /// Of standard input; null where that cannot be, else `magic` is how it begins.
  SourceResult (*open_stream)(std::unique_ptr<InputStream> stream, const OpenOptions& options, Context& ctx);
  std::string_view magic;
  /// Whether files hold integers of 32 bits.
  bool wide_integers;
  bool images;  ///< a file a slice
};

/// All of them, in the order in which they are listed. A name may come twice, of other files.
std::span<const VolumeFormat> volume_formats();

/// The format that `name` ends in; null where it is none.
const VolumeFormat* find_volume_format(std::string_view name);

/// A stream that still has its first bytes, and the format that these are of; NRRD where they are of none.
struct KnownStream {
  std::unique_ptr<InputStream> stream;
  const VolumeFormat* format;
};
Result<KnownStream> recognise(std::unique_ptr<InputStream> stream);

/// Endings that are read, or written, separated by spaces, without those of images.
std::string volume_endings(bool written);

}  // namespace voxkit
