// Opening an image by OpenImageIO, with the checks that it leaves to its callers.
#pragma once

#include <OpenImageIO/imageio.h>

#include <memory>
#include <string>

#include "formats/context.h"
#include "formats/result.h"

namespace voxkit {

/// The first line of what OpenImageIO says; its longer messages go on with advice for programmers.
std::string one_line(std::string text);

/// What follows the last dot, in lower case.
std::string ending_of(const std::string& name);

/// OpenImageIO's name of the format that a file's ending means, or null. Naming it keeps the library from
/// trying every reader it has on a damaged file.
const char* image_format(const std::string& name);

/// "640 x 480 with 3 channels of uint8".
std::string describe(const OIIO::ImageSpec& spec);

/// Tells OpenImageIO the memory limit.
void limit_image_size(const Context& ctx);

/// Opens an image and checks that its size is one that its file and our memory can hold.
Result<std::unique_ptr<OIIO::ImageInput>> open_image(const std::string& path, uint64_t memory_limit);

}  // namespace voxkit
