// Samples that are numbers in text.
#pragma once

#include <memory>

#include "formats/input_stream.h"
#include "formats/volume.h"

namespace voxkit {

/// Numbers between blanks, commas and line ends, to samples in the machine's byte order. What is no number of
/// the type, or longer than 64 characters, is ErrorCode::input. Not of bits and halfs.
std::unique_ptr<InputStream> text_samples(std::unique_ptr<InputStream> text, SampleType type);

}  // namespace voxkit
