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
  const char* folder = std::getenv("TMPDIR");
  std::string path = fmt::format("{}/voxkit-XXXXXX", folder && *folder ? folder : "/tmp");
  Descriptor file{::mkostemp(path.data(), O_CLOEXEC)};
  if (file.fd < 0)
    return fail(ErrorCode::output, path,
                fmt::format("cannot create a temporary file: {}", std::strerror(errno)));
  ::unlink(path.c_str());
  std::vector<std::byte> buffer(size_t{1} << 20);
  for (;;) {
    VOX_CHECK(check_interrupt());
    VOX_TRY(const size_t count, stream.read(buffer));
    if (count == 0) break;
    for (size_t done = 0; done < count;) {
      const ssize_t n = ::write(file.fd, buffer.data() + done, count - done);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0)
        return fail(ErrorCode::output, folder ? folder : "/tmp",
                    fmt::format("cannot spool {}: {}", stream.name(), std::strerror(errno)));
      done += static_cast<size_t>(n);
    }
  }
  VOX_TRY(auto bytes, map(file.fd, stream.name()));
  std::shared_ptr<MappedFile> mapped(new MappedFile);
  mapped->bytes_ = bytes;
  mapped->name_ = stream.name();
  return mapped;
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
