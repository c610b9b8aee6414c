// Which volume of a file that has several: time steps, channels.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/volume.h"
#include "formats/volume/open_volume.h"

namespace voxkit {

/// What a file may have more than one of, and which of them the user wants.
struct PartCount {
  const char* option = "";  ///< that chooses: "--time"
  const char* what = "";    ///< several of them: "time steps"
  int64_t count = 1;
  std::optional<int64_t> wanted;
};

/// The number of the part to read, for each kind; of what there is one of, 0. Adds to info.parts what there
/// are several of. Errors: ErrorCode::input, naming `file`, the options and what there is, where no choice
/// was made (and not options.any_part), or where there is no such part.
Result<std::vector<int64_t>> choose_parts(const std::string& file, const std::vector<PartCount>& kinds,
                                          const OpenOptions& options, VolumeInfo& info);
/// For formats of one volume a file.
Status only_part(const std::string& file, const OpenOptions& options);

}  // namespace voxkit
