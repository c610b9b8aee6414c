#include "formats/volume/volume_formats.h"

#include <map>
#include <sstream>

#include "formats/output_file.h"
#include "tests/formats/file_format_test.h"

namespace voxkit {
namespace {

using VolumeFormatsTest = FileFormatTest;

struct Type {
  VoxelFormat format;
  SampleType type;
};
const std::map<std::string, Type> types{
    {"u8", {VoxelFormat::density8, SampleType::u8}},    {"i8", {VoxelFormat::density8, SampleType::i8}},
    {"u16", {VoxelFormat::density16, SampleType::u16}}, {"i16", {VoxelFormat::density16, SampleType::i16}},
    {"u32", {VoxelFormat::density16, SampleType::u32}}, {"i32", {VoxelFormat::density16, SampleType::i32}},
    {"u64", {VoxelFormat::density16, SampleType::u64}}, {"i64", {VoxelFormat::density16, SampleType::i64}},
    {"f16", {VoxelFormat::float32, SampleType::f16}},   {"f32", {VoxelFormat::float32, SampleType::f32}},
    {"rgb8", {VoxelFormat::rgb24, SampleType::u8}},     {"rgba8", {VoxelFormat::rgba32, SampleType::u8}},
    {"bit", {VoxelFormat::bitmap, SampleType::bit}},
};

std::vector<std::string> words(std::string_view text) {
  std::istringstream in{std::string(text)};
  return {std::istream_iterator<std::string>(in), {}};
}

/// A volume of this type written as `name` and read again: whether it comes back as that type with all its
/// voxels. Nothing of modules that are not there.
std::optional<bool> holds(const std::string& name, const Type& type, Context& ctx) {
  VolumeInfo info;
  info.dims = {4, 3, 2};
  info.format = type.format;
  info.sample_type = type.type;
  if (is_wide(type.type)) info.wide_base = 100000;
  Bytes voxels(static_cast<size_t>(24 * voxel_bytes(info.format)));
  for (size_t i = 0; i < voxels.size(); ++i)
    voxels[i] = std::byte(info.format == VoxelFormat::bitmap    ? i % 3 == 0
                          : info.format == VoxelFormat::float32 ? (i % 4 == 3   ? 0x3c
                                                                   : i % 4 == 2 ? 0x80
                                                                                : 0)
                                                                : i * 5 % 251);
  auto sink = create_volume(name, info, true, ctx);
  if (!sink) {
    if (sink.error().what.find("lib") != std::string::npos) return std::nullopt;
    return false;
  }
  if (!(*sink)->write(0, 2, packed(std::as_const(voxels).data(), info.dims, info.format)) ||
      !(*sink)->finish())
    return false;
  OpenOptions options;
  if (has_ending(name, ".raw")) {
    options.dims = info.dims;
    for (const auto& [text, t] : types)
      if (t.format == type.format && t.type == type.type) options.type = text;
  }
  auto source = open_volume(name, options, ctx);
  if (!source) return false;
  const VolumeInfo& back = (*source)->info();
  if (back.dims != info.dims ||
      (is_color(type.format) ? back.format != type.format : back.sample_type != type.type))
    return false;
  if (is_wide(type.type)) return true;  // held otherwise
  if (back.format != info.format) return false;
  Bytes again(voxels.size());
  return (*source)->read(back.box(), packed(again.data(), info.dims, info.format)) && again == voxels;
}

TEST_F(VolumeFormatsTest, FilesHoldTheTypesThatTheTableSays) {
  for (const VolumeFormat& format : volume_formats()) {
    if (!format.create) continue;
    const std::string ending(format.endings.front());
    const auto listed = words(format.types);
    for (const auto& [text, type] : types) {
      const bool said = std::find(listed.begin(), listed.end(), text) != listed.end();
      const std::string name = path("v" + text + (format.images ? "-%d" : "") + ending);
      const auto found = holds(name, type, ctx_);
      if (found) {
        EXPECT_EQ(*found, said) << format.name << " " << text;
      }
    }
  }
}

TEST_F(VolumeFormatsTest, EveryEndingHasOneFormat) {
  for (const VolumeFormat& format : volume_formats()) {
    EXPECT_LE(format.piped, format.written);
    EXPECT_LE(format.written, format.endings.size());
    EXPECT_EQ(format.written > 0, format.create != nullptr);
    for (const std::string_view ending : format.endings)
      EXPECT_EQ(find_volume_format("x" + std::string(ending)), &format) << ending;
    for (const std::string& type : words(format.types)) EXPECT_TRUE(types.count(type)) << type;
  }
}

TEST_F(VolumeFormatsTest, StandardOutputIsOfSomeFormatsOnly) {
  EXPECT_TRUE(is_standard_output("-"));
  EXPECT_TRUE(is_standard_output("-.npy"));
  EXPECT_FALSE(is_standard_output("-a.npy"));
  EXPECT_FALSE(is_standard_output("-./a.npy"));
  for (const char* name : {"-.nhdr", "-.vdb", "-.png"}) {
    const Status status = check_volume_output(name, false);
    ASSERT_FALSE(status) << name;
    EXPECT_NE(status.error().what.find("cannot be written to standard output"), std::string::npos);
  }
}

}  // namespace
}  // namespace voxkit
