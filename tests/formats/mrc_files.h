// Headers of MRC files, byte by byte.
#pragma once

#include <string>

#include "tests/formats/file_format_test.h"

namespace voxkit {

/// A valid header of 1024 bytes.
struct MrcHeader {
  explicit MrcHeader(int32_t mode, Index3 dims, bool big = false) : big_endian(big) {
    for (size_t i = 0; i < 3; ++i) {
      set(4 * i, static_cast<int32_t>(dims[static_cast<int>(i)]));
      set(28 + 4 * i, static_cast<int32_t>(10));
      set(40 + 4 * i, 5.0f * static_cast<float>(i + 1));
      set(64 + 4 * i, static_cast<int32_t>(i + 1));
    }
    set(12, mode);
    set(80, -1.0f);
    bytes.replace(208, 8, big ? std::string("MAP \x11\x11\0\0", 8) : std::string("MAP DD\0\0", 8));
  }
  template <class T>
  void set(size_t at, T value) {
    bytes.replace(at, sizeof(T), sample_text<T>({value}, big_endian));
  }
  bool big_endian;
  std::string bytes = std::string(1024, '\0');
};

}  // namespace voxkit
