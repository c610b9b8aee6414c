// Whether PNG, JPEG and OpenEXR files are whole, before OpenImageIO opens them.
#pragma once

#include <string>

#include "formats/result.h"

namespace voxkit {

/// Follows the chunks of a PNG file and checks their checksums. libpng finds the same damage, but writes to
/// standard error.
Status check_png(const std::string& path);

/// Follows the segments of a JPEG file to its end. libjpeg fills up what a cut file lacks with grey.
Status check_jpeg(const std::string& path);

/// Follows the attributes of an OpenEXR file's headers. OpenEXR allocates as much as an attribute's size
/// says, up to 2 GiB.
Status check_exr(const std::string& path);

}  // namespace voxkit
