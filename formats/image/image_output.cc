#include "formats/image/image_output.h"

#include <OpenImageIO/filesystem.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>
#include <vector>

#include "formats/image/image_check.h"
#include "formats/image/image_input.h"
#include "formats/image/tiff_file.h"

namespace voxkit {
namespace {

constexpr size_t buffer_bytes = size_t{1} << 16;

/// That the directory and the pixels of a TIFF file that was written are in it.
Status check_written_tiff(const std::string& path) {
  VOX_TRY(const auto file, TiffFile::open(path));
  const TiffPage& page = file->pages().front();
  const uint64_t size = file->bytes().size();
  for (uint64_t i = 0; i < page.offsets.count; ++i) {
    const uint64_t at = file->number(page.offsets, i), length = file->number(page.counts, i);
    if (at == 0 || length == 0 || at > size || length > size - at)
      return bad_input(path, "pixels are missing");
  }
  return {};
}

}  // namespace

/// A file that remembers what went wrong.
class CheckedImageOutput::File final : public OIIO::Filesystem::IOProxy {
 public:
  explicit File(const std::string& path)
      : IOProxy(path, Write), fd_(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)) {
    if (fd_ < 0) error_ = errno;
    buffer_.reserve(buffer_bytes);
  }
  ~File() override { close(); }

  const char* proxytype() const override { return "voxkit"; }
  /// errno of the first thing that went wrong, or 0.
  int failure() const { return error_; }

  void close() override {
    drain();
    if (fd_ >= 0 && ::close(std::exchange(fd_, -1)) != 0 && error_ == 0) error_ = errno;
  }
  bool seek(int64_t offset) override {
    drain();
    m_pos = offset;
    return true;
  }
  size_t write(const void* bytes, size_t count) override {
    if (buffer_.empty()) start_ = m_pos;
    const auto* const from = static_cast<const std::byte*>(bytes);
    buffer_.insert(buffer_.end(), from, from + count);
    m_pos += static_cast<int64_t>(count);
    if (buffer_.size() >= buffer_bytes) drain();
    return error_ == 0 ? count : 0;
  }
  size_t pwrite(const void* bytes, size_t count, int64_t offset) override {
    drain();
    put(static_cast<const std::byte*>(bytes), count, offset);
    return error_ == 0 ? count : 0;
  }
  size_t read(void* bytes, size_t count) override {
    const size_t got = pread(bytes, count, m_pos);
    m_pos += static_cast<int64_t>(got);
    return got;
  }
  size_t pread(void* bytes, size_t count, int64_t offset) override {
    drain();
    const ssize_t got = ::pread(fd_, bytes, count, offset);
    return got > 0 ? static_cast<size_t>(got) : 0;
  }
  size_t size() const override {
    const auto end = ::lseek(fd_, 0, SEEK_END);
    const int64_t here = buffer_.empty() ? 0 : start_ + static_cast<int64_t>(buffer_.size());
    return static_cast<size_t>(std::max<int64_t>(end, here));
  }
  void flush() const override {}

 private:
  void drain() {
    put(buffer_.data(), buffer_.size(), start_);
    buffer_.clear();
  }
  void put(const std::byte* bytes, size_t count, int64_t offset) {
    while (count > 0 && error_ == 0) {
      const ssize_t done = ::pwrite(fd_, bytes, count, offset);
      if (done < 0 && errno == EINTR) continue;
      if (done <= 0) {
        error_ = done < 0 ? errno : ENOSPC;
        return;
      }
      bytes += done, count -= static_cast<size_t>(done), offset += done;
    }
  }

  int fd_;
  int error_ = 0;
  int64_t start_ = 0;  ///< of the buffer, in the file
  std::vector<std::byte> buffer_;
};

CheckedImageOutput::CheckedImageOutput(std::string name, std::string path)
    : name_(std::move(name)), path_(std::move(path)) {}
CheckedImageOutput::~CheckedImageOutput() {
  output_.reset();  // may write to the file still
}

tl::unexpected<Error> CheckedImageOutput::failed(const std::string& why) const {
  const int error = file_ ? file_->failure() : 0;
  return fail(ErrorCode::output, name_,
              "cannot write: " + (error ? std::generic_category().message(error) : one_line(why)));
}

Status CheckedImageOutput::open(const std::string& format, const OIIO::ImageSpec& spec) {
  format_ = format;
  output_ = OIIO::ImageOutput::create(format);
  if (!output_) return failed("OpenImageIO was built without " + format);
  output_->threads(1);
  if (output_->supports("ioproxy") != 0) {
    file_ = std::make_unique<File>(path_);
    if (file_->failure() != 0 || !output_->set_ioproxy(file_.get())) return failed("cannot open the file");
  }
  if (!output_->open(path_, spec)) return failed(output_->geterror());
  return {};
}

Status CheckedImageOutput::write(int64_t y0, int64_t y1, OIIO::TypeDesc type, const void* rows) {
  if (!output_->write_scanlines(static_cast<int>(y0), static_cast<int>(y1), 0, type, rows) ||
      (file_ && file_->failure() != 0))
    return failed(output_->geterror());
  return {};
}

Status CheckedImageOutput::close() {
  const bool closed = output_->close();
  const std::string error = closed ? std::string() : output_->geterror();
  output_.reset();
  if (file_) file_->close();
  if (!closed || (file_ && file_->failure() != 0)) return failed(error);
  const Status whole = format_ == "png"    ? check_png(path_)
                       : format_ == "tiff" ? check_written_tiff(path_)
                                           : Status{};
  if (!whole) return failed(whole.error().what + ": the disk may be full");
  return {};
}

}  // namespace voxkit
