#include "formats/volume/nrrd_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace voxkit::nrrd {
namespace {

constexpr size_t max_header_bytes = size_t{16} << 20;
constexpr std::string_view slope_key = "voxkit slope", intercept_key = "voxkit intercept",
                           format_key = "voxkit format";

std::string_view trim(std::string_view s) {
  const size_t first = s.find_first_not_of(" \t");
  return first == s.npos ? std::string_view{} : s.substr(first, s.find_last_not_of(" \t") - first + 1);
}

constexpr std::string_view known_fields[] = {"axismaxs",
                                             "axismins",
                                             "blocksize",
                                             "byteskip",
                                             "centerings",
                                             "centers",
                                             "content",
                                             "datafile",
                                             "dimension",
                                             "encoding",
                                             "endian",
                                             "kinds",
                                             "labels",
                                             "lineskip",
                                             "max",
                                             "min",
                                             "number",
                                             "measurementframe",
                                             "oldmax",
                                             "oldmin",
                                             "sampleunits",
                                             "sizes",
                                             "space",
                                             "spacedimension",
                                             "spacedirections",
                                             "spaceorigin",
                                             "spaceunits",
                                             "spacings",
                                             "thicknesses",
                                             "type",
                                             "units"};

struct TypeName {
  std::string_view names;  ///< between commas
  SampleType type;
};
constexpr TypeName type_names[] = {
    {",signed char,int8,int8_t,", SampleType::i8},
    {",uchar,unsigned char,uint8,uint8_t,", SampleType::u8},
    {",short,short int,signed short,signed short int,int16,int16_t,", SampleType::i16},
    {",ushort,unsigned short,unsigned short int,uint16,uint16_t,", SampleType::u16},
    {",int,signed int,int32,int32_t,", SampleType::i32},
    {",uint,unsigned int,uint32,uint32_t,", SampleType::u32},
    {",longlong,long long,long long int,signed long long,signed long long int,int64,int64_t,",
     SampleType::i64},
    {",ulonglong,unsigned long long,unsigned long long int,uint64,uint64_t,", SampleType::u64},
    {",float,", SampleType::f32},
    {",double,", SampleType::f64},
};

Result<SampleType> parse_type(const Header& header) {
  if (const Field* field = header.find("type"))
    for (const TypeName& t : type_names)
      if (t.names.find(fmt::format(",{},", lower(field->value))) != t.names.npos) return t.type;
  return header.wrong("type", "an integer type of 8 to 64 bits, float or double");
}

Result<Encoding> parse_encoding(const Header& header) {
  const Field* field = header.find("encoding");
  const std::string name = field ? lower(field->value) : "";
  if (name == "raw") return Encoding::raw;
  if (name == "gzip" || name == "gz") return Encoding::gzip;
  if (name == "bzip2" || name == "bz2") return Encoding::bzip2;
  if (name == "text" || name == "txt" || name == "ascii") return Encoding::text;
  return header.wrong("encoding", "raw, gzip, bzip2 or ascii (hex is unsupported)");
}

/// One number for each axis, where the field is there; nan stands for an axis without.
Result<std::vector<double>> parse_axis_numbers(const Header& header, const std::string& name, int dimension) {
  std::vector<double> values(static_cast<size_t>(dimension), std::nan(""));
  const Field* field = header.find(name);
  if (!field) return values;
  const auto tokens = words(field->value);
  if (tokens.size() != values.size()) return header.wrong(name, fmt::format("{} numbers", dimension));
  for (size_t i = 0; i < values.size(); ++i) {
    const auto value = number<double>(tokens[i]);
    if (!value || std::isinf(*value)) return header.wrong(name, fmt::format("{} numbers or nan", dimension));
    values[i] = *value;
  }
  return values;
}

/// Vectors such as "(1,0,0)"; "none" becomes an empty one.
Result<std::vector<std::vector<double>>> parse_vectors(const Header& header, const std::string& name,
                                                       size_t count) {
  const auto wrong = [&] { return header.wrong(name, fmt::format("{} vectors such as (1,0,0)", count)); };
  std::vector<std::vector<double>> vectors;
  for (std::string_view rest = trim(header.find(name)->value); !rest.empty(); rest = trim(rest)) {
    std::vector<double> vector;
    if (lower(rest.substr(0, 4)) == "none") {
      rest.remove_prefix(4);
    } else {
      const size_t close = rest.find(')');
      if (rest.front() != '(' || close == rest.npos) return wrong();
      for (std::string_view inside = rest.substr(1, close - 1);;) {
        const size_t comma = std::min(inside.find(','), inside.size());
        const auto value = number<double>(trim(inside.substr(0, comma)));
        if (!value || std::isinf(*value)) return wrong();
        vector.push_back(*value);
        if (comma == inside.size()) break;
        inside.remove_prefix(comma + 1);
      }
      rest.remove_prefix(close + 1);
    }
    vectors.push_back(std::move(vector));
  }
  if (vectors.size() != count) return wrong();
  return vectors;
}

double length(const std::vector<double>& vector) {
  // An axis-parallel vector has its component as length, without the rounding of a square root.
  double largest = 0, sum = 0;
  for (double v : vector) largest = std::max(largest, std::abs(v));
  if (largest == 0) return 0;
  for (double v : vector) sum += (v / largest) * (v / largest);
  return largest * std::sqrt(sum);
}

/// Spacing and origin, from whichever fields there are; `first` is the first axis of space, and there are
/// `axes` of them.
Status parse_placement(const Header& header, int dimension, int first, int axes, VolumeInfo& info) {
  VOX_TRY(const auto spacings, parse_axis_numbers(header, "spacings", dimension));
  VOX_TRY(const auto mins, parse_axis_numbers(header, "axismins", dimension));
  VOX_TRY(const auto maxs, parse_axis_numbers(header, "axismaxs", dimension));
  std::vector<std::string_view> centers;
  if (const Field* field = header.find("centers")) centers = words(field->value);
  std::vector<std::vector<double>> directions(static_cast<size_t>(dimension));
  if (header.find("spacedirections")) {
    VOX_TRY(directions, parse_vectors(header, "spacedirections", directions.size()));
  }
  for (int i = 0; i < axes; ++i) {
    const size_t axis = static_cast<size_t>(first + i), k = static_cast<size_t>(i);
    const bool cell = axis < centers.size() && lower(centers[axis]) == "cell";
    double spacing = std::abs(spacings[axis]);
    if (!directions[axis].empty()) spacing = length(directions[axis]);
    const double gaps = static_cast<double>(info.dims[i] - (cell ? 0 : 1));
    if (std::isnan(spacing) && gaps > 0) spacing = std::abs(maxs[axis] - mins[axis]) / gaps;
    if (spacing == 0)
      return header.wrong(header.find("spacedirections") ? "spacedirections" : "spacings",
                          "steps that are not zero");
    if (std::isfinite(spacing)) info.affine.axes[k][k] = spacing;
    if (!std::isnan(mins[axis])) info.affine.origin[k] = mins[axis] + (cell ? info.affine.axes[k][k] / 2 : 0);
  }
  if (header.find("spaceorigin")) {
    VOX_TRY(const auto origin, parse_vectors(header, "spaceorigin", 1));
    for (size_t i = 0; i < std::min<size_t>(3, origin[0].size()); ++i)
      if (!std::isnan(origin[0][i])) info.affine.origin[i] = origin[0][i];
  }
  return {};
}

/// Our own pairs: what a NRRD header has no field for.
Status parse_keys(const Header& header, VolumeInfo& info) {
  for (const auto& [key, field] : header.keys) {
    const auto wrong = [&, &k = key, &f = field](const char* expected) {
      return bad_input(header.name, fmt::format("NRRD header, line {}: {}:={}: expected {}", f.line, k,
                                                f.value.substr(0, 80), expected));
    };
    if (key == slope_key || key == intercept_key) {
      const auto value = number<double>(trim(field.value));
      if (!value || !std::isfinite(*value)) return wrong("a number");
      (key == slope_key ? info.slope : info.intercept) = *value;
    } else if (key == format_key) {
      if (trim(field.value) != "BITMAP" || info.format != VoxelFormat::density8 ||
          info.sample_type != SampleType::u8)
        return wrong("BITMAP, and the type uint8");
      info.format = VoxelFormat::bitmap;
      info.sample_type = SampleType::bit;
    }
  }
  return {};
}

Result<int64_t> parse_skip(const Header& header, const std::string& name, int64_t least) {
  const Field* field = header.find(name);
  if (!field) return 0;
  const auto value = number<int64_t>(field->value);
  if (!value || *value < least) return header.wrong(name, fmt::format("an integer from {}", least));
  return *value;
}

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

}  // namespace

std::string lower(std::string_view s) {
  std::string out(s);
  for (char& c : out)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return out;
}
std::vector<std::string_view> words(std::string_view s) {
  std::vector<std::string_view> out;
  for (s = trim(s); !s.empty(); s = trim(s)) {
    const size_t end = std::min(s.find_first_of(" \t"), s.size());
    out.push_back(s.substr(0, end));
    s.remove_prefix(end);
  }
  return out;
}
tl::unexpected<Error> Header::wrong(const std::string& field, const std::string& expected) const {
  if (const Field* f = find(field))
    return bad_input(name, fmt::format("NRRD header, line {}: {}: \"{}\": expected {}", f->line, field,
                                       f->value.substr(0, 80), expected));
  return bad_input(name, fmt::format("NRRD header: the field {} is missing: expected {}", field, expected));
}

Result<Header> read_header(InputStream& stream) {
  Header header;
  header.name = stream.name();
  // The magic is looked at before anything is called a line, so that a file of another kind is told apart at
  // once.
  char magic[8];
  VOX_TRY(const size_t count, stream.read(std::as_writable_bytes(std::span(magic))));
  if (count < 8 || std::memcmp(magic, "NRRD000", 7) != 0 || magic[7] < '1' || magic[7] > '9')
    return bad_input(header.name, "not a NRRD file: expected the magic NRRD0001 to NRRD0005 at byte 0");
  if (magic[7] > '5')
    return bad_input(header.name, fmt::format("NRRD version {} is unsupported: expected 1 to 5", magic[7]));
  bool listing = false;
  for (int number = 1;; ++number) {
    VOX_TRY(const auto line, stream.read_line());
    if (stream.position() > max_header_bytes)
      return bad_input(
          header.name,
          fmt::format("NRRD header: longer than {} bytes: expected a blank line after it", max_header_bytes));
    if (!line) break;
    if (number == 1) {
      if (!trim(*line).empty())
        return bad_input(header.name, "NRRD header, line 1: expected the magic NRRD0001 to NRRD0005 alone");
      continue;
    }
    if (listing) {
      if (!line->empty()) header.listed.push_back(*line);
      continue;
    }
    if (line->empty()) return header;
    if (line->front() == '#') continue;
    const size_t pair = line->find(":="), colon = line->find(": ");
    const auto at = [&](const char* what) {
      return bad_input(header.name,
                       fmt::format("NRRD header, line {}: \"{}\": {}", number, line->substr(0, 80), what));
    };
    if (pair < colon) {
      header.keys[line->substr(0, pair)] = {line->substr(pair + 2), number};
      continue;
    }
    if (colon == line->npos) return at("expected \"field: value\" or \"key:=value\"");
    std::string field = lower(line->substr(0, colon));
    std::erase(field, ' ');
    if (std::find(std::begin(known_fields), std::end(known_fields), field) == std::end(known_fields))
      return at("unknown field: expected one of the NRRD format");
    if (field == "centerings") field = "centers";
    const std::string value(trim(std::string_view(*line).substr(colon + 2)));
    if (!header.fields.emplace(field, Field{value, number}).second)
      return at("the field is there twice: expected once");
    listing = field == "datafile" && value.substr(0, 4) == "LIST";
  }
  if (!header.find("datafile"))
    return bad_input(
        header.name,
        fmt::format("NRRD header ends at byte {}: expected a blank line and data, or a data file field",
                    stream.position()));
  return header;
}

Result<Nrrd> interpret(const Header& header) {
  Nrrd nrrd;
  const Field* dimension = header.find("dimension");
  nrrd.dimension = dimension ? number<int>(dimension->value).value_or(0) : 0;
  if (nrrd.dimension < 1 || nrrd.dimension > 4) return header.wrong("dimension", "1 to 4 axes");
  VOX_TRY(const SampleType type, parse_type(header));
  VOX_TRY(nrrd.encoding, parse_encoding(header));
  VOX_TRY(nrrd.line_skip, parse_skip(header, "lineskip", 0));
  VOX_TRY(nrrd.byte_skip, parse_skip(header, "byteskip", nrrd.encoding == Encoding::raw ? -1 : 0));

  const Field* sizes = header.find("sizes");
  for (std::string_view word : sizes ? words(sizes->value) : std::vector<std::string_view>{}) {
    const auto size = number<int64_t>(word);
    if (!size || *size < 1 || *size > max_side) return header.wrong("sizes", "integers from 1 to 2^31");
    nrrd.sizes.push_back(*size);
  }
  if (nrrd.sizes.size() != static_cast<size_t>(nrrd.dimension))
    return header.wrong("sizes", fmt::format("{} integers, one for each axis", nrrd.dimension));

  bool coloured = nrrd.dimension == 4;
  if (const Field* kinds = header.find("kinds")) {
    const auto names = words(kinds->value);
    if (names.size() != nrrd.sizes.size())
      return header.wrong("kinds", fmt::format("{} kinds", nrrd.dimension));
    const std::string kind = lower(names[0]);
    coloured |= kind == "rgb-color" || kind == "rgba-color" || kind == "3-color" || kind == "4-color";
  }
  const int first = coloured ? 1 : 0;
  const int64_t components = coloured ? nrrd.sizes[0] : 1;
  if (coloured && (nrrd.dimension < 2 || (components != 3 && components != 4)))
    return header.wrong("sizes", "3 or 4 components first, then up to 3 axes of space");
  if (coloured && type != SampleType::u8) return header.wrong("type", "uint8 where voxels have components");
  VolumeInfo& info = nrrd.info;
  info.dims = {1, 1, 1};
  for (int i = first; i < nrrd.dimension; ++i) info.dims[i - first] = nrrd.sizes[static_cast<size_t>(i)];
  const auto voxels = checked_voxels(info.dims);
  info.sample_type = type;
  info.format = components == 4   ? VoxelFormat::rgba32
                : components == 3 ? VoxelFormat::rgb24
                                  : scalar_format(type);
  nrrd.layout = {type, static_cast<int>(components), false};
  const auto bytes = voxels ? nrrd.layout.file_bytes(*voxels) : std::nullopt;
  if (!bytes) return header.wrong("sizes", "at most 2^62 voxels");
  nrrd.bytes = *bytes;

  const Field* endian = header.find("endian");
  const std::string order = endian ? lower(endian->value) : "";
  const bool needed = sample_bytes(type) > 1 && nrrd.encoding != Encoding::text;
  if (order != "big" && order != "little" && (endian || needed))
    return header.wrong("endian", "little or big");
  nrrd.layout.big_endian = order == "big" && needed;
  VOX_CHECK(parse_placement(header, nrrd.dimension, first, nrrd.dimension - first, info));
  VOX_CHECK(parse_keys(header, info));
  return nrrd;
}

std::string header_text(const VolumeInfo& info, const SampleLayout& layout, const std::string& data_file) {
  const bool coloured = is_colour(info.format);
  std::string text = "NRRD0005\n";
  const auto line = [&](std::string_view field, const std::string& value) {
    text += fmt::format("{}: {}\n", field, value);
  };
  line("type", std::string(type_name(layout.type)));
  line("dimension", coloured ? "4" : "3");
  line("space dimension", "3");
  const std::string sizes = fmt::format("{} {} {}", info.dims.x, info.dims.y, info.dims.z);
  line("sizes", coloured ? fmt::format("{} {}", layout.components, sizes) : sizes);
  // Not `spacings`, which the format does not allow beside an origin in space.
  line("space directions",
       fmt::format("{}({},0,0) (0,{},0) (0,0,{})", coloured ? "none " : "", info.affine.axes[0][0],
                   info.affine.axes[1][1], info.affine.axes[2][2]));
  if (coloured)
    line("kinds",
         fmt::format("{} domain domain domain", layout.components == 4 ? "RGBA-color" : "RGB-color"));
  if (sample_bytes(layout.type) > 1) line("endian", "little");
  line("encoding", "raw");
  line("space origin",
       fmt::format("({},{},{})", info.affine.origin[0], info.affine.origin[1], info.affine.origin[2]));
  if (info.slope != 1) text += fmt::format("{}:={}\n", slope_key, info.slope);
  if (info.intercept != 0) text += fmt::format("{}:={}\n", intercept_key, info.intercept);
  if (info.format == VoxelFormat::bitmap) text += fmt::format("{}:=BITMAP\n", format_key);
  if (!data_file.empty()) line("data file", data_file);
  return text + "\n";
}

}  // namespace voxkit::nrrd
