// DICOM's run-length coding of pixels: PS3.5 annex G.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "formats/little_endian.h"

namespace voxkit {

/// Decodes `samples` samples of `sample_bytes` (1 or 2) into little-endian `out`, or returns false where the
/// code is none or ends before. Safe on any bytes. One segment for each byte of a sample, the most
/// significant first; within it runs as in PackBits.
inline bool decode_dicom_rle(std::span<const std::byte> code, int64_t samples, int sample_bytes,
                             std::byte* out) {
  constexpr size_t header_bytes = 64;
  if (code.size() < header_bytes || load_le<uint32_t>(code.data()) != static_cast<uint32_t>(sample_bytes))
    return false;
  for (int segment = 0; segment < sample_bytes; ++segment) {
    size_t at = load_le<uint32_t>(code.data() + 4 + 4 * segment);
    if (at < header_bytes) return false;
    std::byte* target = out + (sample_bytes - 1 - segment);
    for (int64_t done = 0; done < samples;) {
      if (at >= code.size()) return false;
      const int control = static_cast<int8_t>(code[at++]);
      if (control == -128) continue;
      const int64_t count = control >= 0 ? control + 1 : 1 - control;
      const size_t taken = control >= 0 ? static_cast<size_t>(count) : 1;
      if (taken > code.size() - at) return false;
      for (int64_t i = 0; i < count && done < samples; ++i, ++done)
        target[done * sample_bytes] = code[at + (control >= 0 ? static_cast<size_t>(i) : 0)];
      at += taken;
    }
  }
  return true;
}

}  // namespace voxkit
