// The table of volume formats: what a name's ending means.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "formats/volume/readers.h"

namespace voxkit {

struct VolumeFormat {
  std::string_view name;                      ///< in reports
  std::span<const std::string_view> endings;  ///< of files that are read
  /// The first so many of them are also written.
  size_t written;
  SourceResult (*open)(const std::string& name, const OpenOptions& options, Context& ctx);
  SinkResult (*create)(const std::string& name, const VolumeInfo& info, bool force, Context& ctx);
  /// Whether files hold integers of 32 bits.
  bool wide_integers;
  bool images;  ///< a file a slice
};

/// The format that `name` ends in; null where it is none.
const VolumeFormat* find_volume_format(std::string_view name);

/// Endings that are read, or written, separated by spaces, without those of images.
std::string volume_endings(bool written);

}  // namespace voxkit
