// NRRD headers to write.
#include <fmt/format.h>

#include "formats/volume/facts.h"
#include "formats/volume/nrrd_header.h"

namespace voxkit::nrrd {
namespace {

std::string_view type_name(SampleType type) {
  switch (type) {
    case SampleType::i8:
      return "int8";
    case SampleType::u16:
      return "uint16";
    case SampleType::i16:
      return "int16";
    case SampleType::u32:
      return "uint32";
    case SampleType::i32:
      return "int32";
    case SampleType::u64:
      return "uint64";
    case SampleType::i64:
      return "int64";
    case SampleType::f32:
      return "float";
    default:
      return "uint8";
  }
}

/// Empty where the format has no name for it.
std::string_view space_name(World world) {
  constexpr std::string_view names[] = {"",
                                        "right-anterior-superior",
                                        "left-posterior-superior",
                                        "left-anterior-superior",
                                        "scanner-xyz",
                                        "3D-right-handed",
                                        "3D-left-handed"};
  return names[static_cast<size_t>(world)];
}

/// The shortest digits that come back as the same number.
std::string text(const Affine::Vector& v) {
  return fmt::format("({},{},{})", v[0], v[1], v[2]);
}

}  // namespace

std::string header_text(const VolumeInfo& info, const SampleLayout& layout, const std::string& data_file) {
  const bool colored = is_color(info.format);
  std::string all = "NRRD0005\n";
  const auto line = [&](std::string_view field, const std::string& value) {
    all += fmt::format("{}: {}\n", field, value);
  };
  line("type", std::string(type_name(layout.type)));
  line("dimension", colored ? "4" : "3");
  const std::string_view space = space_name(info.world);
  if (space.empty()) {
    line("space dimension", "3");
  } else {
    line("space", std::string(space));
  }
  const std::string sizes = fmt::format("{} {} {}", info.dims.x, info.dims.y, info.dims.z);
  line("sizes", colored ? fmt::format("{} {}", layout.components, sizes) : sizes);
  // Not `spacings`, which the format does not allow beside an origin in space.
  const auto& axes = info.affine.axes;
  line("space directions",
       fmt::format("{}{} {} {}", colored ? "none " : "", text(axes[0]), text(axes[1]), text(axes[2])));
  if (colored)
    line("kinds",
         fmt::format("{} domain domain domain", layout.components == 4 ? "RGBA-color" : "RGB-color"));
  if (sample_bytes(layout.type) > 1) line("endian", "little");
  line("encoding", "raw");
  line("space origin", text(info.affine.origin));
  if (info.unit != Unit::unknown)
    line("space units", fmt::format("\"{0}\" \"{0}\" \"{0}\"", name(info.unit)));
  // Whatever a description came from, it is one line.
  if (const std::string content = text_field(info.description); !content.empty()) line("content", content);
  const auto key = [&](std::string_view name, const auto& value) {
    all += fmt::format("{}:={}\n", name, value);
  };
  if (info.slope != 1) key(slope_key, info.slope);
  if (info.intercept != 0) key(intercept_key, info.intercept);
  if (info.format == VoxelFormat::bitmap) key(format_key, "BITMAP");
  if (info.fill && !colored)
    key(fill_key, info.format == VoxelFormat::float32 ? *info.fill : info.sample(*info.fill));
  if (info.is_labels) key(labels_key, "yes");
  if (info.space_code != 0) key(space_key, info.space_code);
  if (!data_file.empty()) line("data file", data_file);
  return all + "\n";
}

}  // namespace voxkit::nrrd
