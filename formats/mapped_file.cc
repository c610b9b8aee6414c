#include "formats/mapped_file.h"

#include "formats/context.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <vector>

namespace voxkit {
namespace {

struct Descriptor {
  int fd;
  ~Descriptor() {
    if (fd >= 0) ::close(fd);
  }
};

/// The bytes of an open regular file.
Result<std::span<const std::byte>> map(int fd, const std::string& name) {
  struct stat st {};
  if (::fstat(fd, &st) != 0) return bad_input(name, std::strerror(errno));
  if (S_ISDIR(st.st_mode)) return bad_input(name, "is a folder: expected a file");
  if (!S_ISREG(st.st_mode)) return bad_input(name, "is not a regular file");
  if (st.st_size == 0) return std::span<const std::byte>{};
  const size_t size = static_cast<size_t>(st.st_size);
  void* address = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, fd, 0);
  if (address == MAP_FAILED)
    return bad_input(name, fmt::format("cannot be mapped: {}", std::strerror(errno)));
  return std::span(static_cast<const std::byte*>(address), size);
}

}  // namespace

Result<std::shared_ptr<const MappedFile>> MappedFile::open(const std::string& path) {
  // Non-blocking, so that a FIFO without a writer is told apart from a file instead of waited for.
  Descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  if (file.fd < 0) return bad_input(path, std::strerror(errno));
  VOX_TRY(auto bytes, map(file.fd, path));
  std::shared_ptr<MappedFile> mapped(new MappedFile);
  mapped->bytes_ = bytes;
  mapped->name_ = path;
  return mapped;
}

Result<std::shared_ptr<const MappedFile>> MappedFile::spool(InputStream& stream) {
  TemporaryFile file(stream.name());
  std::vector<std::byte> buffer(size_t{1} << 20);
  for (;;) {
    VOX_CHECK(check_interrupt());
    VOX_TRY(const size_t count, stream.read(buffer));
    if (count == 0) return file.map();
    VOX_CHECK(file.write(std::span(buffer).first(count)));
  }
}

TemporaryFile::~TemporaryFile() {
  if (fd_ >= 0) ::close(fd_);
}

Status TemporaryFile::create() {
  const char* const folder = std::getenv("TMPDIR");
  folder_ = folder && *folder ? folder : "/tmp";
  std::string path = folder_ + "/voxkit-XXXXXX";
  fd_ = ::mkostemp(path.data(), O_CLOEXEC);
  if (fd_ < 0)
    return fail(ErrorCode::output, path,
                fmt::format("cannot create a temporary file: {}", std::strerror(errno)));
  ::unlink(path.c_str());
  return {};
}

Status TemporaryFile::write(std::span<const std::byte> bytes) {
  if (fd_ < 0) VOX_CHECK(create());
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0)
      return fail(ErrorCode::output, folder_,
                  fmt::format("cannot spool {}: {}", name_, std::strerror(errno)));
    bytes = bytes.subspan(static_cast<size_t>(n));
  }
  return {};
}

Result<std::shared_ptr<const MappedFile>> TemporaryFile::map() {
  if (fd_ < 0) VOX_CHECK(create());
  VOX_TRY(auto bytes, voxkit::map(fd_, name_));
  std::shared_ptr<MappedFile> mapped(new MappedFile);
  mapped->bytes_ = bytes;
  mapped->name_ = name_;
  return mapped;
}

namespace {

void advise(std::span<const std::byte> bytes, int advice) {
  const auto page = static_cast<uintptr_t>(::sysconf(_SC_PAGESIZE));
  const uintptr_t first = reinterpret_cast<uintptr_t>(bytes.data()) / page * page,
                  last = reinterpret_cast<uintptr_t>(bytes.data() + bytes.size()) / page * page;
  // Advice may be refused; nothing depends on it.
  if (last > first) ::madvise(reinterpret_cast<void*>(first), last - first, advice);
}

}  // namespace

void expect_bytes(std::span<const std::byte> bytes) {
  advise(bytes, MADV_WILLNEED);
}
void release_bytes(std::span<const std::byte> bytes) {
  advise(bytes, MADV_DONTNEED);
}

MappedFile::~MappedFile() {
  if (!bytes_.empty()) ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());
}

namespace {

class MappedStream final : public InputStream {
 public:
  explicit MappedStream(std::shared_ptr<const MappedFile> file) : file_(std::move(file)) {
    name_ = file_->name();
  }
  Result<size_t> read(std::span<std::byte> out) override {
    const auto rest = file_->bytes().subspan(position_);
    const size_t count = std::min(out.size(), rest.size());
    std::copy_n(rest.begin(), count, out.begin());
    position_ += count;
    return count;
  }

 private:
  std::shared_ptr<const MappedFile> file_;
};

}  // namespace

std::unique_ptr<InputStream> stream_of(std::shared_ptr<const MappedFile> file) {
  return std::make_unique<MappedStream>(std::move(file));
}

}  // namespace voxkit
