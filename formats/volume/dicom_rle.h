// DICOM's run-length coding of pixels: PS3.5 annex G.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "formats/little_endian.h"

namespace voxkit {

/// Decodes `pixels` pixels of `components` samples of `sample_bytes` (1 or 2) into little-endian `out`, pixel
/// by pixel, or returns false where the code is none or ends before. Safe on any bytes. One segment for each
/// byte of each sample of a pixel, the most significant first; within it runs as in PackBits.
inline bool decode_dicom_rle(std::span<const std::byte> code, int64_t pixels, int components,
                             int sample_bytes, std::byte* out) {
  constexpr size_t header_bytes = 64;
  if (code.size() < header_bytes ||
      load_le<uint32_t>(code.data()) != static_cast<uint32_t>(components * sample_bytes) ||
      components * sample_bytes > 15)
    return false;
  for (int segment = 0; segment < components * sample_bytes; ++segment) {
    size_t at = load_le<uint32_t>(code.data() + 4 + 4 * segment);
    if (at < header_bytes) return false;
    const int component = segment / sample_bytes;
    std::byte* target = out + component * sample_bytes + (sample_bytes - 1 - segment % sample_bytes);
    for (int64_t done = 0; done < pixels;) {
      if (at >= code.size()) return false;
      const int control = static_cast<int8_t>(code[at++]);
      if (control == -128) continue;
      const int64_t count = control >= 0 ? control + 1 : 1 - control;
      const size_t taken = control >= 0 ? static_cast<size_t>(count) : 1;
      if (taken > code.size() - at) return false;
      for (int64_t i = 0; i < count && done < pixels; ++i, ++done)
        target[done * components * sample_bytes] = code[at + (control >= 0 ? static_cast<size_t>(i) : 0)];
      at += taken;
    }
  }
  return true;
}

}  // namespace voxkit
