// A read-only memory map of a whole file.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <utility>

#include "formats/input_stream.h"

namespace voxkit {

/// The bytes of a file as they are read, page by page, for as long as it lives.
class MappedFile {
 public:
  /// Maps a regular file. Errors: ErrorCode::input.
  static Result<std::shared_ptr<const MappedFile>> open(const std::string& path);
  /// Copies a stream (a pipe, say) to an unlinked temporary file in $TMPDIR (default /tmp) and maps that.
  /// Errors: those of the stream; ErrorCode::output where there is no room.
  static Result<std::shared_ptr<const MappedFile>> spool(InputStream& stream);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::span<const std::byte> bytes() const { return bytes_; }
  const std::string& name() const { return name_; }

 private:
  friend class TemporaryFile;
  MappedFile() = default;
  std::span<const std::byte> bytes_;
  std::string name_;
};

/// Advice about bytes of a mapped file, as far as whole pages go: they will be wanted soon; or they may leave
/// this process (not the page cache, so that reading them again is cheap).
void expect_bytes(std::span<const std::byte> bytes);
void release_bytes(std::span<const std::byte> bytes);

/// Bytes that go through an unlinked file in $TMPDIR (default /tmp).
class TemporaryFile {
 public:
  /// `name`: of what goes through, for messages.
  explicit TemporaryFile(std::string name) : name_(std::move(name)) {}
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  /// Appends. ErrorCode::output where there is no room.
  Status write(std::span<const std::byte> bytes);
  /// All that was written.
  Result<std::shared_ptr<const MappedFile>> map();

 private:
  Status create();
  std::string name_, folder_;
  int fd_ = -1;
};

/// The bytes of a mapped file front to back; any number of streams can read one file.
std::unique_ptr<InputStream> stream_of(std::shared_ptr<const MappedFile> file);

}  // namespace voxkit
