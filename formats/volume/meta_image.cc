// MetaImage files: the samples, after the header or in other files.
#include "formats/volume/meta_image.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>

#include "formats/mapped_file.h"
#include "formats/volume/data_files.h"
#include "formats/volume/dense_sink.h"
#include "formats/volume/readers.h"
#include "formats/volume/text_samples.h"
#include "formats/volume/words.h"

namespace voxkit {
namespace {

namespace fs = std::filesystem;
using meta::Header;
using meta::Image;

/// Samples that are bytes of a file as they are.
SourceResult open_mapped(const Image& image, const std::string& path, uint64_t first,
                         const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto file, MappedFile::open(path));
  const uint64_t size = file->bytes().size();
  if (image.header_size > 0) first = static_cast<uint64_t>(image.header_size);
  if (image.header_size < 0 && size >= image.bytes) first = size - image.bytes;
  const uint64_t there = size - std::min(size, first);
  if (there < image.bytes)
    return bad_input(path, fmt::format("voxel data at byte {} end after {} bytes: expected {}", first, there,
                                       image.bytes));
  if (there > image.bytes)
    ctx.note(fmt::format("{}: {} bytes after the voxels are dropped", path, there - image.bytes));
  return strided_source(std::move(file), first + image.offset, image.strides, image.info, image.layout,
                        options, ctx);
}

/// `bytes` of samples of a file, in which they begin at `first` or where the header says.
Result<std::unique_ptr<InputStream>> open_part(const Image& image, const std::string& path, uint64_t first,
                                               uint64_t bytes) {
  VOX_TRY(auto stream, open_stream(path));
  if (image.header_size > 0) first = static_cast<uint64_t>(image.header_size);
  if (image.header_size < 0) {
    std::error_code error;
    const uint64_t size = fs::file_size(path, error);
    if (error || size < bytes)
      return bad_input(path,
                       fmt::format("voxel data end after {} bytes: expected {}", error ? 0 : size, bytes));
    first = size - bytes;
  }
  VOX_CHECK(stream->skip(first));
  if (image.compressed) stream = inflate(std::move(stream));
  if (image.text) stream = text_samples(std::move(stream), image.layout.type);
  return stream;
}

/// The names of several files; nothing where the field is that of one.
Result<std::optional<DataFiles>> several(const Header& header, const Image& image, int64_t& expected) {
  auto tokens = words(*header.find("elementdatafile"));
  const auto axes = image.sides.size();
  size_t in_file = std::max<size_t>(axes, 2) - 1;
  if (!tokens.empty() && tokens[0] == "LIST") {
    if (tokens.size() > 1) {
      std::string_view count = tokens[1];
      if (count.ends_with('D')) count.remove_suffix(1);
      in_file = number<size_t>(count).value_or(0);
      if (in_file < 1 || in_file > axes)
        return header.wrong("elementdatafile", fmt::format("files of 1 to {} axes", axes));
    }
    DataFiles files;
    files.listed = header.listed;
    files.count = static_cast<int64_t>(header.listed.size());
    for (size_t i = in_file; i < axes; ++i) expected *= image.sides[i];
    return std::optional(files);
  }
  if (tokens.empty() || tokens[0].find('%') == std::string_view::npos) return std::optional<DataFiles>{};
  // What is left out: from 1 on, as many as there are slices, one by one.
  expected = axes > 1 ? image.sides.back() : 1;
  const auto first = tokens.size() > 1 ? number<int32_t>(tokens[1]) : std::optional(1);
  const std::string last = fmt::format("{}", first.value_or(0) + expected - 1);
  constexpr std::string_view one = "1";
  if (tokens.size() < 2) tokens.push_back(one);
  if (tokens.size() < 3) tokens.emplace_back(last);
  if (tokens.size() < 4) tokens.push_back(one);
  auto files = parse_data_pattern(tokens);
  if (!files)
    return header.wrong("elementdatafile", "a pattern such as slice%03d.raw, and numbers FIRST LAST STEP");
  return files;
}

}  // namespace

SourceResult open_meta_image(const std::string& path, const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto stream, open_stream(path));
  VOX_TRY(const Header header, meta::read_header(*stream));
  VOX_TRY(Image image, meta::interpret(header, options, ctx));
  image.info.files = {path};
  const fs::path parent = fs::path(path).parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  int64_t expected = 1;
  VOX_TRY(const auto files, several(header, image, expected));
  if (files) {
    if (files->count != expected)
      return header.wrong("elementdatafile", fmt::format("{} files, not {}", expected, files->count));
    std::vector<std::string> paths;  // no more than there are files
    for (int64_t i = 0; i < files->count; ++i) {
      VOX_TRY(paths.emplace_back(), data_file_path(path, folder, files->name(i), options));
      image.info.files.push_back(paths.back());
    }
    const uint64_t part = image.bytes / static_cast<uint64_t>(expected);
    auto joined = join_files(path, std::move(paths), part, [image, part](const std::string& file) {
      return open_part(image, file, 0, part);
    });
    VOX_CHECK(joined->skip(image.offset));
    return strided_source(std::move(joined), image.strides, image.info, image.layout, options, ctx);
  }
  const std::string& name = *header.find("elementdatafile");
  const bool local = name == "LOCAL" || name == "Local" || name == "local";
  std::string data = path;
  if (!local) {
    VOX_TRY(data, data_file_path(path, folder, name, options));
    image.info.files.push_back(data);
  }
  const uint64_t first = local ? stream->position() : 0;
  if (!image.compressed && !image.text) return open_mapped(image, data, first, options, ctx);
  VOX_TRY(auto samples, open_part(image, data, first, image.bytes));
  VOX_CHECK(samples->skip(image.offset));
  return strided_source(std::move(samples), image.strides, image.info, image.layout, options, ctx);
}

SinkResult create_meta_image(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  SampleLayout layout = storage_layout(info);
  if (info.format == VoxelFormat::bitmap) layout.type = SampleType::u8;
  const std::string data = detached_data_file(path);
  VOX_TRY(auto file, OutputFile::create(path, force));
  VOX_CHECK(file->write(meta::header_text(path, info, layout,
                                          data.empty() ? "LOCAL" : fs::path(data).filename().string(), ctx)));
  if (data.empty()) return std::make_unique<DenseSink>(std::move(file), info, layout);
  VOX_TRY(auto samples, OutputFile::create(data, force));
  return std::make_unique<DetachedSink>(std::move(file), std::move(samples), info, layout);
}

}  // namespace voxkit
