// Output that appears whole or not at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "formats/result.h"

namespace voxkit {

/// Bytes written beside the final name and renamed over it by `commit`. Until then, and after any error,
/// signal or crash, the final name is untouched; the temporary is removed by the destructor and by SIGINT,
/// SIGTERM and SIGHUP.
/// "-", or "-.ENDING", is standard output, written through as it comes; refused where that is a terminal.
class OutputFile {
 public:
  /// Fails with ErrorCode::output if `path` exists and not `force`, or if its folder cannot be written.
  static Result<std::unique_ptr<OutputFile>> create(const std::string& path, bool force);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// Appends. Errors: ErrorCode::output.
  Status write(std::span<const std::byte> bytes);
  Status write(const std::string& text);
  /// Bytes written so far.
  uint64_t position() const { return position_; }
  const std::string& name() const { return name_; }
  /// Path of the temporary file (for libraries that insist on writing by name); empty for "-".
  const std::string& temporary() const { return temporary_; }
  /// Flushes to disk and gives the file its final name. Errors: ErrorCode::output; without `force` also where
  /// such a file has come into being in the meantime.
  Status commit();

 private:
  friend Status commit_together(std::span<const std::unique_ptr<OutputFile>> files);
  OutputFile() = default;
  /// Permissions, the disk, and no more writing: what is left is the name.
  Status complete();
  Status give_name();
  Status flush_folder();
  /// The same, but an old file of that name changes places with the new one; and back.
  Status swap_in();
  void swap_out();
  int fd_ = -1;
  bool force_ = false, named_ = false, swapped_ = false, lasts_ = false;
  uint64_t position_ = 0;
  std::string name_, temporary_;
};

/// `commit` of several files that belong together: all of them have their names then, or none. Where one
/// cannot, those before it lose theirs again, and the old files are back.
Status commit_together(std::span<const std::unique_ptr<OutputFile>> files);

/// Whether a name is that of standard output: "-", or "-.ENDING", whose ending says what is written to it.
bool is_standard_output(std::string_view path);

/// The checks of `OutputFile::create` without creating anything: for a tool to run before any work.
Status check_output(const std::string& path, bool force);
/// Removes the temporaries of all open OutputFiles; async-signal-safe.
void remove_temporaries() noexcept;

}  // namespace voxkit
