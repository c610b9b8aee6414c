// NRRD, http://teem.sourceforge.net/nrrd/format.html: the samples, after the header or in other files.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <optional>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/volume/data_files.h"
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

SourceResult open_parts(const Header& header, Nrrd facts, const DataFiles& parts,
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
    VOX_TRY(paths.emplace_back(), data_file_path(header.name, folder.string(), parts.name(i), options));
    facts.info.files.push_back(paths.back());
  }
  const uint64_t part = facts.bytes / paths.size();
  const auto open = [facts, part](const std::string& path) -> Result<std::unique_ptr<InputStream>> {
    VOX_TRY(auto stream, open_stream(path));
    return decode(facts, path, std::move(stream), part);
  };
  return open_samples(facts, join_files(header.name, std::move(paths), part, open), options, ctx);
}

SourceResult open_header(const std::string& path, std::unique_ptr<InputStream> stream, const Header& header,
                         Nrrd facts, const OpenOptions& options, Context& ctx) {
  const nrrd::Field* data = header.find("datafile");
  if (!path.empty()) facts.info.files = {path};
  if (!data) return open_data(facts, path, std::move(stream), options, ctx);
  fs::path folder = fs::path(path).parent_path();
  if (folder.empty()) folder = ".";  // also keeps a data file called "-" a file
  const auto tokens = words(data->value);
  const auto token = [&](size_t i) { return i < tokens.size() ? std::optional(tokens[i]) : std::nullopt; };
  if (!tokens.empty() && tokens[0] == "LIST") {
    DataFiles parts;
    parts.listed = header.listed;
    parts.count = static_cast<int64_t>(header.listed.size());
    return open_parts(header, std::move(facts), parts, token(1), folder, options, ctx);
  }
  if (const auto parts = parse_data_pattern(tokens))
    return open_parts(header, std::move(facts), *parts, token(4), folder, options, ctx);
  VOX_TRY(const std::string samples_path, data_file_path(header.name, folder.string(), data->value, options));
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
  const std::string data_path = detached_data_file(path);
  VOX_TRY(auto file, OutputFile::create(path, force));
  VOX_CHECK(file->write(nrrd::header_text(info, layout, fs::path(data_path).filename().string())));
  if (data_path.empty()) return std::make_unique<DenseSink>(std::move(file), info, layout);
  VOX_TRY(auto data, OutputFile::create(data_path, force));
  return std::make_unique<DetachedSink>(std::move(file), std::move(data), info, layout);
}

}  // namespace voxkit
