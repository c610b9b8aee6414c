// VTK's image data as XML: the array that is the volume, and writing one, appended as it is.
#include "formats/volume/vti.h"

#include <fmt/format.h>

#include <algorithm>

#include "formats/volume/dense_sink.h"
#include "formats/volume/facts.h"
#include "formats/volume/parts.h"
#include "formats/volume/readers.h"
#include "formats/volume/strided_source.h"

namespace voxkit {
namespace {

using vti::Array;
using vti::Document;

std::string_view type_name(SampleType type) {
  switch (type) {
    case SampleType::i8:
      return "Int8";
    case SampleType::u16:
      return "UInt16";
    case SampleType::i16:
      return "Int16";
    case SampleType::u32:
      return "UInt32";
    case SampleType::i32:
      return "Int32";
    case SampleType::u64:
      return "UInt64";
    case SampleType::i64:
      return "Int64";
    case SampleType::f32:
      return "Float32";
    default:
      return "UInt8";
  }
}

/// The array that is wanted, or the only one.
Result<Array> choose(const Document& document, const OpenOptions& options, VolumeInfo& info) {
  std::string names;
  for (const Array& array : document.arrays)
    names += (names.empty() ? "" : ", ") + text_field(array.name.substr(0, 80));
  const auto found = std::find_if(document.arrays.begin(), document.arrays.end(), [&](const Array& array) {
    return options.grid.empty() || array.name == options.grid;
  });
  if (document.arrays.empty())
    return bad_input(document.name, "XML: expected a DataArray of points or cells");
  if (found == document.arrays.end())
    return bad_input(document.name,
                     fmt::format("--grid {}: there is no such array: expected {}", options.grid, names));
  if (document.arrays.size() > 1) {
    if (options.grid.empty() && !options.any_part)
      return bad_input(document.name, fmt::format("has {} arrays: expected --grid NAME, one of {}",
                                                  document.arrays.size(), names));
    info.parts.push_back(fmt::format("--grid {} of {}", text_field(found->name.substr(0, 80)), names));
  }
  if (!found->type)
    return bad_input(document.name,
                     fmt::format("an array of type \"{}\": expected Int8 to UInt64, Float32 or Float64",
                                 text_field(found->type_name.substr(0, 40))));
  return *found;
}

/// The elements after the samples.
class VtiSink final : public DenseSink {
 public:
  using DenseSink::DenseSink;

 private:
  Status complete() override { return file_->write(std::string("\n  </AppendedData>\n</VTKFile>\n")); }
};

}  // namespace

SourceResult open_vti(const std::string& path, const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto file, MappedFile::open(path));
  VOX_TRY(const Document document, vti::read_document(*file));
  VolumeInfo info;
  info.files = {path};
  VOX_TRY(const Array array, choose(document, options, info));
  info.dims = document.extent.size();
  info.affine = document.affine;
  if (array.cells) {  // whose centres lie between points
    Affine::Vector half{};
    for (int i = 0; i < 3; ++i) {
      if (info.dims[i] < 2) continue;
      --info.dims[i];
      half[static_cast<size_t>(i)] = 0.5;
    }
    info.affine = info.affine.moved_to(half);
  }
  info.sample_type = *array.type;
  info.format = scalar_format(*array.type);
  SampleLayout layout{*array.type, 1, document.big_endian && (array.coding != vti::Coding::text)};
  int64_t channels = array.components;
  if ((channels == 3 || channels == 4) && *array.type == SampleType::u8) {
    layout.components = static_cast<int>(channels);
    info.format = channels == 4 ? VoxelFormat::rgba32 : VoxelFormat::rgb24;
    channels = 1;
  }
  VOX_TRY(const auto chosen, choose_parts(path,
                                          {{"--time", "time step", 1, options.time},
                                           {"--channel", "components", channels, options.channel}},
                                          options, info));
  const auto voxels = checked_voxels(info.dims);
  const int64_t voxel = layout.bytes_per_voxel() * channels;
  uint64_t bytes = 0;
  if (!voxels || __builtin_mul_overflow(*voxels, static_cast<uint64_t>(voxel), &bytes) || bytes >> 62 != 0)
    return bad_input(path, "the volume is too large: expected at most 2^62 bytes");
  const int64_t sample = sample_bytes(*array.type);
  const Strides strides{voxel, voxel * info.dims.x, voxel * info.dims.x * info.dims.y, sample};
  const uint64_t offset = static_cast<uint64_t>(chosen[1] * sample);
  VOX_TRY(auto data, vti::open_data(file, document, array, bytes, ctx));
  if (data.raw_at) {
    const uint64_t there = file->bytes().size() - std::min<uint64_t>(file->bytes().size(), *data.raw_at);
    if (there < bytes)
      return bad_input(path, fmt::format("voxel data at byte {} end after {} bytes: expected {}",
                                         *data.raw_at, there, bytes));
    return strided_source(std::move(file), *data.raw_at + offset, strides, info, layout, options, ctx);
  }
  if (data.blocks) {
    if (channels == 1 && !is_wide(layout.type) && layout.type != SampleType::f64)
      return vti::block_source(std::move(data.blocks), info, layout);
    data.stream = vti::stream_of(std::move(data.blocks), path, bytes);
  }
  VOX_CHECK(data.stream->skip(offset));
  return strided_source(std::move(data.stream), strides, info, layout, options, ctx);
}

SinkResult create_vti(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  SampleLayout layout = storage_layout(info);
  if (info.format == VoxelFormat::bitmap) layout.type = SampleType::u8;
  VOX_TRY(auto file, OutputFile::create(path, force));
  note_dropped(path, "VTI", not_held(info, {.place = true, .directions = true}), ctx);
  const Affine::Vector steps = info.affine.spacing(), &origin = info.affine.origin;
  std::string direction;
  for (size_t row = 0; row < 3; ++row)
    for (size_t k = 0; k < 3; ++k)
      direction +=
          fmt::format("{}{}", direction.empty() ? "" : " ", info.affine.axes[k][row] / steps[k] + 0.0);
  const std::string extent = fmt::format("0 {} 0 {} 0 {}", info.dims.x - 1, info.dims.y - 1, info.dims.z - 1);
  const uint64_t bytes = layout.file_bytes(static_cast<uint64_t>(info.box().voxels())).value_or(0);
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n"
      "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
      "  <ImageData WholeExtent=\"{}\" Origin=\"{} {} {}\" Spacing=\"{} {} {}\" Direction=\"{}\">\n"
      "    <Piece Extent=\"{}\">\n"
      "      <PointData Scalars=\"voxels\">\n"
      "        <DataArray type=\"{}\" Name=\"voxels\" NumberOfComponents=\"{}\" format=\"appended\" "
      "offset=\"0\"/>\n"
      "      </PointData>\n"
      "      <CellData/>\n"
      "    </Piece>\n"
      "  </ImageData>\n"
      "  <AppendedData encoding=\"raw\">\n"
      "   _",
      extent, origin[0], origin[1], origin[2], steps[0], steps[1], steps[2], direction, extent,
      type_name(layout.type), layout.components);
  for (int i = 0; i < 8; ++i) text += static_cast<char>(bytes >> (8 * i) & 255);
  VOX_CHECK(file->write(text));
  return std::make_unique<VtiSink>(std::move(file), info, layout);
}

}  // namespace voxkit
