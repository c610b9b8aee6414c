// Headerless samples, x fastest.
#include <fmt/format.h>

#include <optional>
#include <string_view>

#include "formats/mapped_file.h"
#include "formats/volume/dense_sink.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/facts.h"
#include "formats/volume/parts.h"
#include "formats/volume/readers.h"

namespace voxkit {
namespace {

struct RawType {
  std::string_view name;
  SampleType type;
  int components;
};
constexpr RawType raw_types[] = {
    {"u8", SampleType::u8, 1},    {"i8", SampleType::i8, 1},   {"u16", SampleType::u16, 1},
    {"i16", SampleType::i16, 1},  {"u32", SampleType::u32, 1}, {"i32", SampleType::i32, 1},
    {"u64", SampleType::u64, 1},  {"i64", SampleType::i64, 1}, {"f16", SampleType::f16, 1},
    {"f32", SampleType::f32, 1},  {"f64", SampleType::f64, 1}, {"rgb8", SampleType::u8, 3},
    {"rgba8", SampleType::u8, 4}, {"bit", SampleType::bit, 1},
};

}  // namespace

SourceResult open_raw(const std::string& path, const OpenOptions& options, Context& ctx) {
  if (!options.dims || !options.type)
    return fail(
        ErrorCode::usage, path,
        fmt::format("a raw file says nothing about itself: expected --dims X,Y,Z and --type, {} missing",
                    options.dims   ? "--type is"
                    : options.type ? "--dims is"
                                   : "both are"));
  VOX_CHECK(only_part(path, options));
  const RawType* type = nullptr;
  for (const RawType& t : raw_types)
    if (t.name == *options.type) type = &t;
  if (!type)
    return bad_usage(fmt::format(
        "--type {}: expected u8 i8 u16 i16 u32 i32 u64 i64 f16 f32 f64 rgb8 rgba8 or bit", *options.type));
  VolumeInfo info;
  info.dims = *options.dims;
  info.files = {path};
  info.sample_type = type->type;
  info.format = type->components == 4   ? VoxelFormat::rgba32
                : type->components == 3 ? VoxelFormat::rgb24
                                        : scalar_format(type->type);
  const SampleLayout layout{type->type, type->components, options.big_endian};
  const auto voxels = checked_voxels(info.dims);
  const auto bytes = voxels ? layout.file_bytes(*voxels) : std::nullopt;
  const std::string dims = fmt::format("{},{},{}", info.dims.x, info.dims.y, info.dims.z);
  if (!bytes)
    return bad_usage(fmt::format("--dims {}: expected sides from 1 to 2^31 and at most 2^62 voxels", dims));
  VOX_TRY(auto file, MappedFile::open(path));
  if (file->bytes().size() != *bytes)
    return bad_input(path, fmt::format("is {} bytes long: expected {} for --dims {} --type {}",
                                       file->bytes().size(), *bytes, dims, type->name));
  return mapped_source(std::move(file), 0, info, layout, options, ctx);
}

SinkResult create_raw(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  const SampleLayout layout = storage_layout(info, true);
  VOX_TRY(auto file, OutputFile::create(path, force));
  const auto dropped = not_held(info, {});
  if (!dropped.empty()) {
    std::string_view type;
    for (const RawType& t : raw_types)
      if (t.type == layout.type && t.components == layout.components) type = t.name;
    ctx.note(fmt::format("{}: a raw file has samples only, here for --dims {},{},{} --type {}: {} dropped",
                         path, info.dims.x, info.dims.y, info.dims.z, type, listed(dropped)));
  }
  return std::make_unique<DenseSink>(std::move(file), info, layout);
}

}  // namespace voxkit
