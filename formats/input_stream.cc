#include "formats/input_stream.h"

#include <bzlib.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <isa-l/igzip_lib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

#include "formats/context.h"

namespace voxkit {
namespace {

constexpr size_t buffer_bytes = size_t{256} << 10;

/// A file descriptor, buffered for short reads; long reads go past the buffer.
class FileStream final : public InputStream {
 public:
  FileStream(int fd, std::string name) : fd_(fd), buffer_(buffer_bytes) {
    name_ = std::move(name);
    struct stat st {};
    const off_t at = ::fstat(fd_, &st) == 0 && S_ISREG(st.st_mode) ? ::lseek(fd_, 0, SEEK_CUR) : -1;
    // Standard input may have been handed over somewhere inside a file.
    if (at >= 0) end_ = static_cast<uint64_t>(std::max<off_t>(st.st_size - at, 0));
  }
  ~FileStream() override {
    if (fd_ != STDIN_FILENO) ::close(fd_);
  }

  Result<size_t> read(std::span<std::byte> out) override {
    size_t done = 0;
    while (done < out.size()) {
      if (begin_ < filled_) {
        const size_t take = std::min(filled_ - begin_, out.size() - done);
        std::memcpy(out.data() + done, buffer_.data() + begin_, take);
        begin_ += take;
        done += take;
      } else if (out.size() - done >= buffer_.size()) {
        VOX_TRY(const size_t count, read_some(out.subspan(done)));
        if (count == 0) break;
        done += count;
      } else {
        VOX_TRY(filled_, read_some(buffer_));
        begin_ = 0;
        if (filled_ == 0) break;
      }
    }
    position_ += done;
    return done;
  }

  Status skip(uint64_t count) override {
    const uint64_t buffered = std::min<uint64_t>(count, filled_ - begin_);
    if (!end_ || count == buffered) return InputStream::skip(count);
    if (count > *end_ - std::min(position_, *end_))
      return bad_input(
          name_, fmt::format("ends after {} bytes: expected {} more after byte {}", *end_, count, position_));
    if (::lseek(fd_, static_cast<off_t>(count - buffered), SEEK_CUR) < 0)
      return bad_input(name_, std::strerror(errno));
    begin_ += static_cast<size_t>(buffered);
    position_ += count;
    return {};
  }

 private:
  Result<size_t> read_some(std::span<std::byte> out) {
    for (;;) {
      const ssize_t n = ::read(fd_, out.data(), out.size());
      if (n >= 0) return static_cast<size_t>(n);
      if (errno != EINTR) return bad_input(name_, fmt::format("cannot be read: {}", std::strerror(errno)));
      VOX_CHECK(check_interrupt());
    }
  }

  int fd_;
  std::vector<std::byte> buffer_;
  size_t begin_ = 0, filled_ = 0;
  std::optional<uint64_t> end_;  ///< position of the end, where the file can seek
};

/// What gunzip and bunzip2 share: packed bytes come in by the buffer, members follow one another.
class UnpackStream : public InputStream {
 public:
  UnpackStream(std::unique_ptr<InputStream> packed, const char* coding)
      : packed_(std::move(packed)), coding_(coding), buffer_(buffer_bytes) {
    name_ = packed_->name();
  }

  Result<size_t> read(std::span<std::byte> out) final {
    size_t done = 0;
    while (done < out.size() && !ended_) {
      VOX_CHECK(check_interrupt());
      if (broken_) return tl::unexpected<Error>(*broken_);
      if (begin_ == filled_ && !has_more()) VOX_CHECK(refill());
      if (between_members_) {
        VOX_CHECK(next_member());
        continue;
      }
      const size_t space = std::min<size_t>(out.size() - done, size_t{1} << 30);
      VOX_TRY(const size_t count, unpack(out.subspan(done, space)));
      done += count;
      position_ += count;
    }
    return done;
  }

  Status check_end() final {
    std::byte one{};
    if (const auto count = read({&one, 1}); !count) return tl::unexpected<Error>(count.error());
    return {};
  }

 protected:
  /// Unpacks from [begin_, filled_) until the output is full, the input is used up, or the member ends
  /// (member_end).
  virtual Result<size_t> unpack(std::span<std::byte> out) = 0;
  virtual Status start_member() = 0;
  /// Whether something may come without further input.
  virtual bool has_more() const { return false; }

  void member_end() { between_members_ = true; }
  /// Nothing follows.
  void data_end() { ended_ = true; }
  /// Says so, and keeps saying so: the library's state is not to be used again.
  tl::unexpected<Error> corrupt(const std::string& why) {
    broken_ = Error{ErrorCode::input, name_,
                    fmt::format("corrupt {} data at packed byte {}: {}", coding_, packed_position(), why)};
    return tl::unexpected<Error>(*broken_);
  }
  Status truncated() const {
    return bad_input(name_,
                     fmt::format("{} data end at packed byte {}: expected more", coding_, packed_position()));
  }

  std::unique_ptr<InputStream> packed_;
  const char* coding_;
  std::vector<std::byte> buffer_;
  size_t begin_ = 0, filled_ = 0;

 private:
  uint64_t packed_position() const { return packed_->position() - (filled_ - begin_); }
  Status refill() {
    VOX_TRY(filled_, packed_->read(buffer_));
    begin_ = 0;
    if (filled_ > 0) return {};
    if (!between_members_) return truncated();
    ended_ = true;
    return {};
  }
  /// Skips padding; what is not padding must be another member.
  Status next_member() {
    while (begin_ < filled_ && buffer_[begin_] == std::byte{0}) ++begin_, padded_ = true;
    if (begin_ == filled_) return {};
    if (padded_) return corrupt("data after the padding: expected zeros to the end");
    between_members_ = false;
    return start_member();
  }

  bool between_members_ = false, padded_ = false, ended_ = false;
  std::optional<Error> broken_;
};

enum class Deflated { gzip, either };  ///< which header is expected: gzip's, or that or zlib's

/// By ISA-L, which takes half the time of zlib where data are packed well.
class InflateStream final : public UnpackStream {
 public:
  InflateStream(std::unique_ptr<InputStream> packed, Deflated header)
      : UnpackStream(std::move(packed), header == Deflated::gzip ? "gzip" : "zlib"), header_(header) {
    ::isal_inflate_init(&state_);
  }

 private:
  Status start_member() override {
    const bool gzip = buffer_[begin_] == std::byte{0x1f};
    if (header_ == Deflated::gzip && !gzip) return corrupt("expected gzip members");
    ::isal_inflate_reset(&state_);
    state_.crc_flag = gzip ? ISAL_GZIP : ISAL_ZLIB;  // a header and a checksum
    started_ = true;
    return {};
  }
  bool has_more() const override { return full_; }
  Result<size_t> unpack(std::span<std::byte> out) override {
    if (!started_) VOX_CHECK(start_member());
    state_.next_in = reinterpret_cast<uint8_t*>(buffer_.data() + begin_);
    state_.avail_in = static_cast<uint32_t>(filled_ - begin_);
    state_.next_out = reinterpret_cast<uint8_t*>(out.data());
    state_.avail_out = static_cast<uint32_t>(out.size());
    const int code = ::isal_inflate(&state_);
    begin_ = filled_ - state_.avail_in;
    full_ = state_.avail_out == 0;
    if (code < 0 || code == ISAL_NEED_DICT) return corrupt(reason(code));
    if (state_.block_state == ISAL_BLOCK_FINISH) {
      full_ = false;
      if (state_.crc_flag == ISAL_GZIP)
        member_end();
      else
        data_end();  // ISA-L may have taken bytes behind them
    }
    return out.size() - state_.avail_out;
  }
  const char* reason(int code) const {
    switch (code) {
      case ISAL_INVALID_WRAPPER:
      case ISAL_UNSUPPORTED_METHOD:
        return header_ == Deflated::gzip ? "expected gzip members" : "expected a header of zlib or gzip";
      case ISAL_NEED_DICT:
        return "expected no dictionary";
      case ISAL_INCORRECT_CHECKSUM:
        return "the checksum is wrong";
      case ISAL_INVALID_LOOKBACK:
        return "a distance leads to before the data";
      default:
        return "a block or a code is none";
    }
  }

  Deflated header_;
  inflate_state state_;
  bool started_ = false;
  bool full_ = false;  ///< the output was, so that there may be more in the state
};

class Bunzip2Stream final : public UnpackStream {
 public:
  explicit Bunzip2Stream(std::unique_ptr<InputStream> packed) : UnpackStream(std::move(packed), "bzip2") {
    ready_ = ::BZ2_bzDecompressInit(&bzip2_, 0, 0) == BZ_OK;
  }
  ~Bunzip2Stream() override {
    if (ready_) ::BZ2_bzDecompressEnd(&bzip2_);
  }

 private:
  Status start_member() override {
    if (ready_) ::BZ2_bzDecompressEnd(&bzip2_);
    bzip2_ = {};
    ready_ = ::BZ2_bzDecompressInit(&bzip2_, 0, 0) == BZ_OK;
    return {};
  }
  Result<size_t> unpack(std::span<std::byte> out) override {
    if (!ready_) return fail(ErrorCode::limit, name_, "no memory to unpack bzip2 data");
    bzip2_.next_in = reinterpret_cast<char*>(buffer_.data() + begin_);
    bzip2_.avail_in = static_cast<unsigned>(filled_ - begin_);
    bzip2_.next_out = reinterpret_cast<char*>(out.data());
    bzip2_.avail_out = static_cast<unsigned>(out.size());
    const int code = ::BZ2_bzDecompress(&bzip2_);
    begin_ = filled_ - bzip2_.avail_in;
    switch (code) {
      case BZ_OK:
        break;
      case BZ_STREAM_END:
        member_end();
        break;
      case BZ_MEM_ERROR:
        return fail(ErrorCode::limit, name_, "no memory to unpack bzip2 data");
      case BZ_DATA_ERROR_MAGIC:
        return corrupt("expected the magic bytes BZh");
      default:
        return corrupt("a checksum or a code is wrong");
    }
    return out.size() - bzip2_.avail_out;
  }

  bz_stream bzip2_{};
  bool ready_ = false;
};

class PrependStream final : public InputStream {
 public:
  PrependStream(std::string bytes, std::unique_ptr<InputStream> rest)
      : bytes_(std::move(bytes)), rest_(std::move(rest)) {
    name_ = rest_->name();
  }
  Result<size_t> read(std::span<std::byte> out) override {
    const size_t take = std::min(bytes_.size() - begin_, out.size());
    std::memcpy(out.data(), bytes_.data() + begin_, take);
    begin_ += take;
    position_ += take;
    if (take == out.size()) return take;
    VOX_TRY(const size_t count, rest_->read(out.subspan(take)));
    position_ += count;
    return take + count;
  }
  Status skip(uint64_t count) override {
    const size_t take = static_cast<size_t>(std::min<uint64_t>(bytes_.size() - begin_, count));
    VOX_CHECK(rest_->skip(count - take));
    begin_ += take;
    position_ += count;
    return {};
  }
  Status check_end() override { return rest_->check_end(); }

 private:
  std::string bytes_;
  size_t begin_ = 0;
  std::unique_ptr<InputStream> rest_;
};

}  // namespace

Status InputStream::read_exactly(std::span<std::byte> out, const char* what) {
  const uint64_t start = position_;
  VOX_TRY(const size_t count, read(out));
  if (count == out.size()) return {};
  return bad_input(
      name_, fmt::format("{}: ends after {} bytes: expected {}", what, start + count, start + out.size()));
}

Status InputStream::skip(uint64_t count) {
  std::vector<std::byte> scratch(static_cast<size_t>(std::min<uint64_t>(count, buffer_bytes)));
  while (count > 0) {
    const size_t want = static_cast<size_t>(std::min<uint64_t>(count, scratch.size()));
    VOX_TRY(const size_t got, read(std::span(scratch).first(want)));
    count -= got;
    if (got < want)
      return bad_input(name_, fmt::format("ends after {} bytes: expected {} more", position_, count));
  }
  return {};
}

Result<std::optional<std::string>> InputStream::read_line(size_t limit) {
  std::string line;
  for (;;) {
    char c = 0;
    VOX_TRY(const size_t count, read(std::as_writable_bytes(std::span(&c, 1))));
    if (count == 0 && line.empty()) return std::optional<std::string>{};
    if (count == 0 || c == '\n') break;
    if (line.size() == limit)
      return bad_input(name_,
                       fmt::format("the line that ends past byte {} is too long: expected at most {} bytes",
                                   position_, limit));
    line += c;
  }
  if (!line.empty() && line.back() == '\r') line.pop_back();
  return std::optional(std::move(line));
}

Result<std::unique_ptr<InputStream>> open_stream(const std::string& path) {
  if (path == "-") return std::make_unique<FileStream>(STDIN_FILENO, "standard input");
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return bad_input(path, std::strerror(errno));
  auto stream = std::make_unique<FileStream>(fd, path);
  struct stat st {};
  if (::fstat(fd, &st) == 0 && S_ISDIR(st.st_mode)) return bad_input(path, "is a folder: expected a file");
  return stream;
}

std::unique_ptr<InputStream> gunzip(std::unique_ptr<InputStream> packed) {
  return std::make_unique<InflateStream>(std::move(packed), Deflated::gzip);
}
std::unique_ptr<InputStream> inflate(std::unique_ptr<InputStream> packed) {
  return std::make_unique<InflateStream>(std::move(packed), Deflated::either);
}
std::unique_ptr<InputStream> bunzip2(std::unique_ptr<InputStream> packed) {
  return std::make_unique<Bunzip2Stream>(std::move(packed));
}
std::unique_ptr<InputStream> prepend(std::string bytes, std::unique_ptr<InputStream> rest) {
  return std::make_unique<PrependStream>(std::move(bytes), std::move(rest));
}

}  // namespace voxkit
