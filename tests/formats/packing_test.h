// Packed bytes for the tests of what unpacks them.
#pragma once

#include <bzlib.h>
#include <zlib.h>

#include <string>

namespace voxkit {

/// `window`: the header that zlib puts around it.
inline std::string deflated_text(std::string text, int window) {
  z_stream z{};
  deflateInit2(&z, 6, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY);
  std::string packed(text.size() + 1000 + text.size() / 100, '\0');
  z.next_in = reinterpret_cast<Bytef*>(text.data());
  z.avail_in = static_cast<uInt>(text.size());
  z.next_out = reinterpret_cast<Bytef*>(packed.data());
  z.avail_out = static_cast<uInt>(packed.size());
  deflate(&z, Z_FINISH);
  packed.resize(z.total_out);
  deflateEnd(&z);
  return packed;
}

inline std::string gzip_text(const std::string& text) {
  return deflated_text(text, 15 + 16);
}
inline std::string zlib_text(const std::string& text) {
  return deflated_text(text, 15);
}

inline std::string bzip2_text(std::string text) {
  unsigned length = static_cast<unsigned>(text.size() + 1000 + text.size() / 50);
  std::string packed(length, '\0');
  BZ2_bzBuffToBuffCompress(packed.data(), &length, text.data(), static_cast<unsigned>(text.size()), 1, 0, 0);
  packed.resize(length);
  return packed;
}

}  // namespace voxkit
