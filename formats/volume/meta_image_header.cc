// MetaImage headers, https://itk.org/Wiki/MetaIO/Documentation.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "formats/volume/dense_sink.h"
#include "formats/volume/facts.h"
#include "formats/volume/meta_image.h"
#include "formats/volume/parts.h"
#include "formats/volume/words.h"

namespace voxkit::meta {
namespace {

constexpr size_t most_bytes = size_t{1} << 20;
constexpr size_t most_axes = 4;

struct TypeName {
  std::string_view name;
  SampleType type;
};
/// The first of a type is what is written.
constexpr TypeName type_names[] = {
    {"MET_UCHAR", SampleType::u8},      {"MET_CHAR", SampleType::i8},   {"MET_USHORT", SampleType::u16},
    {"MET_SHORT", SampleType::i16},     {"MET_UINT", SampleType::u32},  {"MET_INT", SampleType::i32},
    {"MET_ULONG", SampleType::u32},     {"MET_LONG", SampleType::i32},  {"MET_ULONG_LONG", SampleType::u64},
    {"MET_LONG_LONG", SampleType::i64}, {"MET_FLOAT", SampleType::f32}, {"MET_DOUBLE", SampleType::f64},
    {"MET_UCHAR_ARRAY", SampleType::u8}};

/// Fields that say nothing about voxels and places, or that others say as well.
constexpr std::string_view without_meaning[] = {
    "objecttype", "elementmin",      "elementmax",       "elementnbits",       "id",   "parentid",
    "color",      "acquisitiondate", "compressionlevel", "compresseddatasize", "name", "objectsubtype"};

std::string_view unit_name(Unit unit) {
  return unit == Unit::micrometre ? "um" : unit == Unit::centimetre ? "cm" : "mm";
}

/// The one of several names of a field that is there; null for none.
const std::string* any_of(const Header& header, const std::vector<std::string>& names, std::string& found) {
  for (const std::string& name : names)
    if (const std::string* value = header.find(name)) {
      found = name;
      return value;
    }
  return nullptr;
}

Result<std::vector<double>> numbers(const Header& header, const std::string& field, size_t count) {
  std::vector<double> all;
  for (const std::string_view word : words(*header.find(field))) {
    const auto value = number<double>(word);
    if (!value || !std::isfinite(*value) || all.size() == count)
      return header.wrong(field, fmt::format("{} numbers", count));
    all.push_back(*value);
  }
  if (all.size() != count) return header.wrong(field, fmt::format("{} numbers", count));
  return all;
}

Result<bool> truth(const Header& header, const std::string& field, bool otherwise) {
  const std::string* const value = header.find(field);
  if (!value) return otherwise;
  const std::string word = lower(*value);
  if (word == "true" || word == "1") return true;
  if (word == "false" || word == "0") return false;
  return header.wrong(field, "True or False");
}

Result<double> real(const Header& header, const std::string& field, double otherwise) {
  if (!header.find(field)) return otherwise;
  VOX_TRY(const auto values, numbers(header, field, 1));
  return values[0];
}

Status parse_place(const Header& header, size_t axes, VolumeInfo& info, std::vector<std::string>& dropped) {
  std::string field;
  std::vector<double> steps(axes, 1), offset(axes, 0), matrix(axes * axes, 0);
  for (size_t i = 0; i < axes; ++i) matrix[i * axes + i] = 1;
  if (any_of(header, {"elementspacing", "elementsize"}, field)) {
    VOX_TRY(steps, numbers(header, field, axes));
    if (std::count(steps.begin(), steps.end(), 0.0))
      return header.wrong(field, "distances that are not zero");
  }
  if (any_of(header, {"offset", "position", "origin"}, field)) {
    VOX_TRY(offset, numbers(header, field, axes));
  }
  if (any_of(header, {"transformmatrix", "rotation", "orientation"}, field)) {
    VOX_TRY(matrix, numbers(header, field, axes * axes));
  }
  const size_t spatial = std::min<size_t>(axes, 3);
  info.affine.axes = {};
  for (size_t i = 0; i < spatial; ++i) {
    for (size_t k = 0; k < spatial; ++k) info.affine.axes[i][k] = matrix[i * axes + k] * steps[i];
    info.affine.origin[i] = offset[i];
  }
  complete_axes(info.affine, {1, 1, 1});
  if (!info.affine.is_valid()) return header.wrong(field, "axes that do not lie in one plane");
  for (size_t i = spatial; i < axes; ++i) {
    bool coupled = offset[i] != 0 || steps[i] != 1;
    for (size_t k = 0; k < axes; ++k)
      coupled |= k != i && (matrix[i * axes + k] != 0 || matrix[k * axes + i] != 0);
    if (coupled) dropped.emplace_back("distance and origin of time steps");
  }
  const std::string* const sides = header.find("anatomicalorientation");
  info.world = sides && sides->find('?') != sides->npos ? World::unknown : World::lps;
  if (const std::string* unit = header.find("distanceunits"); unit && unit->find('?') == unit->npos) {
    const auto known = parse_unit(*unit);
    if (!known) return header.wrong("distanceunits", "um, mm or cm");
    info.unit = *known;
  }
  return {};
}

/// Fields that nothing is made of.
void find_dropped(const Header& header, std::vector<std::string>& dropped) {
  static const std::vector<std::string> read{"ndims",
                                             "dimsize",
                                             "elementtype",
                                             "elementnumberofchannels",
                                             "elementspacing",
                                             "elementsize",
                                             "offset",
                                             "position",
                                             "origin",
                                             "transformmatrix",
                                             "rotation",
                                             "orientation",
                                             "anatomicalorientation",
                                             "distanceunits",
                                             "binarydata",
                                             "binarydatabyteordermsb",
                                             "elementbyteordermsb",
                                             "compresseddata",
                                             "headersize",
                                             "elementtointensityfunctionslope",
                                             "elementtointensityfunctionoffset",
                                             "comment",
                                             "elementdatafile"};
  std::vector<std::string> others;
  for (const auto& [field, value] : header.fields) {
    const bool known = std::count(read.begin(), read.end(), field) > 0 ||
                       std::count(std::begin(without_meaning), std::end(without_meaning), field) > 0;
    const bool zero = field == "centerofrotation" && value.find_first_not_of("0 .-") == value.npos;
    const bool unknown = field == "modality" && (value == "MET_MOD_UNKNOWN" || value == "MET_MOD_OTHER");
    if (!known && !zero && !unknown) others.push_back(field);
  }
  if (others.empty()) return;
  dropped.push_back(fmt::format("{} field{} (\"{}\"{})", others.size(), others.size() == 1 ? "" : "s",
                                text_field(others[0].substr(0, 40)), others.size() > 1 ? " ..." : ""));
}

Status parse_samples(const Header& header, Image& image) {
  const std::string* const type = header.find("elementtype");
  const auto* const found = std::find_if(std::begin(type_names), std::end(type_names),
                                         [&](const TypeName& t) { return type && *type == t.name; });
  if (found == std::end(type_names))
    return header.wrong("elementtype", "MET_UCHAR to MET_LONG_LONG, MET_FLOAT or MET_DOUBLE");
  image.layout.type = image.info.sample_type = found->type;
  image.info.format = scalar_format(found->type);
  VOX_TRY(image.layout.big_endian, truth(header, "binarydatabyteordermsb", false));
  VOX_TRY(image.layout.big_endian, truth(header, "elementbyteordermsb", image.layout.big_endian));
  VOX_TRY(image.compressed, truth(header, "compresseddata", false));
  VOX_TRY(const bool binary, truth(header, "binarydata", true));
  image.text = !binary;
  if (image.text) image.layout.big_endian = false;
  if (const std::string* size = header.find("headersize")) {
    const auto bytes = number<int64_t>(*size);
    if (!bytes || *bytes < -1) return header.wrong("headersize", "a number of bytes, or -1");
    if (*bytes != 0 && (image.compressed || image.text))
      return header.wrong("headersize", "0 before data that are compressed or text");
    image.header_size = *bytes;
  }
  return {};
}

/// Sides, and which of the volumes it is.
Status parse_shape(const Header& header, const OpenOptions& options, Image& image) {
  const std::string* const dimension = header.find("ndims");
  const auto axes = dimension ? number<size_t>(*dimension) : std::nullopt;
  if (!axes || *axes < 1 || *axes > most_axes)
    return header.wrong("ndims", fmt::format("1 to {} axes", most_axes));
  const std::string expected = fmt::format("{} whole numbers from 1 to 2^31", *axes);
  if (!header.find("dimsize")) return header.wrong("dimsize", expected);
  for (const std::string_view word : words(*header.find("dimsize"))) {
    const auto side = number<int64_t>(word);
    if (!side || *side < 1 || *side > max_side || image.sides.size() == *axes)
      return header.wrong("dimsize", expected);
    image.sides.push_back(*side);
  }
  if (image.sides.size() != *axes) return header.wrong("dimsize", expected);
  int64_t channels = 1;
  if (const std::string* count = header.find("elementnumberofchannels")) {
    const auto value = number<int64_t>(*count);
    if (!value || *value < 1 || *value > 65536) return header.wrong("elementnumberofchannels", "1 to 65536");
    channels = *value;
  }
  if ((channels == 3 || channels == 4) && image.layout.type == SampleType::u8) {
    image.layout.components = static_cast<int>(channels);
    image.info.format = channels == 4 ? VoxelFormat::rgba32 : VoxelFormat::rgb24;
    channels = 1;
  }
  const int64_t sample = sample_bytes(image.layout.type);
  uint64_t bytes = static_cast<uint64_t>(image.layout.bytes_per_voxel() * channels);
  std::array<int64_t, most_axes + 1> steps{static_cast<int64_t>(bytes)};
  std::array<int64_t, most_axes> sides{1, 1, 1, 1};
  for (size_t i = 0; i < most_axes; ++i) {
    if (i < *axes) sides[i] = image.sides[i];
    if (__builtin_mul_overflow(bytes, static_cast<uint64_t>(sides[i]), &bytes) || bytes >> 62 != 0)
      return header.wrong("dimsize", "at most 2^62 bytes");
    steps[i + 1] = static_cast<int64_t>(bytes);
  }
  image.bytes = bytes;
  image.info.dims = {sides[0], sides[1], sides[2]};
  image.strides = {steps[0], steps[1], steps[2], sample};
  VOX_TRY(const auto chosen, choose_parts(header.name,
                                          {{"--time", "time steps", sides[3], options.time},
                                           {"--channel", "channels", channels, options.channel}},
                                          options, image.info));
  image.offset = static_cast<uint64_t>(chosen[0] * steps[3] + chosen[1] * sample);
  return {};
}

}  // namespace

const std::string* Header::find(const std::string& field) const {
  const auto it = fields.find(field);
  return it == fields.end() ? nullptr : &it->second;
}

tl::unexpected<Error> Header::wrong(const std::string& field, const std::string& expected) const {
  if (const std::string* value = find(field))
    return bad_input(name, fmt::format("MetaImage header: {}: \"{}\": expected {}", field,
                                       text_field(value->substr(0, 80)), expected));
  return bad_input(name,
                   fmt::format("MetaImage header: the field {} is missing: expected {}", field, expected));
}

Result<Header> read_header(InputStream& stream) {
  Header header;
  header.name = stream.name();
  bool listing = false;
  for (int number = 1;; ++number) {
    if (stream.position() > most_bytes)
      return bad_input(
          header.name,
          fmt::format("MetaImage header: longer than {} bytes: expected ElementDataFile", most_bytes));
    VOX_TRY(const auto line, stream.read_line());
    if (!line) {
      if (listing) return header;
      return bad_input(header.name, "MetaImage header: expected ElementDataFile as its last field");
    }
    if (listing) {
      if (const auto name = trim(*line); !name.empty()) header.listed.emplace_back(name);
      continue;
    }
    if (trim(*line).empty()) continue;
    const size_t sign = line->find_first_of("=:");
    if (sign == line->npos)
      return bad_input(header.name,
                       number == 1 ? "not a MetaImage: expected a line Name = value"
                                   : fmt::format("MetaImage header, line {}: expected Name = value", number));
    const std::string field = lower(trim(std::string_view(*line).substr(0, sign)));
    const std::string value(trim(std::string_view(*line).substr(sign + 1)));
    if (!header.fields.emplace(field, value).second)
      return bad_input(header.name, fmt::format("MetaImage header, line {}: {} comes twice: expected it once",
                                                number, text_field(field.substr(0, 40))));
    if (field != "elementdatafile") continue;
    if (const auto file = words(value); file.empty() || file[0] != "LIST") return header;
    listing = true;
  }
}

Result<Image> interpret(const Header& header, const OpenOptions& options, Context& ctx) {
  if (const std::string* kind = header.find("objecttype"); kind && lower(*kind) != "image")
    return header.wrong("objecttype", "Image");
  Image image;
  VOX_CHECK(parse_samples(header, image));
  VOX_CHECK(parse_shape(header, options, image));
  std::vector<std::string> dropped;
  VOX_CHECK(parse_place(header, image.sides.size(), image.info, dropped));
  VOX_TRY(image.info.slope, real(header, "elementtointensityfunctionslope", 1));
  VOX_TRY(image.info.intercept, real(header, "elementtointensityfunctionoffset", 0));
  if (const std::string* comment = header.find("comment")) image.info.description = text_field(*comment);
  find_dropped(header, dropped);
  if (!dropped.empty()) ctx.note(fmt::format("{}: {}: dropped", header.name, listed(dropped)));
  return image;
}

std::string header_text(const std::string& path, const VolumeInfo& info, const SampleLayout& layout,
                        const std::string& data_file, Context& ctx) {
  Affine affine = info.affine;
  const bool patient = is_anatomical(info.world);
  if (patient) affine = in_world(affine, info.world, World::lps);
  Unit unit = info.unit;
  if (unit != Unit::unknown && unit != Unit::micrometre && unit != Unit::centimetre) {
    unit = unit == Unit::nanometre || unit == Unit::angstrom ? Unit::micrometre : Unit::millimetre;
    affine = in_unit(affine, info.unit, unit);
  }
  note_dropped(path, "MetaImage",
               not_held(info, {.place = true,
                               .directions = true,
                               .world = patient || info.world == World::unknown,
                               .unit = true,
                               .scale = true,
                               .description = true}),
               ctx);
  std::string matrix;
  const Affine::Vector steps = affine.spacing();
  for (size_t i = 0; i < 3; ++i)
    for (size_t k = 0; k < 3; ++k) matrix += fmt::format(" {}", affine.axes[i][k] / steps[i] + 0.0);
  // Of each axis the side that it comes from.
  std::string sides = "???";
  if (patient) {
    sides = orientation(affine, World::lps);
    for (char& side : sides) {
      constexpr std::string_view to = "RLAPIS", from = "LRPASI";
      side = from[to.find(side)];
    }
  }
  const auto triple = [](const auto& v) { return fmt::format("{} {} {}", v[0], v[1], v[2]); };
  std::string text = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n";
  text += "CompressedData = False\nTransformMatrix =" + matrix + "\n";
  text += "Offset = " + triple(affine.origin) + "\nCenterOfRotation = 0 0 0\n";
  text += "AnatomicalOrientation = " + sides + "\nElementSpacing = " + triple(steps) + "\n";
  if (unit != Unit::unknown) text += fmt::format("DistanceUnits = {}\n", unit_name(unit));
  if (const std::string comment = text_field(info.description); !comment.empty())
    text += fmt::format("Comment = {}\n", comment);
  text += "DimSize = " + triple(info.dims) + "\n";
  if (info.slope != 1) text += fmt::format("ElementToIntensityFunctionSlope = {}\n", info.slope);
  if (info.intercept != 0) text += fmt::format("ElementToIntensityFunctionOffset = {}\n", info.intercept);
  if (layout.components > 1) text += fmt::format("ElementNumberOfChannels = {}\n", layout.components);
  const auto* const type = std::find_if(std::begin(type_names), std::end(type_names),
                                        [&](const TypeName& t) { return t.type == layout.type; });
  return text + fmt::format("ElementType = {}\nElementDataFile = {}\n", type->name, data_file);
}

}  // namespace voxkit::meta
