// Bytes read front to back: files, standard input, and what they unpack to.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "formats/result.h"

namespace voxkit {

/// Bytes that can be read once, front to back.
class InputStream {
 public:
  virtual ~InputStream() = default;
  /// Reads up to out.size() bytes and returns how many; fewer only at the end of the data. Errors:
  /// ErrorCode::input, of the system or of the coding (corrupt gzip, say).
  virtual Result<size_t> read(std::span<std::byte> out) = 0;

  /// Reads exactly out.size() bytes, or fails with "ends after N bytes: expected …".
  Status read_exactly(std::span<std::byte> out, const char* what);
  /// Discards `count` bytes; cheap where the file can seek.
  virtual Status skip(uint64_t count);
  /// Once everything wanted has been read: checks what guards it, such as the checksum after packed data.
  virtual Status check_end() { return {}; }
  /// One line without its end (LF or CR LF); fails past `limit` bytes. At the end of data: an empty optional.
  Result<std::optional<std::string>> read_line(size_t limit = 1 << 16);

  const std::string& name() const { return name_; }
  uint64_t position() const { return position_; }

 protected:
  std::string name_;       ///< for messages
  uint64_t position_ = 0;  ///< bytes delivered so far; kept by implementations
};

/// Opens a file; "-" is standard input. Errors: ErrorCode::input.
Result<std::unique_ptr<InputStream>> open_stream(const std::string& path);
/// Decompress on the fly; concatenated members are followed, trailing zeros allowed. The memory used does not
/// depend on the data.
std::unique_ptr<InputStream> gunzip(std::unique_ptr<InputStream> packed);
/// The same of zlib data, of which there is one member, and what is behind it is not looked at; or of gzip
/// data.
std::unique_ptr<InputStream> inflate(std::unique_ptr<InputStream> packed);
std::unique_ptr<InputStream> bunzip2(std::unique_ptr<InputStream> packed);
/// Gives back bytes that were read ahead (to recognise a format) in front of the rest.
std::unique_ptr<InputStream> prepend(std::string bytes, std::unique_ptr<InputStream> rest);

}  // namespace voxkit
