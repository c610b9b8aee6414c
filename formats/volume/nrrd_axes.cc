// What the axes of a NRRD file are: space, colours, time, channels; and where in the world those of space
// lie.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "formats/volume/facts.h"
#include "formats/volume/nrrd_header.h"
#include "formats/volume/parts.h"

namespace voxkit::nrrd {
namespace {

constexpr int most_axes = 16;  // as the format's own library has it

enum class Role { space, colors, time, channels, one };

struct SpaceName {
  std::string_view name, short_name;
  World world;
  bool time;
};
constexpr SpaceName spaces[] = {
    {"right-anterior-superior", "ras", World::ras, false},
    {"left-anterior-superior", "las", World::las, false},
    {"left-posterior-superior", "lps", World::lps, false},
    {"right-anterior-superior-time", "rast", World::ras, true},
    {"left-anterior-superior-time", "last", World::las, true},
    {"left-posterior-superior-time", "lpst", World::lps, true},
    {"scanner-xyz", "", World::scanner, false},
    {"scanner-xyz-time", "", World::scanner, true},
    {"3d-right-handed", "", World::right_handed, false},
    {"3d-left-handed", "", World::left_handed, false},
    {"3d-right-handed-time", "", World::right_handed, true},
    {"3d-left-handed-time", "", World::left_handed, true},
};

/// What the header says of its axes, as far as they have to do with space.
struct Axes {
  World world = World::unknown;
  size_t space = 0;  ///< numbers in a vector; 0: there is no space
  std::vector<std::string> kinds;
  std::vector<std::vector<double>> directions;  ///< empty: none for the axis
  bool directed = false;                        ///< the field of directions is there
};

Result<Axes> parse_axes(const Header& header, int dimension) {
  Axes axes;
  const auto count = static_cast<size_t>(dimension);
  axes.kinds.resize(count);
  axes.directions.resize(count);
  if (const Field* field = header.find("kinds")) {
    const auto names = words(field->value);
    if (names.size() != count) return header.wrong("kinds", fmt::format("{} kinds", dimension));
    std::transform(names.begin(), names.end(), axes.kinds.begin(), lower);
    for (std::string& kind : axes.kinds)
      if (kind == "???" || kind == "none") kind.clear();
  }
  if (const Field* field = header.find("space")) {
    const std::string name = lower(field->value);
    const auto* const found = std::find_if(std::begin(spaces), std::end(spaces), [&](const SpaceName& s) {
      return name == s.name || (!s.short_name.empty() && name == s.short_name);
    });
    if (found == std::end(spaces))
      return header.wrong("space", "a space of the format, such as left-posterior-superior or scanner-xyz");
    axes.world = found->world;
    axes.space = found->time ? 4 : 3;
  } else if (header.find("spacedimension")) {
    const auto number_of = number<int>(header.find("spacedimension")->value);
    if (!number_of || *number_of < 1 || *number_of > 4) return header.wrong("spacedimension", "1 to 4");
    axes.space = static_cast<size_t>(*number_of);
  }
  if (!header.find("spacedirections")) return axes;
  axes.directed = true;
  VOX_TRY(axes.directions, parse_vectors(header, "spacedirections", count));
  for (std::vector<double>& vector : axes.directions) {
    const auto nans = std::count_if(vector.begin(), vector.end(), [](double x) { return std::isnan(x); });
    if (nans == std::ssize(vector)) vector.clear();
    if (vector.empty()) continue;
    if (axes.space == 0 && vector.size() <= 4) axes.space = vector.size();
    if (nans > 0 || vector.size() != axes.space)
      return header.wrong("spacedirections", fmt::format("vectors of {} numbers", axes.space));
  }
  return axes;
}

/// Of an axis with a direction: along space, or along time, which is the fourth of a space of four.
Result<Role> role_of(const Header& header, const std::vector<double>& direction, int64_t size) {
  const bool space =
      std::any_of(direction.begin(), direction.begin() + std::min<ptrdiff_t>(3, std::ssize(direction)),
                  [](double x) { return x != 0; });
  const bool time = direction.size() == 4 && direction[3] != 0;
  if (space && time) return header.wrong("spacedirections", "axes along space or along time, not along both");
  if (!space && !time && size > 1) return header.wrong("spacedirections", "steps that are not zero");
  return time ? Role::time : Role::space;
}

/// Of an axis without direction that has a kind which is not of space.
Role role_of(const std::string& kind, int64_t size, SampleType type) {
  if (size == 1) return Role::one;
  const bool colors = ((kind == "rgb-color" || kind == "3-color") && size == 3) ||
                      ((kind == "rgba-color" || kind == "4-color") && size == 4);
  if (colors && type == SampleType::u8) return Role::colors;
  return kind == "time" || kind == "list" || kind == "point" ? Role::time : Role::channels;
}

Result<std::vector<Role>> roles_of(const Header& header, const Axes& axes, const std::vector<int64_t>& sizes,
                                   SampleType type) {
  const size_t count = sizes.size();
  std::vector<Role> roles(count, Role::space);
  const auto is_four = [&](size_t i) { return (sizes[i] == 3 || sizes[i] == 4) && type == SampleType::u8; };
  for (size_t i = 0; i < count; ++i) {
    const std::string& kind = axes.kinds[i];
    const bool of_space = kind.empty() || kind == "domain" || kind == "space";
    if (!axes.directions[i].empty()) {
      VOX_TRY(roles[i], role_of(header, axes.directions[i], sizes[i]));
    } else if (!of_space) {
      roles[i] = role_of(kind, sizes[i], type);
    } else if (axes.directed) {  // said to have no direction, and no more
      roles[i] = sizes[i] == 1 ? Role::one : i > 0 ? Role::time : is_four(0) ? Role::colors : Role::channels;
    }
  }
  const bool nothing_said = !axes.directed && !header.find("kinds");
  if (nothing_said && count == 4 && is_four(0)) roles[0] = Role::colors;
  const auto number_of = [&](Role role) { return std::count(roles.begin(), roles.end(), role); };
  const auto last_of = [&](Role role) {
    return roles.rend() - std::find(roles.rbegin(), roles.rend(), role) - 1;
  };
  // Axes beyond the third of space are taken for time, then for channels; of each, one is chosen.
  int in_space = 0;
  for (size_t i = 0; i < count; ++i)
    if (roles[i] == Role::space && ++in_space > 3)
      roles[i] = sizes[i] == 1 ? Role::one : number_of(Role::time) == 0 ? Role::time : Role::channels;
  if (number_of(Role::time) == 2 && number_of(Role::channels) == 0) {
    // One of them is called time, or it is the slower one.
    auto other = static_cast<size_t>(std::find(roles.begin(), roles.end(), Role::time) - roles.begin());
    if (axes.kinds[other] == "time") other = static_cast<size_t>(last_of(Role::time));
    roles[other] = Role::channels;
  }
  if (number_of(Role::time) > 1 || number_of(Role::channels) > 1 || number_of(Role::colors) > 1)
    return header.wrong(header.find("kinds") ? "kinds" : "dimension",
                        "three axes of space, and one each of colours, of time or a list, of channels");
  return roles;
}

/// The unit of places; scales them where those of the axes differ.
Status parse_units(const Header& header, const Axes& axes, const std::vector<size_t>& spatial,
                   VolumeInfo& info, Context& ctx) {
  std::vector<std::string> texts;
  const char* field = "spaceunits";
  if (header.find(field) && axes.space > 0) {
    VOX_TRY(texts, parse_texts(header, field, axes.space));
    texts.resize(std::min<size_t>(3, texts.size()));
  } else if (header.find("units")) {
    field = "units";
    VOX_TRY(const auto all, parse_texts(header, field, axes.kinds.size()));
    for (const size_t axis : spatial) texts.push_back(all[axis]);
  }
  std::vector<Unit> units;
  for (const std::string& text : texts) {
    const auto unit = parse_unit(text);
    if (unit) {
      units.push_back(*unit);
    } else if (!text.empty() && text != "???") {
      ctx.note(fmt::format("{}: \"{}\" is no length: the units of axes are dropped", header.name, text));
      return {};
    }
  }
  if (units.empty() || units.size() < texts.size()) return {};
  info.unit = units[0];
  for (size_t b = 1; b < units.size(); ++b) {
    if (units[b] == units[0]) continue;
    const Affine scaled = in_unit(info.affine, units[b], units[0]);
    for (size_t a = 0; a < 3; ++a) info.affine.axes[a][b] = scaled.axes[a][b];
    info.affine.origin[b] = scaled.origin[b];
    ctx.note(fmt::format("{}: units of axes differ: all are {} now", header.name, name(units[0])));
  }
  return {};
}

/// From whichever fields there are; `spatial` are the axes of space.
Status parse_placement(const Header& header, const Axes& axes, const std::vector<size_t>& spatial,
                       VolumeInfo& info, Context& ctx) {
  const int dimension = static_cast<int>(axes.kinds.size());
  VOX_TRY(const auto spacings, parse_axis_numbers(header, "spacings", dimension));
  VOX_TRY(const auto mins, parse_axis_numbers(header, "axismins", dimension));
  VOX_TRY(const auto maxs, parse_axis_numbers(header, "axismaxs", dimension));
  std::vector<std::string_view> centers;
  if (const Field* field = header.find("centers")) centers = words(field->value);
  info.world = axes.world;
  Affine& affine = info.affine;
  affine.axes = {};
  for (size_t k = 0; k < spatial.size(); ++k) {
    const size_t axis = spatial[k];
    const std::vector<double>& direction = axes.directions[axis];
    if (!direction.empty()) {
      for (size_t b = 0; b < std::min<size_t>(3, direction.size()); ++b) affine.axes[k][b] = direction[b];
      continue;
    }
    const bool cell = axis < centers.size() && lower(centers[axis]) == "cell";
    double spacing = spacings[axis];
    const double gaps = static_cast<double>(info.dims[static_cast<int>(k)] - (cell ? 0 : 1));
    if (std::isnan(spacing) && gaps > 0) spacing = (maxs[axis] - mins[axis]) / gaps;
    if (spacing == 0)
      return header.wrong(header.find("spacings") ? "spacings" : "axismaxs", "steps that are not zero");
    affine.axes[k][k] = std::isfinite(spacing) ? spacing : 1;
    if (!std::isnan(mins[axis])) affine.origin[k] = mins[axis] + (cell ? affine.axes[k][k] / 2 : 0);
  }
  complete_axes(affine, {1, 1, 1});
  if (header.find("spaceorigin")) {
    VOX_TRY(const auto origin, parse_vectors(header, "spaceorigin", 1));
    if (axes.space > 0 && !origin[0].empty() && origin[0].size() != axes.space)
      return header.wrong("spaceorigin", fmt::format("a vector of {} numbers", axes.space));
    for (size_t b = 0; b < std::min<size_t>(3, origin[0].size()); ++b)
      if (!std::isnan(origin[0][b])) affine.origin[b] = origin[0][b];
  }
  if (!affine.is_valid())
    return header.wrong(axes.directed ? "spacedirections" : "spacings", "axes that do not lie in one plane");
  return parse_units(header, axes, spatial, info, ctx);
}

/// Our own pairs, and how many there are of others.
Status parse_keys(const Header& header, Nrrd& nrrd, std::vector<std::string>& dropped) {
  VolumeInfo& info = nrrd.info;
  std::vector<std::string> others;
  for (const auto& [key, field] : header.keys) {
    const auto wrong = [&, &k = key, &f = field](const char* expected) {
      return bad_input(header.name, fmt::format("NRRD header, line {}: {}:={}: expected {}", f.line, k,
                                                f.value.substr(0, 80), expected));
    };
    const std::string_view text = trim(field.value);
    if (key == slope_key || key == intercept_key) {
      const auto value = number<double>(text);
      if (!value || !std::isfinite(*value)) return wrong("a number");
      (key == slope_key ? info.slope : info.intercept) = *value;
    } else if (key == fill_key) {
      nrrd.fill = number<double>(text);
      if (!nrrd.fill) return wrong("a number");
    } else if (key == labels_key) {
      if (text != "yes") return wrong("yes");
      info.is_labels = !is_color(info.format);
    } else if (key == space_key) {
      const auto code = number<uint8_t>(text);
      if (!code) return wrong("a number of at most 255");
      info.space_code = *code;
    } else if (key == format_key) {
      if (text != "BITMAP" || info.format != VoxelFormat::density8 || info.sample_type != SampleType::u8)
        return wrong("BITMAP, and the type uint8");
      info.format = VoxelFormat::bitmap;
      info.sample_type = SampleType::bit;
    } else {
      others.push_back(key);
    }
  }
  if (!others.empty())
    dropped.push_back(fmt::format("{} key/value pair{} (\"{}\"{})", others.size(),
                                  others.size() == 1 ? "" : "s", others[0].substr(0, 40),
                                  others.size() > 1 ? " ..." : ""));
  return {};
}

/// Fields that nothing is made of, in words.
std::vector<std::string> fields_dropped(const Header& header, const Axes& axes) {
  std::vector<std::string> dropped;
  const auto drop = [&](const char* field, const char* words_of) {
    const Field* const found = header.find(field);
    if (!found) return;
    // What has no letter or digit, or is nan and ??? only, says nothing.
    const auto texts = words(found->value);
    if (!std::all_of(texts.begin(), texts.end(), [](std::string_view text) {
          const std::string low = lower(text);
          return low == "nan" || low == "???" || low == "\"\"" || low == "none";
        }))
      dropped.push_back(words_of);
  };
  drop("thicknesses", "thicknesses");
  drop("measurementframe", "a measurement frame");
  drop("labels", "labels of axes");
  drop("sampleunits", "units of samples");
  if (header.find("oldmin") || header.find("oldmax") || header.find("min") || header.find("max"))
    dropped.push_back("the range of values before they were quantised");
  if (axes.space == 4) dropped.push_back("time as a direction of space");
  return dropped;
}

}  // namespace

Result<Nrrd> interpret(const Header& header, const OpenOptions& options, Context& ctx) {
  Nrrd nrrd;
  const Field* dimension = header.find("dimension");
  nrrd.dimension = dimension ? number<int>(dimension->value).value_or(0) : 0;
  if (nrrd.dimension < 1 || nrrd.dimension > most_axes)
    return header.wrong("dimension", fmt::format("1 to {} axes", most_axes));
  VOX_TRY(const SampleType type, parse_type(header));
  VOX_TRY(nrrd.encoding, parse_encoding(header));
  VOX_TRY(nrrd.line_skip, parse_skip(header, "lineskip", 0));
  const bool bytes_as_they_are = nrrd.encoding != Encoding::text && nrrd.encoding != Encoding::hex;
  VOX_TRY(nrrd.byte_skip, parse_skip(header, "byteskip", bytes_as_they_are ? -1 : 0));

  const Field* sizes = header.find("sizes");
  uint64_t samples = 1;
  std::vector<uint64_t> steps;  // samples from one to the next along each axis
  for (const std::string_view word : sizes ? words(sizes->value) : std::vector<std::string_view>{}) {
    const auto size = number<int64_t>(word);
    if (!size || *size < 1 || *size > max_side) return header.wrong("sizes", "integers from 1 to 2^31");
    nrrd.sizes.push_back(*size);
    steps.push_back(samples);
    if (__builtin_mul_overflow(samples, static_cast<uint64_t>(*size), &samples) || samples > uint64_t{1}
                                                                                                 << 59)
      return header.wrong("sizes", "at most 2^59 samples");
  }
  if (nrrd.sizes.size() != static_cast<size_t>(nrrd.dimension))
    return header.wrong("sizes", fmt::format("{} integers, one for each axis", nrrd.dimension));
  const auto bytes = static_cast<uint64_t>(sample_bytes(type));
  nrrd.bytes = samples * bytes;

  VOX_TRY(const Axes axes, parse_axes(header, nrrd.dimension));
  VOX_TRY(const auto roles, roles_of(header, axes, nrrd.sizes, type));
  VolumeInfo& info = nrrd.info;
  info.dims = {1, 1, 1};
  std::vector<size_t> spatial;
  int components = 1;
  int64_t times = 1, channels = 1;
  uint64_t time_step = 0, channel_step = 0;
  nrrd.strides.component = static_cast<int64_t>(bytes);
  for (size_t i = 0; i < roles.size(); ++i) {
    const int64_t size = nrrd.sizes[i];
    if (roles[i] == Role::space) {
      info.dims[static_cast<int>(spatial.size())] = size;
      spatial.push_back(i);
    } else if (roles[i] == Role::colors) {
      components = static_cast<int>(size);
      nrrd.strides.component = static_cast<int64_t>(steps[i] * bytes);
    } else if (roles[i] == Role::time) {
      times = size, time_step = steps[i] * bytes;
    } else if (roles[i] == Role::channels) {
      channels = size, channel_step = steps[i] * bytes;
    }
  }
  info.sample_type = type;
  info.format = components == 4   ? VoxelFormat::rgba32
                : components == 3 ? VoxelFormat::rgb24
                                  : scalar_format(type);
  nrrd.layout = {type, components, false};
  const Strides packed = Strides::packed(info.dims, nrrd.layout);
  const auto stride = [&](size_t axis, int64_t whole) {  // of an axis of one voxel any will do
    return axis < spatial.size() && info.dims[static_cast<int>(axis)] > 1
               ? static_cast<int64_t>(steps[spatial[axis]] * bytes)
               : whole;
  };
  nrrd.strides.x = stride(0, packed.x);
  nrrd.strides.y = stride(1, packed.y);
  nrrd.strides.z = stride(2, packed.z);
  VOX_TRY(const auto chosen, choose_parts(header.name,
                                          {{"--time", "time steps", times, options.time},
                                           {"--channel", "channels", channels, options.channel}},
                                          options, info));
  nrrd.offset =
      static_cast<uint64_t>(chosen[0]) * time_step + static_cast<uint64_t>(chosen[1]) * channel_step;

  const Field* endian = header.find("endian");
  const std::string order = endian ? lower(endian->value) : "";
  const bool needed = sample_bytes(type) > 1 && nrrd.encoding != Encoding::text;
  if (order != "big" && order != "little" && (endian || needed))
    return header.wrong("endian", "little or big");
  nrrd.layout.big_endian = order == "big" && needed;
  VOX_CHECK(parse_placement(header, axes, spatial, info, ctx));
  if (const Field* content = header.find("content")) info.description = text_field(content->value);
  std::vector<std::string> dropped = fields_dropped(header, axes);
  VOX_CHECK(parse_keys(header, nrrd, dropped));
  if (!dropped.empty()) ctx.note(fmt::format("{}: the header has {}: dropped", header.name, listed(dropped)));
  return nrrd;
}

}  // namespace voxkit::nrrd
