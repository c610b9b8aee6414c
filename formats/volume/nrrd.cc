// NRRD, http://teem.sourceforge.net/nrrd/format.html: the samples, after the header or in other files.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <optional>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/volume/dense_sink.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/nrrd_header.h"
#include "formats/volume/readers.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;
using nrrd::Encoding;
using nrrd::Header;
using nrrd::Nrrd;
using nrrd::number;

/// Numbers in text, to samples in the machine's byte order.
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
      case SampleType::f16:  // the format has neither
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

/// The stream of a file's samples, past what is to be skipped. `path` is empty where the file has no name.
Result<std::unique_ptr<InputStream>> decode(const Nrrd& facts, const std::string& path,
                                            std::unique_ptr<InputStream> stream, uint64_t bytes) {
  VOX_CHECK(skip_lines(*stream, facts.line_skip));
  if (facts.byte_skip < 0) {
    std::error_code error;
    const uint64_t size = path.empty() ? 0 : fs::file_size(path, error);
    if (path.empty() || error) return bad_input(stream->name(), "byte skip -1: expected a regular file");
    if (size < stream->position() || size - stream->position() < bytes)
      return bad_input(stream->name(), fmt::format("voxel data end after {} bytes: expected {}",
                                                   size - std::min(size, stream->position()), bytes));
    VOX_CHECK(stream->skip(size - bytes - stream->position()));
    return stream;
  }
  if (facts.encoding == Encoding::gzip) stream = gunzip(std::move(stream));
  if (facts.encoding == Encoding::bzip2) stream = bunzip2(std::move(stream));
  // As the format has it: lines are skipped in the file, bytes in what is unpacked from it.
  VOX_CHECK(stream->skip(static_cast<uint64_t>(facts.byte_skip)));
  if (facts.encoding == Encoding::text)
    stream = std::make_unique<TextStream>(std::move(stream), facts.layout.type);
  return stream;
}

/// The data of one file: mapped where they lie in it as they are.
SourceResult open_data(const Nrrd& facts, const std::string& path, std::unique_ptr<InputStream> stream,
                       const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto samples, decode(facts, path, std::move(stream), facts.bytes));
  std::error_code error;
  if (facts.encoding != Encoding::raw || path.empty() || !fs::is_regular_file(path, error))
    return streamed_source(std::move(samples), facts.info, facts.layout, options, ctx);
  VOX_TRY(auto file, MappedFile::open(path));
  return mapped_source(std::move(file), samples->position(), facts.info, facts.layout, options, ctx);
}

/// The names of several data files: a list, or a printf pattern with a range of numbers.
struct Parts {
  std::vector<std::string> listed;
  std::string prefix, suffix;
  int64_t first = 0, step = 1, count = 0;
  int width = 0;
  char pad = ' ';

  std::string name(int64_t i) const {
    if (!listed.empty()) return listed[static_cast<size_t>(i)];
    const int64_t value = first + i * step;
    return pad == '0' ? fmt::format("{}{:0{}}{}", prefix, value, width, suffix)
                      : fmt::format("{}{:{}}{}", prefix, value, width, suffix);
  }
};

/// Joins data files, each of which holds the same number of bytes.
class PartsStream final : public InputStream {
 public:
  PartsStream(Nrrd facts, Parts parts, fs::path folder, const std::string& name)
      : facts_(std::move(facts)),
        parts_(std::move(parts)),
        folder_(std::move(folder)),
        part_bytes_(facts_.bytes / static_cast<uint64_t>(parts_.count)) {
    name_ = name;
  }
  Result<size_t> read(std::span<std::byte> out) override {
    size_t done = 0;
    while (done < out.size() && (left_ > 0 || next_ < parts_.count)) {
      if (left_ == 0) {
        const std::string path = (folder_ / parts_.name(next_++)).string();
        VOX_TRY(part_, open_stream(path));
        VOX_TRY(part_, decode(facts_, path, std::move(part_), part_bytes_));
        left_ = part_bytes_;
      }
      const size_t want = static_cast<size_t>(std::min<uint64_t>(left_, out.size() - done));
      VOX_TRY(const size_t got, part_->read(out.subspan(done, want)));
      done += got;
      position_ += got;
      left_ -= got;
      if (got < want)
        return bad_input(part_->name(), fmt::format("voxel data end after {} bytes: expected {}",
                                                    part_bytes_ - left_, part_bytes_));
      if (left_ == 0) VOX_CHECK(part_->check_end());
    }
    return done;
  }

 private:
  Nrrd facts_;
  Parts parts_;
  fs::path folder_;
  uint64_t part_bytes_;
  std::unique_ptr<InputStream> part_;
  uint64_t left_ = 0;
  int64_t next_ = 0;
};

/// `PREFIX%0Nd SUFFIX FIRST LAST STEP [SUBDIM]`; nothing where the value is no such thing.
std::optional<Parts> parse_pattern(const std::vector<std::string_view>& tokens) {
  if (tokens.size() < 4) return std::nullopt;
  Parts parts;
  const std::string_view pattern = tokens[0];
  const size_t percent = pattern.find('%');
  if (percent == pattern.npos) return std::nullopt;
  size_t end = percent + 1;
  if (end < pattern.size() && pattern[end] == '0') parts.pad = '0', ++end;
  while (end < pattern.size() && pattern[end] >= '0' && pattern[end] <= '9' && parts.width < 100)
    parts.width = parts.width * 10 + (pattern[end++] - '0');
  if (end == pattern.size() || pattern[end] != 'd' || parts.width > 100) return std::nullopt;
  parts.prefix = pattern.substr(0, percent);
  parts.suffix = pattern.substr(end + 1);
  const auto first = number<int32_t>(tokens[1]), last = number<int32_t>(tokens[2]),
             step = number<int32_t>(tokens[3]);
  if (!first || !last || !step || *step == 0 || (*last - int64_t{*first}) / *step < 0) return std::nullopt;
  parts.first = *first;
  parts.step = *step;
  parts.count = (*last - int64_t{*first}) / *step + 1;
  return parts;
}

SourceResult open_parts(const Header& header, const Nrrd& facts, Parts parts,
                        std::optional<std::string_view> subdim, const fs::path& folder,
                        const OpenOptions& options, Context& ctx) {
  const int dimension = subdim ? number<int>(*subdim).value_or(0) : std::max(1, facts.dimension - 1);
  if (dimension < 1 || dimension > facts.dimension)
    return header.wrong("datafile", fmt::format("files of 1 to {} axes", facts.dimension));
  // Below the full dimension each file is one piece of the slower axes; else the files share the slowest
  // axis.
  uint64_t pieces = 1;
  for (size_t axis = static_cast<size_t>(dimension); axis < facts.sizes.size(); ++axis)
    pieces *= static_cast<uint64_t>(facts.sizes[axis]);
  const uint64_t count = static_cast<uint64_t>(parts.count);
  const bool fits = dimension < facts.dimension
                        ? count == pieces
                        : count > 0 && static_cast<uint64_t>(facts.sizes.back()) % count == 0;
  if (!fits) return header.wrong("datafile", fmt::format("{} files, not {}", pieces, count));
  return streamed_source(std::make_unique<PartsStream>(facts, std::move(parts), folder, header.name),
                         facts.info, facts.layout, options, ctx);
}

SourceResult open_nrrd(const std::string& path, std::unique_ptr<InputStream> stream,
                       const OpenOptions& options, Context& ctx) {
  VOX_TRY(const Header header, nrrd::read_header(*stream));
  VOX_TRY(const Nrrd facts, nrrd::interpret(header));
  const nrrd::Field* data = header.find("datafile");
  if (!data) return open_data(facts, path, std::move(stream), options, ctx);
  fs::path folder = fs::path(path).parent_path();
  if (folder.empty()) folder = ".";  // also keeps a data file called "-" a file
  const auto tokens = nrrd::words(data->value);
  const auto token = [&](size_t i) { return i < tokens.size() ? std::optional(tokens[i]) : std::nullopt; };
  if (!tokens.empty() && tokens[0] == "LIST") {
    Parts parts;
    parts.listed = header.listed;
    parts.count = static_cast<int64_t>(header.listed.size());
    return open_parts(header, facts, std::move(parts), token(1), folder, options, ctx);
  }
  if (auto parts = parse_pattern(tokens))
    return open_parts(header, facts, std::move(*parts), token(4), folder, options, ctx);
  if (data->value.empty()) return header.wrong("datafile", "the name of a file");
  const std::string data_path = (folder / data->value).string();
  VOX_TRY(auto samples, open_stream(data_path));
  return open_data(facts, data_path, std::move(samples), options, ctx);
}

/// Samples in NAME.raw, then the header: who finds the header finds the data.
class DetachedSink final : public DenseSink {
 public:
  DetachedSink(std::unique_ptr<OutputFile> header, std::unique_ptr<OutputFile> data, const VolumeInfo& info,
               const SampleLayout& layout)
      : DenseSink(std::move(data), info, layout), header_(std::move(header)) {}

 private:
  Status committed() override { return header_->commit(); }
  std::unique_ptr<OutputFile> header_;
};

}  // namespace

SourceResult open_nrrd(const std::string& path, const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto stream, open_stream(path));
  return open_nrrd(path == "-" ? std::string() : path, std::move(stream), options, ctx);
}

SourceResult open_nrrd(std::unique_ptr<InputStream> stream, const OpenOptions& options, Context& ctx) {
  return open_nrrd(std::string(), std::move(stream), options, ctx);
}

SinkResult create_nrrd(const std::string& path, const VolumeInfo& info, bool force, Context&) {
  SampleLayout layout = storage_layout(info);
  if (info.format == VoxelFormat::bitmap) layout.type = SampleType::u8;
  const fs::path name(path);
  const bool detached = has_ending(path, ".nhdr");
  VOX_TRY(auto file, OutputFile::create(path, force));
  const std::string data_name = detached ? name.stem().string() + ".raw" : std::string();
  VOX_CHECK(file->write(nrrd::header_text(info, layout, data_name)));
  if (!detached) return std::make_unique<DenseSink>(std::move(file), info, layout);
  VOX_TRY(auto data, OutputFile::create((name.parent_path() / data_name).string(), force));
  return std::make_unique<DetachedSink>(std::move(file), std::move(data), info, layout);
}

}  // namespace voxkit
