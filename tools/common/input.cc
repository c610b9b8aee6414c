#include "tools/common/input.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <system_error>
#include <utility>

#include "formats/container.h"
#include "formats/fill.h"
#include "formats/input_stream.h"
#include "formats/mapped_file.h"
#include "formats/volume/volume_formats.h"
#include "libcolor/edit/levels.h"
#include "libcolor/terrain/terrain.h"

namespace voxkit::cli {
namespace {

namespace fs = std::filesystem;

constexpr int64_t most_parts = int64_t{1} << 40;  // a number of a time step or a channel is below it

Result<std::shared_ptr<const Container>> container_of(std::shared_ptr<const MappedFile> file, Context& ctx) {
  const auto bytes = file->bytes();
  const std::string name = file->name();
  return Container::open(bytes, name, std::move(file), ctx.memory);
}

/// `level`: none for the finest that there is.
Result<Input> open_codec(std::shared_ptr<const Container> container, std::optional<int> level, Context& ctx) {
  const auto check_level = [&](int levels) -> Status {
    if (level.value_or(0) < levels) return {};
    return fail(
        ErrorCode::usage, container->name(),
        "--level " + std::to_string(*level) + ": expected a level from 0 to " + std::to_string(levels - 1));
  };
  Input input;
  if (container->codec() == Codec::vq) {
    VOX_CHECK(check_level(1));
    VOX_TRY(input.vq, vq::Volume::open(std::move(container)));
    input.source = vq::open_source(input.vq);
    return input;
  }
  if (container->codec() == Codec::color) {
    VOX_TRY(input.color, color::Volume::open(container, ctx.memory, ctx.threads));
    VOX_CHECK(check_level(color::level_count(input.color->info())));
    input.source = color::open_level(input.color, level.value_or(0), color::CellColors::stored);
    return input;
  }
  if (svmm::is_packed(*container)) {
    VOX_TRY(input.packed, svmm::PackedVolume::open(container, *ctx.memory));
    VOX_CHECK(check_level(input.packed->params().levels));
    const int finest = input.packed->finest();
    VOX_TRY(input.source, svmm::open_source(input.packed, level.value_or(finest)));
    if (finest > 0)
      ctx.note(fmt::format("{}: the file was cut: of its levels 0 to {} those from {} on are there",
                           container->name(), input.packed->params().levels - 1, finest));
    return input;
  }
  VOX_TRY(input.svmm, svmm::Volume::open(container));
  VOX_CHECK(check_level(static_cast<int>(input.svmm->levels().size())));
  VOX_TRY(input.source, svmm::open_source(input.svmm, level.value_or(0)));
  return input;
}

/// Standard input, and its first bytes, which are still to be read from it.
struct Peeked {
  std::unique_ptr<InputStream> stream;
  bool container = false;
};

Result<Peeked> peek_standard_input() {
  VOX_TRY(auto stream, open_stream("-"));
  std::array<std::byte, container_magic.size()> head;
  size_t have = 0;
  while (have < head.size()) {
    VOX_TRY(const size_t got, stream->read(std::span(head).subspan(have)));
    if (got == 0) break;
    have += got;
  }
  const std::span<const std::byte> first(head.data(), have);
  const bool container = is_container(first);
  return Peeked{prepend(std::string(reinterpret_cast<const char*>(first.data()), have), std::move(stream)),
                container};
}

}  // namespace

void declare_input_options(CommandLine& line, OpenOptions& options, bool type) {
  line.option("--dims", "X,Y,Z", "Extent of a .raw input", dims(options.dims));
  if (type) {
    line.option("--type", "TYPE",
                "Type of a .raw input: u8 i8 u16 i16 u32 i32 u64 i64 f16 f32 f64 rgb8 rgba8 bit",
                one_of({"u8", "i8", "u16", "i16", "u32", "i32", "u64", "i64", "f16", "f32", "f64", "rgb8",
                        "rgba8", "bit"},
                       [&options](const std::string& word) { options.type = word; }));
  }
  line.option(
      "--endian", "big|little", "Byte order of a .raw input",
      one_of({"big", "little"}, [&options](const std::string& word) { options.big_endian = word == "big"; }));
  line.text("--grid", "NAME", "Of an input with several grids, such as a .vdb file: which one", options.grid);
  line.option("--time", "N", "Of an input with several time steps: which one, from 0",
              integer(options.time, 0, most_parts));
  line.option("--channel", "N", "Of an input with several channels: which one, from 0",
              integer(options.channel, 0, most_parts));
  line.text("--series", "ID",
            "Of a folder with several DICOM series: the number or the end of the UID of one", options.series);
  options.other_kinds = "compressed volumes (.svmm .vqv .dagc), ";
  line.flag("--labels", "The values of the input are names of things: they have no averages", options.labels);
  line.option("--fill", "V", "The value of the input that stands for nothing measured",
              [&options](const std::string& text) -> Status {
                if (text == "nan" || text == "NaN") {
                  options.fill = std::nan("");
                  return {};
                }
                VOX_TRY(options.fill, read_number(text, std::numeric_limits<double>::lowest(),
                                                  std::numeric_limits<double>::max()));
                return {};
              });
  line.option("--gaps", "KIND",
              "Slices that are missing or unevenly far apart: refuse, accept or fill them (refuse)",
              one_of({"refuse", "accept", "fill"}, [&options](const std::string& word) {
                options.gaps = word == "accept" ? OpenOptions::Gaps::accept
                               : word == "fill" ? OpenOptions::Gaps::fill
                                                : OpenOptions::Gaps::refuse;
              }));
  line.flag("--allow-outside",
            "The input may name files outside of its own folder: data of a header, buffers, materials and "
            "textures of "
            "a mesh",
            options.allow_outside);
}

bool is_volume_file(const std::string& name) {
  const VolumeFormat* const format = find_volume_format(name);
  if (format == nullptr) return false;
  const auto any = [&](std::initializer_list<std::string_view> endings) {
    return std::any_of(endings.begin(), endings.end(),
                       [&](const std::string_view ending) { return has_ending(name, ending); });
  };
  return format->images ? any({".tif", ".tiff"}) : !any({".raw", ".img", ".img.gz", ".dcm"});
}

bool is_compressed(const std::string& name) {
  return has_ending(name, ".svmm") || has_ending(name, ".vqv") || has_ending(name, ".dagc");
}

Result<std::shared_ptr<const Container>> open_container(const std::string& name, Context& ctx) {
  if (name != "-") {
    VOX_TRY(auto file, MappedFile::open(name));
    return container_of(std::move(file), ctx);
  }
  VOX_TRY(Peeked peeked, peek_standard_input());
  VOX_TRY(auto file, MappedFile::spool(*peeked.stream));
  return container_of(std::move(file), ctx);
}

Result<Input> open_compressed(const std::string& name, std::optional<int> level, Context& ctx) {
  VOX_TRY(auto container, open_container(name, ctx));
  return open_codec(std::move(container), level, ctx);
}

namespace {

/// A volume that is not compressed, by its first bytes.
Result<Input> open_plain(std::unique_ptr<InputStream> stream, const OpenOptions& options, Context& ctx) {
  VOX_TRY(KnownStream known, recognise(std::move(stream)));
  Input input;
  input.format = known.format;
  VOX_TRY(input.source, known.format->open_stream(std::move(known.stream), options, ctx));
  return input;
}

}  // namespace

Result<Input> open_spooled(std::shared_ptr<const MappedFile> file, const OpenOptions& options, Context& ctx) {
  if (is_container(file->bytes())) {
    VOX_TRY(auto container, container_of(std::move(file), ctx));
    return open_codec(std::move(container), std::nullopt, ctx);
  }
  return open_plain(stream_of(std::move(file)), options, ctx);
}

namespace {

Result<Input> open_as_it_is(const std::string& name, const OpenOptions& options, Context& ctx) {
  if (is_compressed(name)) return open_compressed(name, std::nullopt, ctx);
  if (color::is_terrain(name))
    return fail(ErrorCode::usage, name,
                "a built-in surface, not a volume: dagcolor-pack makes a .dagc file of it");
  Input input;
  if (name != "-") {
    input.format = find_volume_format(name);
    VOX_TRY(input.source, open_volume(name, options, ctx));
    return input;
  }
  VOX_TRY(Peeked peeked, peek_standard_input());
  if (!peeked.container) return open_plain(std::move(peeked.stream), options, ctx);
  VOX_TRY(auto file, MappedFile::spool(*peeked.stream));
  return open_spooled(std::move(file), options, ctx);
}

}  // namespace

Result<Input> open_input(const std::string& name, const OpenOptions& options, Context& ctx) {
  VOX_TRY(Input input, open_as_it_is(name, options, ctx));
  if (input.source) VOX_CHECK(check_not_written(input.source->info(), options));
  if (options.labels && input.source) {
    if (is_color(input.source->info().format))
      return bad_usage(fmt::format("--labels: voxels are {}: expected scalars",
                                   voxkit::name(input.source->info().format)));
    input.source->set_labels();
  }
  if (is_compressed(name) || !input.source) return input;
  const VolumeInfo& info = input.source->info();
  if (options.fill && is_color(info.format))
    return bad_usage(fmt::format("--fill: voxels are {}: expected scalars", voxkit::name(info.format)));
  auto fill = info.fill;
  if (options.fill) fill = info.format == VoxelFormat::float32 ? *options.fill : info.stored(*options.fill);
  // A table has the values that there are, and only these.
  if (options.fill && info.labels && info.sample(*fill) != *options.fill) {
    ctx.note(fmt::format("--fill {}: no voxel has this value: there is none that stands for nothing measured",
                         *options.fill));
    fill = std::nullopt;
  }
  if (fill) input.source = with_fill(std::move(input.source), *fill, ctx.note);
  return input;
}

std::optional<uint64_t> file_bytes(const std::string& name) {
  std::error_code error;
  const fs::file_status status = fs::status(name, error);
  if (fs::is_regular_file(status)) {
    const uint64_t bytes = fs::file_size(name, error);
    return error ? std::nullopt : std::optional(bytes);
  }
  if (!fs::is_directory(status)) return std::nullopt;
  uint64_t total = 0;
  for (fs::directory_iterator it(name, error), end; !error && it != end; it.increment(error)) {
    std::error_code unreadable;
    if (it->is_regular_file(unreadable)) total += it->file_size(unreadable);
  }
  return error ? std::nullopt : std::optional(total);
}

Status check_distinct(const std::string& input, const std::string& output) {
  std::error_code error;
  const auto refused = [](const std::string& file) {
    return fail(ErrorCode::usage, file, "is the input as well: expected another file");
  };
  if (output != "-" && is_numbered(output) &&
      fs::absolute(input).lexically_normal() == fs::absolute(output).lexically_normal())
    return refused(output);
  for (const std::string& file : files_of_output(output))
    if (fs::equivalent(input, file, error) && !error && fs::is_regular_file(input, error))
      return refused(file);
  if (fs::equivalent(input, output, error) && !error && fs::is_regular_file(input, error))
    return refused(output);
  return {};
}

}  // namespace voxkit::cli
