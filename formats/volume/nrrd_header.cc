#include "formats/volume/nrrd_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace voxkit::nrrd {
namespace {

constexpr size_t max_header_bytes = size_t{16} << 20;

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

}  // namespace

Result<SampleType> parse_type(const Header& header) {
  if (const Field* field = header.find("type"))
    for (const TypeName& t : type_names)
      if (t.names.find(fmt::format(",{},", lower(field->value))) != t.names.npos) return t.type;
  return header.wrong("type", "an integer type of 8 to 64 bits, float or double");
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

Result<Encoding> parse_encoding(const Header& header) {
  const Field* field = header.find("encoding");
  const std::string name = field ? lower(field->value) : "";
  if (name == "raw") return Encoding::raw;
  if (name == "gzip" || name == "gz") return Encoding::gzip;
  if (name == "bzip2" || name == "bz2") return Encoding::bzip2;
  if (name == "text" || name == "txt" || name == "ascii") return Encoding::text;
  if (name == "hex") return Encoding::hex;
  return header.wrong("encoding", "raw, gzip, bzip2, ascii or hex");
}

Result<int64_t> parse_skip(const Header& header, const std::string& name, int64_t least) {
  const Field* field = header.find(name);
  if (!field) return 0;
  const auto value = number<int64_t>(field->value);
  if (!value || *value < least) return header.wrong(name, fmt::format("an integer from {}", least));
  return *value;
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

Result<std::vector<std::string>> parse_texts(const Header& header, const std::string& name, size_t count) {
  std::vector<std::string> texts;
  const auto wrong = [&] { return header.wrong(name, fmt::format("{} texts such as \"mm\"", count)); };
  for (std::string_view rest = trim(header.find(name)->value); !rest.empty(); rest = trim(rest)) {
    std::string text;
    size_t i = 0;
    if (rest.front() == '"') {
      for (i = 1; i < rest.size() && rest[i] != '"'; ++i) {
        if (rest[i] == '\\' && i + 1 < rest.size() && rest[i + 1] == '"') ++i;
        text += rest[i];
      }
      if (i == rest.size()) return wrong();
      ++i;
    } else {  // some leave the marks out
      i = std::min(rest.find_first_of(" \t"), rest.size());
      text = rest.substr(0, i);
    }
    rest.remove_prefix(i);
    texts.push_back(std::string(trim(text)));
  }
  if (texts.size() != count) return wrong();
  return texts;
}

}  // namespace voxkit::nrrd
