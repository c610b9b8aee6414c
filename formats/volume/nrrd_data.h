// The encodings of NRRD data: from the bytes of a file to those of samples.
#pragma once

#include <memory>
#include <string>

#include "formats/volume/nrrd_header.h"

namespace voxkit::nrrd {

/// The stream of a file's samples, past what is to be skipped; `bytes` of samples are in it. `path` is empty
/// where the file has no name.
Result<std::unique_ptr<InputStream>> decode(const Nrrd& facts, const std::string& path,
                                            std::unique_ptr<InputStream> stream, uint64_t bytes);

}  // namespace voxkit::nrrd
