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
#include "formats/volume/facts.h"
#include "formats/volume/nrrd_data.h"
#include "formats/volume/readers.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;
using nrrd::decode;
using nrrd::Encoding;
using nrrd::Header;
using nrrd::Nrrd;
using nrrd::number;

/// The volume in the samples of a stream.
SourceResult open_samples(const Nrrd& facts, std::unique_ptr<InputStream> samples, const OpenOptions& options,
                          Context& ctx) {
  VOX_CHECK(samples->skip(facts.offset));
  return strided_source(std::move(samples), facts.strides, facts.info, facts.layout, options, ctx);
}

/// The data of one file: mapped where they lie in it as they are.
SourceResult open_data(const Nrrd& facts, const std::string& path, std::unique_ptr<InputStream> stream,
                       const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto samples, decode(facts, path, std::move(stream), facts.bytes));
  std::error_code error;
  if (facts.encoding != Encoding::raw || path.empty() || !fs::is_regular_file(path, error))
    return open_samples(facts, std::move(samples), options, ctx);
  VOX_TRY(auto file, MappedFile::open(path));
  const uint64_t first = samples->position();
  const uint64_t there = file->bytes().size() - std::min<uint64_t>(file->bytes().size(), first);
  if (there < facts.bytes)
    return bad_input(path, fmt::format("voxel data at byte {} end after {} bytes: expected {}", first, there,
                                       facts.bytes));
  return strided_source(std::move(file), first + facts.offset, facts.strides, facts.info, facts.layout,
                        options, ctx);
}

/// The path of a data file that a header names. Errors: ErrorCode::input where it is not a regular file, or
/// outside of the header's folder without leave to be there.
Result<std::string> data_path(const Header& header, const fs::path& folder, const std::string& name,
                              const OpenOptions& options) {
  const auto wrong = [&](const std::string& what) {
    return bad_input(header.name, fmt::format("data file \"{}\": {}", name.substr(0, 200), what));
  };
  if (name.empty()) return wrong("expected the name of a file");
  if (!options.allow_outside && leaves_folder(folder.string(), name))
    return wrong("lies outside of the header's folder: expected --allow-outside");
  std::string path = (folder / name).string();
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) return bad_input(path, error ? error.message() : "No such file or directory");
  if (!fs::is_regular_file(status)) return wrong("is not a regular file");
  return path;
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
  PartsStream(Nrrd facts, std::vector<std::string> paths, const std::string& name)
      : facts_(std::move(facts)), paths_(std::move(paths)), part_bytes_(facts_.bytes / paths_.size()) {
    name_ = name;
  }
  Result<size_t> read(std::span<std::byte> out) override {
    size_t done = 0;
    while (done < out.size() && (left_ > 0 || next_ < paths_.size())) {
      if (left_ == 0) {
        const std::string& path = paths_[next_++];
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
  /// Files that are skipped as a whole are not opened.
  Status skip(uint64_t count) override {
    for (; left_ == 0 && next_ < paths_.size() && count >= part_bytes_; ++next_) {
      count -= part_bytes_;
      position_ += part_bytes_;
    }
    return InputStream::skip(count);
  }

 private:
  Nrrd facts_;
  std::vector<std::string> paths_;
  uint64_t part_bytes_;
  std::unique_ptr<InputStream> part_;
  uint64_t left_ = 0;
  size_t next_ = 0;
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

SourceResult open_parts(const Header& header, Nrrd facts, const Parts& parts,
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
  std::vector<std::string> paths;  // no more than there are files
  for (int64_t i = 0; i < parts.count; ++i) {
    VOX_TRY(paths.emplace_back(), data_path(header, folder, parts.name(i), options));
    facts.info.files.push_back(paths.back());
  }
  return open_samples(facts, std::make_unique<PartsStream>(facts, std::move(paths), header.name), options,
                      ctx);
}

SourceResult open_header(const std::string& path, std::unique_ptr<InputStream> stream, const Header& header,
                         Nrrd facts, const OpenOptions& options, Context& ctx) {
  const nrrd::Field* data = header.find("datafile");
  if (!path.empty()) facts.info.files = {path};
  if (!data) return open_data(facts, path, std::move(stream), options, ctx);
  fs::path folder = fs::path(path).parent_path();
  if (folder.empty()) folder = ".";  // also keeps a data file called "-" a file
  const auto tokens = nrrd::words(data->value);
  const auto token = [&](size_t i) { return i < tokens.size() ? std::optional(tokens[i]) : std::nullopt; };
  if (!tokens.empty() && tokens[0] == "LIST") {
    Parts parts;
    parts.listed = header.listed;
    parts.count = static_cast<int64_t>(header.listed.size());
    return open_parts(header, std::move(facts), parts, token(1), folder, options, ctx);
  }
  if (const auto parts = parse_pattern(tokens))
    return open_parts(header, std::move(facts), *parts, token(4), folder, options, ctx);
  VOX_TRY(const std::string samples_path, data_path(header, folder, data->value, options));
  facts.info.files.push_back(samples_path);
  VOX_TRY(auto samples, open_stream(samples_path));
  return open_data(facts, samples_path, std::move(samples), options, ctx);
}

SourceResult open_nrrd(const std::string& path, std::unique_ptr<InputStream> stream,
                       const OpenOptions& options, Context& ctx) {
  VOX_TRY(const Header header, nrrd::read_header(*stream));
  VOX_TRY(const Nrrd facts, nrrd::interpret(header, options, ctx));
  VOX_TRY(auto source, open_header(path, std::move(stream), header, facts, options, ctx));
  if (!facts.fill || is_color(source->info().format)) return source;
  const VolumeInfo& info = source->info();  // how wide integers are held is known now
  const bool is_float = info.format == VoxelFormat::float32;
  const double stored = is_float ? *facts.fill : info.stored(*facts.fill);
  if (is_float || info.sample(stored) == *facts.fill) source->set_fill(stored);
  return source;
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
  const std::string data_path = nrrd_data_file(path);
  VOX_TRY(auto file, OutputFile::create(path, force));
  VOX_CHECK(file->write(nrrd::header_text(info, layout, fs::path(data_path).filename().string())));
  if (data_path.empty()) return std::make_unique<DenseSink>(std::move(file), info, layout);
  VOX_TRY(auto data, OutputFile::create(data_path, force));
  return std::make_unique<DetachedSink>(std::move(file), std::move(data), info, layout);
}

std::string nrrd_data_file(const std::string& path) {
  if (!has_ending(path, ".nhdr")) return {};
  return fs::path(path).replace_extension(".raw").string();
}

}  // namespace voxkit
