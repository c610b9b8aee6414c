#include "formats/output_file.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <new>

namespace voxkit {
namespace {

/// A list of the temporaries that exist, which only grows: slots are reused and never freed, so that a signal
/// handler may walk it at any moment. Whoever takes the path out of a slot removes the file.
struct Slot {
  std::atomic<char*> path{nullptr};
  Slot* next = nullptr;
};
std::atomic<Slot*> slots{nullptr};
std::mutex slots_mutex;
static_assert(std::atomic<char*>::is_always_lock_free);

void remember(const std::string& path) {
  const std::lock_guard lock(slots_mutex);
  char* copy = strdup(path.c_str());
  if (copy == nullptr) throw std::bad_alloc();
  for (Slot* slot = slots; slot != nullptr; slot = slot->next) {
    char* empty = nullptr;
    if (slot->path.compare_exchange_strong(empty, copy)) return;
  }
  Slot* slot = new Slot;
  slot->path = copy;
  slot->next = slots;
  slots = slot;
}

void forget(const std::string& path) {
  const std::lock_guard lock(slots_mutex);
  for (Slot* slot = slots; slot != nullptr; slot = slot->next) {
    char* held = slot->path;
    // Only the owner of a path forgets it, and a handler that took it ends the process: `held` stays
    // readable.
    if (held != nullptr && path == held && slot->path.compare_exchange_strong(held, nullptr)) {
      std::free(held);
      return;
    }
  }
}

auto output_error(const std::string& name, const std::string& what) {
  return fail(ErrorCode::output, name, what);
}

auto system_error(const std::string& name, const char* what, int error) {
  return output_error(name, fmt::format("{}: {}", what, std::strerror(error)));
}

/// Folder of a path, "." where it names none.
std::string folder_of(const std::string& path) {
  const size_t slash = path.rfind('/');
  return slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
}

/// The file that a name leads to: a symbolic link to a file is kept and its target replaced.
std::string resolve(const std::string& path) {
  struct stat info;
  if (lstat(path.c_str(), &info) != 0 || !S_ISLNK(info.st_mode)) return path;
  char* real = realpath(path.c_str(), nullptr);
  std::string target = real != nullptr ? real : path;
  std::free(real);
  return target;
}

std::string random_suffix() {
  static constexpr char digits[] = "abcdefghijklmnopqrstuvwxyz012345";
  unsigned char random[6] = {};
  // Where there is no randomness yet (early boot), O_EXCL and the retries below still find a free name.
  [[maybe_unused]] const ssize_t got = getrandom(random, sizeof random, GRND_NONBLOCK);
  std::string suffix;
  for (unsigned char r : random) suffix += digits[r % 32];
  return suffix;
}

/// What a name means as an output.
enum class Kind { standard_output, through, file };

Result<Kind> classify(const std::string& path, bool force) {
  if (is_standard_output(path)) {
    if (isatty(STDOUT_FILENO)) {
      return output_error(path, "standard output is a terminal: binary data goes to a file or a pipe");
    }
    return Kind::standard_output;
  }
  if (path.empty()) return output_error("", "the name of the output is empty: expected a file");
  struct stat info;
  if (stat(path.c_str(), &info) == 0) {
    if (S_ISDIR(info.st_mode)) return output_error(path, "is a folder: expected the name of a file");
    if (!S_ISREG(info.st_mode)) {
      if (access(path.c_str(), W_OK) != 0) return system_error(path, "cannot be written", errno);
      return Kind::through;
    }
    if (!force) return output_error(path, "exists: use --force to overwrite");
  } else if (errno != ENOENT) {
    return system_error(path, "cannot be written", errno);
  }
  const std::string folder = folder_of(resolve(path));
  if (stat(folder.c_str(), &info) != 0 || !S_ISDIR(info.st_mode)) {
    return output_error(path, fmt::format("cannot be written: folder {} does not exist", folder));
  }
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    return system_error(path, fmt::format("cannot be written in folder {}", folder).c_str(), errno);
  }
  return Kind::file;
}

}  // namespace

bool is_standard_output(std::string_view path) {
  return path == "-" || (path.starts_with("-.") && path.find('/') == path.npos);
}

Status check_output(const std::string& path, bool force) {
  VOX_CHECK(classify(path, force));
  return {};
}

void remove_temporaries() noexcept {
  for (Slot* slot = slots; slot != nullptr; slot = slot->next) {
    if (char* path = slot->path.exchange(nullptr)) unlink(path);
  }
}

Result<std::unique_ptr<OutputFile>> OutputFile::create(const std::string& path, bool force) {
  VOX_TRY(const Kind kind, classify(path, force));
  std::unique_ptr<OutputFile> file(new OutputFile);
  file->name_ = path;
  file->force_ = force;
  if (kind == Kind::standard_output) {
    file->fd_ = STDOUT_FILENO;
    return file;
  }
  if (kind == Kind::through) {
    file->fd_ = open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY);
    if (file->fd_ < 0) return system_error(path, "cannot be opened", errno);
    if (isatty(file->fd_)) return output_error(path, "is a terminal: binary data goes to a file or a pipe");
    return file;
  }
  const std::string target = resolve(path);
  const size_t slash = target.rfind('/');
  const std::string stem = slash == std::string::npos
                               ? "." + target
                               : target.substr(0, slash + 1) + "." + target.substr(slash + 1);
  for (int attempt = 0; attempt < 100 && file->fd_ < 0; attempt++) {
    const std::string temporary = stem + ".voxkit-" + random_suffix();
    // Remembered first, so that there is no moment at which a signal leaves the file behind.
    remember(temporary);
    file->fd_ = open(temporary.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file->fd_ >= 0) {
      file->temporary_ = temporary;
    } else {
      const int error = errno;
      forget(temporary);
      if (error != EEXIST) return system_error(path, "cannot be created", error);
    }
  }
  if (file->fd_ < 0)
    return output_error(path, "cannot be created: no free name for a temporary file beside it");
  return file;
}

OutputFile::~OutputFile() {
  if (fd_ >= 0 && fd_ != STDOUT_FILENO) close(fd_);
  if (!temporary_.empty()) {
    unlink(temporary_.c_str());
    forget(temporary_);
  }
}

Status OutputFile::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd_, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      return system_error(name_, fmt::format("cannot be written after {} bytes", position_).c_str(), errno);
    }
    position_ += static_cast<uint64_t>(written);
    bytes = bytes.subspan(static_cast<size_t>(written));
  }
  return {};
}

Status OutputFile::write(const std::string& text) {
  return write(std::as_bytes(std::span(text)));
}

Status OutputFile::complete() {
  if (temporary_.empty()) {
    if (fd_ == STDOUT_FILENO) return {};
    const int closed = close(fd_);
    fd_ = -1;
    return closed == 0 ? Status{} : Status(system_error(name_, "cannot be completed", errno));
  }
  const std::string target = resolve(name_);
  struct stat old;
  // An overwritten file keeps its permissions.
  if (force_ && stat(target.c_str(), &old) == 0 && fchmod(fd_, old.st_mode & 07777) != 0) {
    return system_error(name_, "cannot be given its permissions", errno);
  }
  if (fsync(fd_) != 0) return system_error(name_, "cannot be flushed to disk", errno);
  const int closed = close(fd_);
  fd_ = -1;
  if (closed != 0) return system_error(name_, "cannot be completed", errno);
  return {};
}

Status OutputFile::give_name() {
  if (temporary_.empty()) return {};
  const std::string target = resolve(name_);
  int renamed = -1;
  if (!force_) {
    // Somebody may have created the name since it was checked.
    renamed = renameat2(AT_FDCWD, temporary_.c_str(), AT_FDCWD, target.c_str(), RENAME_NOREPLACE);
    if (renamed != 0 && errno == EEXIST) return output_error(name_, "exists: use --force to overwrite");
  }
  // Some file systems know no RENAME_NOREPLACE.
  if (renamed != 0) {
    if (!force_ && access(target.c_str(), F_OK) == 0)
      return output_error(name_, "exists: use --force to overwrite");
    renamed = rename(temporary_.c_str(), target.c_str());
  }
  if (renamed != 0) return system_error(name_, "cannot be given its name", errno);
  forget(temporary_);
  temporary_.clear();
  named_ = true;
  return {};
}

Status OutputFile::commit() {
  VOX_CHECK(complete());
  VOX_CHECK(give_name());
  return flush_folder();
}

Status OutputFile::swap_in() {
  if (!force_ || temporary_.empty()) return give_name();
  const std::string target = resolve(name_);
  struct stat old;
  const bool replaces = stat(target.c_str(), &old) == 0 && S_ISREG(old.st_mode);
  swapped_ =
      replaces && renameat2(AT_FDCWD, temporary_.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0;
  if (swapped_) return {};
  // A file system that knows no RENAME_EXCHANGE: the old file is gone, so the new one stays.
  lasts_ = replaces;
  return give_name();
}

/// A name is as durable as the data only once its folder is on disk; file systems that cannot do that say
/// EINVAL.
Status OutputFile::flush_folder() {
  if (!named_ && !swapped_) return {};
  const int folder = open(folder_of(resolve(name_)).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) return {};
  const bool failed = fsync(folder) != 0 && errno == EIO;
  close(folder);
  if (failed) return output_error(name_, "its folder cannot be flushed to disk: Input/output error");
  return {};
}

void OutputFile::swap_out() {
  const std::string target = resolve(name_);
  if (swapped_)
    renameat2(AT_FDCWD, temporary_.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE);
  else if (named_ && !lasts_)
    unlink(target.c_str());
}

Status commit_together(std::span<const std::unique_ptr<OutputFile>> files) {
  for (const auto& file : files) VOX_CHECK(file->complete());
  for (size_t i = 0; i < files.size(); ++i)
    if (Status named = files[i]->swap_in(); !named) {
      for (size_t done = i + 1; done-- > 0;) files[done]->swap_out();
      return named;
    }
  // Old files go with their temporary names.
  for (const auto& file : files) VOX_CHECK(file->flush_folder());
  return {};
}

}  // namespace voxkit
