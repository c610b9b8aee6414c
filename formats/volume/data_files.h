// Files of samples that a header names: one, a list, or a pattern with a range of numbers; joined where there
// are several.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/input_stream.h"
#include "formats/volume/open_volume.h"

namespace voxkit {

/// The path of a data file that `header`, for messages the name of the file, names. `folder` is the header's.
/// Errors: ErrorCode::input where it is not a regular file, or outside of the folder without leave to be
/// there.
Result<std::string> data_file_path(const std::string& header, const std::string& folder,
                                   const std::string& name, const OpenOptions& options);

/// The names of several data files.
struct DataFiles {
  std::vector<std::string> listed;  ///< or, where it is empty, those of a pattern:
  std::string prefix, suffix;
  int64_t first = 0, step = 1;
  int width = 0;
  char pad = ' ';
  int64_t count = 0;

  std::string name(int64_t i) const;
};
/// `PREFIX%0NdSUFFIX FIRST LAST STEP`, and what may follow; nothing where the words are no such thing.
std::optional<DataFiles> parse_data_pattern(const std::vector<std::string_view>& words);

/// The data of files as one stream, `part_bytes` of each; `open` gives the samples of a file. Files that are
/// skipped as a whole are not opened. `name`: for messages.
std::unique_ptr<InputStream> join_files(
    const std::string& name, std::vector<std::string> paths, uint64_t part_bytes,
    std::function<Result<std::unique_ptr<InputStream>>(const std::string& path)> open);

}  // namespace voxkit
