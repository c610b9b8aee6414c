// VTK's legacy files, https://docs.vtk.org/en/latest/vtk_file_formats/vtk_legacy_file_format.html: structured
// points, of which the first array is the volume. Binary samples are big-endian.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>
#include <vector>

#include "formats/mapped_file.h"
#include "formats/volume/dense_sink.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/facts.h"
#include "formats/volume/parts.h"
#include "formats/volume/readers.h"
#include "formats/volume/strided_source.h"
#include "formats/volume/text_samples.h"
#include "formats/volume/words.h"

namespace voxkit {
namespace {

constexpr int most_lines = 1000;
constexpr size_t most_title = 255;
constexpr std::string_view default_title = "volume";

struct TypeName {
  std::string_view name;
  SampleType type;
};
/// The first of a type is what is written.
constexpr TypeName type_names[] = {
    {"unsigned_char", SampleType::u8}, {"char", SampleType::i8},
    {"signed_char", SampleType::i8},   {"unsigned_short", SampleType::u16},
    {"short", SampleType::i16},        {"unsigned_int", SampleType::u32},
    {"int", SampleType::i32},          {"vtktypeuint64", SampleType::u64},
    {"vtktypeint64", SampleType::i64}, {"unsigned_long", SampleType::u64},
    {"long", SampleType::i64},         {"float", SampleType::f32},
    {"double", SampleType::f64},
};

/// What the lines before the samples say.
struct Points {
  std::string name;  ///< of the file, for messages
  std::string title;
  bool text = false, cells = false;
  Index3 dims{0};
  Affine::Vector origin{0, 0, 0}, spacing{1, 1, 1};
  int64_t count = -1;  ///< of points, or cells
  std::optional<SampleType> type;
  int64_t components = 1;
  bool colors = false;  ///< bytes where they are binary; in text fractions of 1
};

tl::unexpected<Error> wrong(const Points& points, const std::string& line, const std::string& expected) {
  return bad_input(points.name,
                   fmt::format("VTK header: \"{}\": expected {}", text_field(line.substr(0, 80)), expected));
}

std::optional<SampleType> type_of(std::string_view name) {
  const std::string low = lower(name);
  for (const TypeName& t : type_names)
    if (t.name == low) return t.type;
  return std::nullopt;
}

template <class T>
bool three(const std::vector<std::string_view>& tokens, T& out) {
  if (tokens.size() != 4) return false;
  for (size_t i = 0; i < 3; ++i) {
    const auto value = number<std::remove_reference_t<decltype(out[0])>>(tokens[i + 1]);
    if (!value) return false;
    out[static_cast<int>(i)] = *value;
  }
  return true;
}

/// One line of what a data set has; true where the samples come next.
Result<bool> read_field(InputStream& stream, const std::string& line, Points& points) {
  const auto tokens = words(line);
  const std::string key = lower(tokens[0]);
  const auto count_of = [&](size_t i) {
    return i < tokens.size() ? number<int64_t>(tokens[i]).value_or(-1) : -1;
  };
  if (key == "dimensions") {
    if (!three(tokens, points.dims)) return wrong(points, line, "DIMENSIONS and three whole numbers");
  } else if (key == "origin") {
    if (!three(tokens, points.origin)) return wrong(points, line, "ORIGIN and three numbers");
  } else if (key == "spacing" || key == "aspect_ratio") {
    if (!three(tokens, points.spacing)) return wrong(points, line, "SPACING and three numbers");
  } else if (key == "point_data" || key == "cell_data") {
    points.cells = key == "cell_data";
    points.count = count_of(1);
  } else if (key == "scalars" && points.count >= 0) {
    points.type = tokens.size() > 2 ? type_of(tokens[2]) : std::nullopt;
    if (tokens.size() > 3) points.components = count_of(3);
    if (!points.type || points.components < 1) return wrong(points, line, "SCALARS NAME TYPE [COMPONENTS]");
    VOX_TRY(const auto table, stream.read_line());
    if (!table || words(*table).empty() || lower(words(*table)[0]) != "lookup_table")
      return wrong(points, table.value_or(""), "LOOKUP_TABLE NAME after SCALARS");
    return true;
  } else if (key == "color_scalars" && points.count >= 0) {
    points.components = count_of(2);
    points.type = SampleType::u8;
    points.colors = true;
    if (points.components < 1) return wrong(points, line, "COLOR_SCALARS NAME COMPONENTS");
    return true;
  } else if (key == "field" && points.count >= 0) {
    VOX_TRY(const auto array, stream.read_line());
    const std::string text = array.value_or("");
    const auto parts = words(text);
    points.type = parts.size() == 4 ? type_of(parts[3]) : std::nullopt;
    points.components = parts.size() == 4 ? number<int64_t>(parts[1]).value_or(0) : 0;
    const int64_t tuples = parts.size() == 4 ? number<int64_t>(parts[2]).value_or(-1) : -1;
    if (!points.type || points.components < 1 || tuples != points.count)
      return wrong(points, text, fmt::format("NAME COMPONENTS {} TYPE", points.count));
    return true;
  } else if (key == "metadata") {
    for (;;) {  // up to a blank line
      VOX_TRY(const auto more, stream.read_line());
      if (!more || trim(*more).empty()) break;
    }
  } else {
    return wrong(points, line,
                 points.count < 0 ? "DIMENSIONS, ORIGIN, SPACING and POINT_DATA or CELL_DATA"
                                  : "SCALARS, COLOR_SCALARS or FIELD");
  }
  return false;
}

Result<Points> read_header(InputStream& stream) {
  Points points;
  points.name = stream.name();
  constexpr std::string_view magic = "# vtk DataFile Version";
  std::string head(magic.size(), '\0');
  VOX_TRY(const size_t got, stream.read(std::as_writable_bytes(std::span(head))));
  if (got < head.size() || head != magic)
    return bad_input(points.name, "not a VTK file: expected \"# vtk DataFile Version\" at byte 0");
  VOX_TRY(const auto version, stream.read_line());
  if (const auto v = version ? number<double>(trim(*version)) : std::nullopt; !v || *v >= 6)
    return bad_input(points.name, "VTK header: expected a version below 6");
  VOX_TRY(const auto title, stream.read_line());
  points.title = text_field(title.value_or(""));
  VOX_TRY(const auto coding, stream.read_line());
  const std::string word = lower(trim(coding.value_or("")));
  if (word != "ascii" && word != "binary") return wrong(points, word, "ASCII or BINARY");
  points.text = word == "ascii";
  bool is_points = false;
  for (int number = 0; number < most_lines; ++number) {
    VOX_TRY(const auto line, stream.read_line());
    if (!line) break;
    const auto tokens = words(*line);
    if (tokens.empty()) continue;
    if (lower(tokens[0]) == "dataset") {
      is_points = tokens.size() == 2 && lower(tokens[1]) == "structured_points";
      if (!is_points) return wrong(points, *line, "DATASET STRUCTURED_POINTS");
      continue;
    }
    if (!is_points) return wrong(points, *line, "DATASET STRUCTURED_POINTS");
    VOX_TRY(const bool last, read_field(stream, *line, points));
    if (last) return points;
  }
  return bad_input(points.name,
                   "VTK header: expected an array of points or cells: SCALARS, COLOR_SCALARS or FIELD");
}

/// What the array is as a volume, and where its first sample is.
struct Volume {
  VolumeInfo info;
  SampleLayout layout;
  Strides strides;
  uint64_t bytes = 0, offset = 0;
};

Result<Volume> interpret(const Points& points, const OpenOptions& options) {
  Volume volume;
  VolumeInfo& info = volume.info;
  info.dims = points.dims;
  Affine::Vector origin = points.origin;
  for (int i = 0; i < 3 && points.cells; ++i) {
    if (points.dims[i] < 2) continue;
    --info.dims[i];
    origin[static_cast<size_t>(i)] += points.spacing[static_cast<size_t>(i)] / 2;
  }
  const auto voxels = checked_voxels(info.dims);
  if (!voxels)
    return bad_input(points.name,
                     fmt::format("VTK header: DIMENSIONS {} {} {}: expected whole numbers from 1 to 2^31",
                                 points.dims.x, points.dims.y, points.dims.z));
  if (points.count != static_cast<int64_t>(*voxels))
    return bad_input(points.name, fmt::format("VTK header: {} {}: expected {}, as DIMENSIONS say",
                                              points.count, points.cells ? "cells" : "points", *voxels));
  info.affine = Affine::plain(points.spacing, origin);
  if (!info.affine.is_valid())
    return bad_input(points.name, "VTK header: SPACING: expected distances that are not zero");
  // Titles that programs write where there is none.
  if (points.title != default_title && points.title != "vtk output") info.description = points.title;
  info.sample_type = *points.type;
  info.format = scalar_format(*points.type);
  volume.layout = {*points.type, 1, !points.text};
  int64_t channels = points.components;
  if ((channels == 3 || channels == 4) && *points.type == SampleType::u8) {
    volume.layout.components = static_cast<int>(channels);
    info.format = channels == 4 ? VoxelFormat::rgba32 : VoxelFormat::rgb24;
    channels = 1;
  }
  const int64_t sample = sample_bytes(*points.type);
  int64_t voxel = 0, all = 0;
  if (__builtin_mul_overflow(volume.layout.bytes_per_voxel(), channels, &voxel) ||
      __builtin_mul_overflow(voxel, static_cast<int64_t>(*voxels), &all) || all >> 62 != 0)
    return bad_input(points.name, "VTK header: the array is too large: expected at most 2^62 bytes");
  volume.bytes = static_cast<uint64_t>(all);
  volume.strides = {voxel, voxel * info.dims.x, voxel * info.dims.x * info.dims.y, sample};
  VOX_TRY(const auto chosen, choose_parts(points.name,
                                          {{"--time", "time step", 1, options.time},
                                           {"--channel", "components", channels, options.channel}},
                                          options, info));
  volume.offset = static_cast<uint64_t>(chosen[1] * sample);
  return volume;
}

/// Colours that are fractions of 1 in text, to bytes.
class FractionStream final : public InputStream {
 public:
  explicit FractionStream(std::unique_ptr<InputStream> text)
      : fractions_(text_samples(std::move(text), SampleType::f32)) {
    name_ = fractions_->name();
  }
  Result<size_t> read(std::span<std::byte> out) override {
    for (size_t done = 0; done < out.size(); ++done, ++position_) {
      float fraction = 0;
      VOX_TRY(const size_t got, fractions_->read(std::as_writable_bytes(std::span(&fraction, 1))));
      if (got < sizeof(fraction)) return done;
      if (!(fraction >= 0 && fraction <= 1))
        return bad_input(name_, fmt::format("ascii data, sample {}: {}: expected a colour from 0 to 1",
                                            position_, fraction));
      out[done] = static_cast<std::byte>(std::lround(fraction * 255));
    }
    return out.size();
  }

 private:
  std::unique_ptr<InputStream> fractions_;
};

/// Samples in the other byte order.
class BigEndianSink final : public DenseSink {
 public:
  BigEndianSink(std::unique_ptr<OutputFile> file, const VolumeInfo& info, const SampleLayout& layout)
      : DenseSink(std::move(file), info, layout), sample_(static_cast<size_t>(sample_bytes(layout.type))) {}

 protected:
  Status put(std::span<const std::byte> bytes) override {
    if (sample_ == 1) return DenseSink::put(bytes);
    while (!bytes.empty()) {
      const auto part = bytes.first(std::min(bytes.size(), turned_.size()));
      for (size_t i = 0; i < part.size(); i += sample_)
        std::reverse_copy(part.data() + i, part.data() + i + sample_, turned_.data() + i);
      VOX_CHECK(DenseSink::put(std::span(turned_).first(part.size())));
      bytes = bytes.subspan(part.size());
    }
    return {};
  }
  Status complete() override { return file_->write(std::string("\n")); }

 private:
  size_t sample_;
  std::vector<std::byte> turned_ = std::vector<std::byte>(size_t{64} << 10);
};

}  // namespace

SourceResult open_vtk(const std::string& path, const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto stream, open_stream(path));
  VOX_TRY(const Points points, read_header(*stream));
  VOX_TRY(Volume volume, interpret(points, options));
  volume.info.files = {path};
  if (points.text) {
    std::unique_ptr<InputStream> samples;
    if (points.colors) {
      samples = std::make_unique<FractionStream>(std::move(stream));
    } else {
      samples = text_samples(std::move(stream), volume.layout.type);
    }
    VOX_CHECK(samples->skip(volume.offset));
    return strided_source(std::move(samples), volume.strides, volume.info, volume.layout, options, ctx);
  }
  VOX_TRY(auto file, MappedFile::open(path));
  const uint64_t first = stream->position(), size = file->bytes().size(),
                 there = size - std::min(size, first);
  if (there < volume.bytes)
    return bad_input(path, fmt::format("voxel data at byte {} end after {} bytes: expected {}", first, there,
                                       volume.bytes));
  if (there > volume.bytes + 1)  // a line end is usual
    ctx.note(fmt::format("{}: {} bytes after the first array are dropped", path, there - volume.bytes));
  return strided_source(std::move(file), first + volume.offset, volume.strides, volume.info, volume.layout,
                        options, ctx);
}

SinkResult create_vtk(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  SampleLayout layout = storage_layout(info);
  if (info.format == VoxelFormat::bitmap) layout.type = SampleType::u8;
  VOX_TRY(auto file, OutputFile::create(path, force));
  note_dropped(path, "VTK", not_held(info, {.place = true, .description = true}), ctx);
  std::string title = cut_text(text_field(info.description), most_title);
  if (title.empty()) title = default_title;
  const Affine::Vector steps = info.affine.spacing(), &origin = info.affine.origin;
  const auto* const type = std::find_if(std::begin(type_names), std::end(type_names),
                                        [&](const TypeName& t) { return t.type == layout.type; });
  std::string text =
      fmt::format("# vtk DataFile Version 3.0\n{}\nBINARY\nDATASET STRUCTURED_POINTS\n", title);
  text += fmt::format("DIMENSIONS {} {} {}\n", info.dims.x, info.dims.y, info.dims.z);
  text += fmt::format("ORIGIN {} {} {}\nSPACING {} {} {}\n", origin[0], origin[1], origin[2], steps[0],
                      steps[1], steps[2]);
  text += fmt::format("POINT_DATA {}\nSCALARS voxels {} {}\nLOOKUP_TABLE default\n", info.box().voxels(),
                      type->name, layout.components);
  VOX_CHECK(file->write(text));
  return std::make_unique<BigEndianSink>(std::move(file), info, layout);
}

}  // namespace voxkit
