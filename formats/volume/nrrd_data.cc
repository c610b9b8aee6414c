// The encodings of NRRD data.
#include "formats/volume/nrrd_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <filesystem>

#include "formats/mapped_file.h"
#include "formats/volume/text_samples.h"

namespace voxkit::nrrd {
namespace {

namespace fs = std::filesystem;

/// Pairs of hexadecimal digits, to bytes.
class HexStream final : public InputStream {
 public:
  explicit HexStream(std::unique_ptr<InputStream> text) : text_(std::move(text)), buffer_(size_t{1} << 16) {
    name_ = text_->name();
  }
  Result<size_t> read(std::span<std::byte> out) override {
    size_t done = 0;
    while (done < out.size()) {
      if (begin_ == filled_) {
        VOX_TRY(filled_, text_->read(std::as_writable_bytes(std::span(buffer_))));
        begin_ = 0;
        if (filled_ == 0) break;
      }
      const char c = buffer_[begin_++];
      if (c == ' ' || (c >= '\t' && c <= '\r')) continue;
      const int digit = c >= '0' && c <= '9'   ? c - '0'
                        : c >= 'a' && c <= 'f' ? c - 'a' + 10
                        : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                               : -1;
      if (digit < 0)
        return bad_input(name_,
                         fmt::format("hex data, byte {}: \"{}\": expected hexadecimal digits", position_, c));
      if (high_ < 0) {
        high_ = digit;
        continue;
      }
      out[done++] = static_cast<std::byte>(high_ << 4 | digit);
      high_ = -1;
      ++position_;
    }
    return done;
  }

 private:
  std::unique_ptr<InputStream> text_;
  std::vector<char> buffer_;
  size_t begin_ = 0, filled_ = 0;
  int high_ = -1;  ///< the first digit of a byte begun
};

Status skip_lines(InputStream& stream, int64_t count) {
  for (int64_t line = 0; line < count; ++line)
    for (std::byte c{}; c != std::byte{'\n'};) {
      VOX_TRY(const size_t got, stream.read({&c, 1}));
      if (got == 0)
        return bad_input(stream.name(),
                         fmt::format("ends after {} lines: expected {} before the data", line, count));
    }
  return {};
}

}  // namespace

Result<std::unique_ptr<InputStream>> decode(const Nrrd& facts, const std::string& path,
                                            std::unique_ptr<InputStream> stream, uint64_t bytes) {
  VOX_CHECK(skip_lines(*stream, facts.line_skip));
  const auto skip_to_last = [bytes](InputStream& samples, uint64_t size) -> Status {
    const uint64_t there = size - std::min(size, samples.position());
    if (there < bytes)
      return bad_input(samples.name(),
                       fmt::format("voxel data end after {} bytes: expected {}", there, bytes));
    return samples.skip(there - bytes);
  };
  std::error_code error;
  if (facts.byte_skip < 0 && facts.encoding == Encoding::raw && fs::is_regular_file(path, error)) {
    VOX_CHECK(skip_to_last(*stream, fs::file_size(path, error)));
    return stream;
  }
  if (facts.encoding == Encoding::gzip) stream = gunzip(std::move(stream));
  if (facts.encoding == Encoding::bzip2) stream = bunzip2(std::move(stream));
  if (facts.byte_skip < 0) {  // how many there are before the data is only known once all are there
    VOX_TRY(auto file, MappedFile::spool(*stream));
    const uint64_t size = file->bytes().size();
    auto samples = stream_of(std::move(file));
    VOX_CHECK(skip_to_last(*samples, size));
    return samples;
  }
  // As the format has it: lines are skipped in the file, bytes in what is unpacked from it.
  VOX_CHECK(stream->skip(static_cast<uint64_t>(facts.byte_skip)));
  if (facts.encoding == Encoding::text) stream = text_samples(std::move(stream), facts.layout.type);
  if (facts.encoding == Encoding::hex) stream = std::make_unique<HexStream>(std::move(stream));
  return stream;
}

}  // namespace voxkit::nrrd
