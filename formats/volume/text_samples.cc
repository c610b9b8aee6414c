#include "formats/volume/text_samples.h"

#include <fmt/format.h>

#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "formats/volume/words.h"

namespace voxkit {
namespace {

class TextStream final : public InputStream {
 public:
  TextStream(std::unique_ptr<InputStream> text, SampleType type)
      : text_(std::move(text)), type_(type), buffer_(size_t{1} << 16) {
    name_ = text_->name();
  }
  Result<size_t> read(std::span<std::byte> out) override {
    size_t done = 0;
    while (done < out.size()) {
      if (sample_begin_ == sample_end_) {
        VOX_TRY(const bool more, next_sample());
        if (!more) break;
      }
      out[done++] = sample_[sample_begin_++];
      ++position_;
    }
    return done;
  }

 private:
  Result<bool> next_sample() {
    std::string token;
    for (;; ++begin_) {
      if (begin_ == filled_) {
        VOX_TRY(filled_, text_->read(std::as_writable_bytes(std::span(buffer_))));
        begin_ = 0;
        if (filled_ == 0) break;
      }
      const char c = buffer_[begin_];
      const bool between = c == ' ' || c == ',' || (c >= '\t' && c <= '\r');
      if (between && !token.empty()) break;
      if (between) continue;
      if (token.size() == 64) return wrong(token);
      token += c;
    }
    if (token.empty()) return false;
    bool stored = false;
    switch (type_) {
      case SampleType::u8:
        stored = store<uint8_t>(token);
        break;
      case SampleType::i8:
        stored = store<int8_t>(token);
        break;
      case SampleType::u16:
        stored = store<uint16_t>(token);
        break;
      case SampleType::i16:
        stored = store<int16_t>(token);
        break;
      case SampleType::u32:
        stored = store<uint32_t>(token);
        break;
      case SampleType::i32:
        stored = store<int32_t>(token);
        break;
      case SampleType::u64:
        stored = store<uint64_t>(token);
        break;
      case SampleType::i64:
        stored = store<int64_t>(token);
        break;
      case SampleType::f32:
        stored = store<float>(token);
        break;
      case SampleType::f64:
        stored = store<double>(token);
        break;
      case SampleType::bit:
      case SampleType::f16:  // no format has either in text
        break;
    }
    if (!stored) return wrong(token);
    ++samples_;
    return true;
  }
  template <class T>
  bool store(const std::string& token) {
    const auto value = number<T>(token);
    if (!value) return false;
    std::memcpy(sample_, &*value, sizeof(T));
    sample_begin_ = 0;
    sample_end_ = sizeof(T);
    return true;
  }
  tl::unexpected<Error> wrong(const std::string& token) const {
    return bad_input(
        name_, fmt::format("ascii data, sample {}: \"{}\": expected a number of the header's type", samples_,
                           token));
  }

  std::unique_ptr<InputStream> text_;
  SampleType type_;
  std::vector<char> buffer_;
  size_t begin_ = 0, filled_ = 0;
  std::byte sample_[8]{};
  size_t sample_begin_ = 0, sample_end_ = 0;
  uint64_t samples_ = 0;
};

}  // namespace

std::unique_ptr<InputStream> text_samples(std::unique_ptr<InputStream> text, SampleType type) {
  return std::make_unique<TextStream>(std::move(text), type);
}

}  // namespace voxkit
