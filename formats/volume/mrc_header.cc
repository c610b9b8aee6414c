#include "formats/volume/mrc_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/volume/facts.h"

namespace voxkit::mrc {
namespace {

bool known_mode(int32_t mode) {
  return (mode >= 0 && mode <= 4) || mode == 6 || mode == 12 || mode == 16 || mode == 101;
}

Status read_type(const Header& header, const std::string& name, Map& map, Context& ctx) {
  const int32_t mode = header.get<int32_t>(at_mode);
  const auto unsupported = [&](const std::string& what) {
    return bad_input(
        name, fmt::format("MRC header: mode {} at byte {}{} is unsupported: expected 0, 1, 2, 6, 12, 16 "
                          "or 101",
                          mode, size_t{at_mode}, what));
  };
  SampleLayout& layout = map.layout;
  switch (mode) {
    case 0: {
      // Signed by the standard; IMOD's programs say which.
      const int32_t flags = header.is_imod() ? header.get<int32_t>(at_imod_flags) : imod_signed;
      if ((flags & imod_nibbles) != 0) return unsupported(", of 4 bits as IMOD's flags say,");
      layout.type = (flags & imod_signed) != 0 ? SampleType::i8 : SampleType::u8;
      break;
    }
    case 1:
      layout.type = SampleType::i16;
      break;
    case 2:
      layout.type = SampleType::f32;
      break;
    case 3:
      return unsupported(" (complex numbers of 16 bits)");
    case 4:
      return unsupported(" (complex numbers of 32 bits)");
    case 6:
      layout.type = SampleType::u16;
      break;
    case 12:
      layout.type = SampleType::f16;
      break;
    case 16:  // of IMOD: red, green, blue
      layout.components = 3;
      break;
    case 101:
      map.nibbles = true;
      break;
    default:
      return unsupported("");
  }
  layout.big_endian = header.big_endian;
  map.info.sample_type = layout.type;
  map.info.format = layout.components == 3 ? VoxelFormat::rgb24 : scalar_format(layout.type);

  const float lo = header.get<float>(at_range), hi = header.get<float>(at_range + 4);
  if (!(lo < hi) || !std::isfinite(lo) || !std::isfinite(hi)) return {};
  if (map.info.format == VoxelFormat::float32) map.info.range = ValueRange{lo, hi};
  const bool is_signed = layout.type == SampleType::i8 || layout.type == SampleType::i16;
  const float end = layout.type == SampleType::i8 ? 127.0f : 32767.0f;
  const bool contradicts = is_signed ? hi > end : (layout.type == SampleType::u16 && lo < 0);
  if (contradicts)
    ctx.note(
        fmt::format("{}: the header says that values are from {} to {}, which those of mode {} cannot be: "
                    "they are read as {} all the same",
                    name, lo, hi, mode, voxkit::name(layout.type)));
  return {};
}

/// Steps along the axes of the cell. Notes what cannot be.
std::array<Affine::Vector, 3> cell_steps(const Header& header, const std::string& name, VolumeInfo& info,
                                         Context& ctx) {
  std::array<double, 3> steps{1, 1, 1}, cosines{};
  bool said = false, right = true;
  std::vector<std::string> odd;
  for (size_t i = 0; i < 3; ++i) {
    const float cell = header.get<float>(at_cell + 4 * i);
    const int32_t samples = header.get<int32_t>(at_samples + 4 * i);
    if (cell > 0 && std::isfinite(cell) && samples > 0) {
      steps[i] = double{cell} / samples;
      said = true;
    } else if (cell != 0) {
      odd.push_back(fmt::format("{} in {}", cell, samples));
    }
    const double angle = header.get<float>(at_angles + 4 * i);
    if (angle == 90 || angle == 0) continue;
    right = false;
    cosines[i] = std::cos(angle * (3.14159265358979323846 / 180));
    if (!(angle > 0 && angle < 180)) cosines[i] = 2;  // no angle of a cell
  }
  if (said) info.unit = Unit::angstrom;
  if (!odd.empty())
    ctx.note(fmt::format("{}: the cell has sides of {} parts, which are no lengths: steps of 1 are assumed",
                         name, listed(odd)));
  std::array<Affine::Vector, 3> axes{{{steps[0], 0, 0}, {0, steps[1], 0}, {0, 0, steps[2]}}};
  if (right) return axes;
  const auto [alpha, beta, gamma] = cosines;
  const double sine = std::sqrt(1 - gamma * gamma), y = (alpha - beta * gamma) / sine,
               square = 1 - beta * beta - y * y;
  if (!(square > 1e-9)) {
    ctx.note(fmt::format(
        "{}: the angles of the cell are {}, {} and {} degrees, which no cell has: 90 are assumed", name,
        header.get<float>(at_angles), header.get<float>(at_angles + 4), header.get<float>(at_angles + 8)));
    return axes;
  }
  axes[1] = {gamma * steps[1], sine * steps[1], 0};
  axes[2] = {beta * steps[2], y * steps[2], std::sqrt(square) * steps[2]};
  return axes;
}

Status read_placement(const Header& header, const std::string& name, const std::array<int, 3>& axis, Map& map,
                      Context& ctx) {
  VolumeInfo& info = map.info;
  const auto steps = cell_steps(header, name, info, ctx);
  std::array<double, 3> origin{};
  bool placed = false, started = false, finite = true;
  // IMOD's own files have where the first voxel's place is the origin, with the other sign.
  const bool inverted = header.is_imod() && header.get<int32_t>(at_version) < version_2014 &&
                        (header.get<int32_t>(at_imod_flags) & imod_standard_origin) == 0;
  Affine::Vector start{};
  for (size_t k = 0; k < 3; ++k) {
    info.affine.axes[k] = steps[static_cast<size_t>(axis[k])];
    map.order.from[static_cast<size_t>(axis[k])] = static_cast<int>(k);
    start[k] = header.get<int32_t>(at_start + 4 * k);
    started |= start[k] != 0;
    const double value = header.get<float>(at_origin + 4 * k);
    finite &= std::isfinite(value);
    if (!std::isfinite(value)) continue;
    origin[k] = inverted ? 0 - value : value;
    placed |= value != 0;
  }
  if (!finite) ctx.note(name + ": the origin has numbers that are not finite: they are dropped");
  info.affine.origin = info.affine.place(start);
  if (!placed) return {};
  const Affine::Vector started_at = info.affine.origin;
  info.affine.origin = origin;
  if (!started) return {};
  for (size_t b = 0; b < 3; ++b) {
    const double step = info.affine.spacing()[b];
    if (std::abs(started_at[b] - origin[b]) <= 1e-3 * step + 1e-6 * std::abs(origin[b])) continue;
    ctx.note(
        fmt::format("{}: the header says twice where the volume begins, at {},{},{} and with voxel {},{},{}: "
                    "the latter is dropped",
                    name, origin[0], origin[1], origin[2], start[0], start[1], start[2]));
    break;
  }
  return {};
}

/// The order of columns, rows and sections; three zeros, in old files, say nothing.
Result<std::array<int, 3>> read_axes(const Header& header, const std::string& name) {
  std::array<int32_t, 3> said{};
  for (size_t k = 0; k < 3; ++k) said[k] = header.get<int32_t>(at_axes + 4 * k);
  if (said == std::array<int32_t, 3>{0, 0, 0}) return std::array<int, 3>{0, 1, 2};
  auto sorted = said;
  std::sort(sorted.begin(), sorted.end());
  if (sorted == std::array<int32_t, 3>{1, 2, 3})
    return std::array<int, 3>{said[0] - 1, said[1] - 1, said[2] - 1};
  return bad_input(
      name, fmt::format("MRC header: axis order {},{},{} at byte {}: expected 1, 2 and 3 in some order",
                        said[0], said[1], said[2], size_t{at_axes}));
}

void read_texts(const Header& header, const std::string& name, int32_t extended, Map& map, Context& ctx) {
  const auto* const text = reinterpret_cast<const char*>(header.bytes.data());
  const auto labels =
      static_cast<size_t>(std::clamp<int32_t>(header.get<int32_t>(at_label_count), 0, most_labels));
  std::vector<std::string> dropped;
  size_t others = 0;
  for (size_t i = 0; i < labels; ++i) {
    const std::string label = text_field({text + at_labels + label_bytes * i, label_bytes});
    if (map.info.description.empty()) {
      map.info.description = label;
    } else {
      others += !label.empty();
    }
  }
  if (others > 0) dropped.push_back(fmt::format("{} more label{}", others, others == 1 ? "" : "s"));
  if (extended > 0) {
    const std::string type = text_field({text + at_extended_type, 4});
    dropped.push_back(fmt::format("{} bytes of extended header{}", extended,
                                  type.empty() ? "" : fmt::format(" ({})", type)));
  }
  if (!dropped.empty()) ctx.note(fmt::format("{}: the file has {}: dropped", name, listed(dropped)));
}

}  // namespace

Result<Map> read_map(Header& header, const std::string& name, Context& ctx) {
  // Some writers get the machine stamp wrong: the order in which the mode makes sense decides then.
  header.big_endian = header.bytes[at_machine] == std::byte{0x11};
  if (!known_mode(header.get<int32_t>(at_mode))) {
    header.big_endian = !header.big_endian;
    if (!known_mode(header.get<int32_t>(at_mode))) header.big_endian = !header.big_endian;
  }
  Map map;
  VolumeInfo& info = map.info;
  for (int i = 0; i < 3; ++i) info.dims[i] = header.get<int32_t>(at_dims + 4 * static_cast<size_t>(i));
  const auto axes = read_axes(header, name);
  const int32_t extended = header.get<int32_t>(at_extended);
  if (!header.has_map()) {
    // Of old files there is only the sense that the header makes.
    bool sense = known_mode(header.get<int32_t>(at_mode)) && axes && extended >= 0 && extended < 1 << 24;
    for (size_t i = 0; i < 3; ++i) {
      const float cell = header.get<float>(at_cell + 4 * i), angle = header.get<float>(at_angles + 4 * i);
      const int64_t side = info.dims[static_cast<int>(i)];
      sense &= side >= 1 && side <= 1 << 20 && cell >= 0 && cell < 1e9f && angle >= 0 && angle < 180;
    }
    if (!sense)
      return bad_input(name, fmt::format("not an MRC file: expected MAP at byte {}", size_t{at_map}));
    ctx.note(fmt::format(
        "{}: there is no MAP at byte {}: read as an MRC file all the same, since the header makes "
        "sense as one",
        name, size_t{at_map}));
  }
  if (!checked_voxels(info.dims))
    return bad_input(
        name,
        fmt::format(
            "MRC header: {} x {} x {} voxels at byte 0: expected {}", info.dims.x, info.dims.y, info.dims.z,
            std::min({info.dims.x, info.dims.y, info.dims.z}) < 1 ? "sides from 1" : "at most 2^62 in all"));
  if (!axes) return tl::unexpected<Error>(axes.error());
  VOX_CHECK(read_type(header, name, map, ctx));
  if (extended < 0)
    return bad_input(
        name, fmt::format("MRC header: {} bytes of extended header at byte {}: expected 0 or more", extended,
                          size_t{at_extended}));
  map.offset = header_bytes + static_cast<uint64_t>(extended);
  const int32_t group = header.get<int32_t>(at_space_group);
  const int32_t slices = header.get<int32_t>(at_samples + 8);
  if (group >= volume_stacks && group <= volume_stacks + 230) {
    if ((*axes)[2] != 2 || slices < 1 || info.dims.z % slices != 0)
      return bad_input(name,
                       fmt::format("MRC header: {} sections of volumes of {}, axis {} slowest: unsupported: "
                                   "expected volumes of equal size, one after the other along axis 3",
                                   info.dims.z, slices, (*axes)[2] + 1));
    map.volumes = info.dims.z / slices;
    info.dims.z = slices;
  } else if (group == 0 && slices == 1 && info.dims.z > 1) {
    ctx.note(
        fmt::format("{}: says that it is a stack of {} pictures: they are taken for the slices of a volume",
                    name, info.dims.z));
  }
  VOX_CHECK(read_placement(header, name, *axes, map, ctx));
  read_texts(header, name, extended, map, ctx);
  return map;
}

}  // namespace voxkit::mrc
