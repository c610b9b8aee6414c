// --type and --range of the tools that write volumes.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "formats/convert.h"
#include "formats/source.h"
#include "tools/common/main.h"

namespace voxkit::cli {

using OpenSource = std::function<Result<std::unique_ptr<VolumeSource>>()>;

/// Opens a source and converts it to `type` (as it is, without one). Where values have to be mapped, their
/// range is `range` (sample values), or is measured, for which a source that is read front to back is opened
/// again; nothing in `open_again` where that cannot be, and then the range that the file states is used, or
/// ErrorCode::usage asks for --range.
Result<std::unique_ptr<VolumeSource>> retyped(std::unique_ptr<VolumeSource> source,
                                              const OpenSource& open_again,
                                              const std::optional<TargetType>& type,
                                              const std::optional<ValueRange>& range, Run& run);

/// Declares --range: sample values LO,HI, for what `help` says.
void declare_range_option(CommandLine& line, std::optional<ValueRange>& range, const std::string& help);

}  // namespace voxkit::cli
