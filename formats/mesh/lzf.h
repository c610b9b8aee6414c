// Bytes packed as LZF.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "formats/result.h"

namespace voxkit {

/// Unpacks LZF (Marc Lehmann's liblzf): runs of bytes as they are, and copies of up to 264 bytes that are at
/// most 8192 back. `sink` is called with the bytes in their order, some at a time. ErrorCode::input, of the
/// file `name`, where they do not become exactly `size`, or a copy begins before the first; `sink`'s errors.
Status unpack_lzf(std::span<const std::byte> packed, uint64_t size, const std::string& name,
                  const std::function<Status(std::span<const std::byte>)>& sink);

}  // namespace voxkit
