#include "formats/volume/nifti_header.h"

#include <fmt/format.h>
#include <nifti2.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "formats/volume/facts.h"

namespace voxkit::nifti {
namespace {

static_assert(sizeof(nifti_1_header) == 348 && sizeof(nifti_2_header) == 540);

struct Type {
  int code;
  SampleType type;
  int components;
};
constexpr Type types[] = {
    {DT_UINT8, SampleType::u8, 1},    {DT_INT8, SampleType::i8, 1},    {DT_INT16, SampleType::i16, 1},
    {DT_UINT16, SampleType::u16, 1},  {DT_INT32, SampleType::i32, 1},  {DT_UINT32, SampleType::u32, 1},
    {DT_INT64, SampleType::i64, 1},   {DT_UINT64, SampleType::u64, 1}, {DT_FLOAT32, SampleType::f32, 1},
    {DT_FLOAT64, SampleType::f64, 1}, {DT_RGB24, SampleType::u8, 3},   {DT_RGBA32, SampleType::u8, 4},
};

struct Name {
  int code;
  const char* text;
};
constexpr Name unsupported_types[] = {{DT_BINARY, "1 bit"},
                                      {DT_COMPLEX64, "complex64"},
                                      {DT_FLOAT128, "float128"},
                                      {DT_COMPLEX128, "complex128"},
                                      {DT_COMPLEX256, "complex256"}};
constexpr Name intents[] = {{2, "correlation"},
                            {3, "t statistic"},
                            {4, "F statistic"},
                            {5, "z score"},
                            {6, "chi squared"},
                            {22, "p value"},
                            {23, "ln p value"},
                            {24, "log10 p value"},
                            {1001, "estimate"},
                            {1004, "general matrices"},
                            {1005, "symmetric matrices"},
                            {1006, "displacements"},
                            {1007, "vectors"},
                            {1008, "points"},
                            {1009, "triangles"},
                            {1010, "quaternions"},
                            {1011, "numbers without dimension"},
                            {2001, "time series"},
                            {2002, "node indices"},
                            {2003, "RGB"},
                            {2004, "RGBA"},
                            {2005, "shape"}};

template <size_t n>
const char* name_of(const Name (&names)[n], int code, const char* other) {
  for (const Name& name : names)
    if (name.code == code) return name.text;
  return other;
}

template <class T>
void reverse(T& value) {
  auto* bytes = reinterpret_cast<std::byte*>(&value);
  std::reverse(bytes, bytes + sizeof(T));
}
template <class T, size_t n>
void reverse(T (&values)[n]) {
  for (T& value : values) reverse(value);
}

/// The fields of use, which both versions call the same.
template <class Fields>
void swap_bytes(Fields& h) {
  reverse(h.dim), reverse(h.pixdim), reverse(h.datatype), reverse(h.vox_offset);
  reverse(h.scl_slope), reverse(h.scl_inter), reverse(h.cal_min), reverse(h.cal_max);
  reverse(h.xyzt_units), reverse(h.intent_code), reverse(h.slice_code), reverse(h.slice_duration);
  reverse(h.qform_code), reverse(h.sform_code);
  reverse(h.quatern_b), reverse(h.quatern_c), reverse(h.quatern_d);
  reverse(h.qoffset_x), reverse(h.qoffset_y), reverse(h.qoffset_z);
  reverse(h.srow_x), reverse(h.srow_y), reverse(h.srow_z);
}

template <class Fields>
void take(const Fields& h, Header& out) {
  for (size_t i = 0; i < 8; ++i) {
    out.dim[i] = h.dim[i];
    out.pixdim[i] = h.pixdim[i];
  }
  out.datatype = h.datatype;
  out.slope = h.scl_slope;
  out.intercept = h.scl_inter;
  out.cal_min = h.cal_min;
  out.cal_max = h.cal_max;
  out.units = h.xyzt_units;
  out.intent = h.intent_code;
  out.timing = h.slice_code != 0 || h.slice_duration != 0;
  out.intent_name = text_field({h.intent_name, sizeof h.intent_name});
  out.description = text_field({h.descrip, sizeof h.descrip});
  out.aux_file = text_field({h.aux_file, sizeof h.aux_file});
  out.qform_code = h.qform_code;
  out.sform_code = h.sform_code;
  out.quaternion = {h.quatern_b, h.quatern_c, h.quatern_d};
  out.offset_q = {h.qoffset_x, h.qoffset_y, h.qoffset_z};
  for (size_t i = 0; i < 4; ++i) {
    out.rows[0][i] = h.srow_x[i];
    out.rows[1][i] = h.srow_y[i];
    out.rows[2][i] = h.srow_z[i];
  }
}

Result<Header> parse_nifti1(const std::string& name, std::span<const std::byte> bytes) {
  nifti_1_header fields;
  std::memcpy(&fields, bytes.data(), sizeof fields);
  Header out;
  out.name = name;
  out.big_endian = fields.sizeof_hdr != 348;
  if (out.big_endian) swap_bytes(fields);
  take(fields, out);
  const bool single = std::memcmp(fields.magic, "n+1", 4) == 0;
  out.pair = !single;
  if (std::memcmp(fields.magic, "ni1", 4) != 0 && !single) {
    out.kind = Kind::analyze;
    out.qform_code = out.sform_code = out.units = out.intent = 0;
    out.timing = false;
    out.intent_name.clear();
    const auto* const text = reinterpret_cast<const char*>(bytes.data());
    out.analyze_unit = text_field({text + 56, 4});
    // Five numbers of 16 bits where others have the name of who made the scan.
    out.analyze_origin = std::any_of(text + 253, text + 259, [](char c) { return c != '\0'; });
  }
  double offset = fields.vox_offset;
  if (single && offset == 0) offset = 352;  // written by some; there is nowhere else to be
  const double least = single ? 348 : 0;
  if (!(offset >= least) || offset > 1e15 || offset != std::floor(offset))
    return out.wrong(fmt::format("vox_offset is {}: expected an integer from {}", fields.vox_offset, least));
  out.offset = static_cast<uint64_t>(offset);
  return out;
}

Result<Header> parse_nifti2(const std::string& name, std::span<const std::byte> bytes) {
  nifti_2_header fields;
  std::memcpy(&fields, bytes.data(), sizeof fields);
  Header out;
  out.name = name;
  out.kind = Kind::nifti2;
  out.big_endian = fields.sizeof_hdr != 540;
  if (out.big_endian) swap_bytes(fields);
  take(fields, out);
  const bool single = std::memcmp(fields.magic, "n+2\0\r\n\032\n", 8) == 0;
  out.pair = !single;
  if (!single && std::memcmp(fields.magic, "ni2\0\r\n\032\n", 8) != 0)
    return out.wrong("no magic at byte 4: expected n+2 or ni2, and its line ends");
  const int64_t offset = single && fields.vox_offset == 0 ? 544 : fields.vox_offset;
  const int64_t least = single ? 540 : 0;
  if (offset < least)
    return out.wrong(fmt::format("vox_offset is {}: expected an integer from {}", offset, least));
  out.offset = static_cast<uint64_t>(offset);
  return out;
}

}  // namespace

tl::unexpected<Error> Header::wrong(const std::string& what) const {
  return bad_input(name, (kind == Kind::analyze ? "Analyze header: " : "NIfTI header: ") + what);
}

Result<Header> read_header(InputStream& stream) {
  std::array<std::byte, 540> bytes{};
  VOX_CHECK(stream.read_exactly(std::span(bytes).first(348), "NIfTI header"));
  int32_t size = 0;
  std::memcpy(&size, bytes.data(), sizeof(size));
  if (size == 348 || size == static_cast<int32_t>(__builtin_bswap32(348)))
    return parse_nifti1(stream.name(), bytes);
  if (size == 540 || size == static_cast<int32_t>(__builtin_bswap32(540))) {
    VOX_CHECK(stream.read_exactly(std::span(bytes).subspan(348), "NIfTI-2 header"));
    return parse_nifti2(stream.name(), bytes);
  }
  return bad_input(stream.name(), "not a NIfTI file: expected 348 or 540 in the first four bytes");
}

Status skip_extensions(const Header& header, InputStream& stream, Context& ctx) {
  if (header.kind == Kind::analyze) return {};
  const uint64_t end = header.pair ? UINT64_MAX : header.offset;
  const auto fits = [&](uint64_t bytes) { return end - stream.position() >= bytes; };
  std::array<std::byte, 8> word{};
  if (!fits(4)) return {};
  VOX_TRY(const size_t flags, stream.read(std::span(word).first(4)));
  if (flags < 4 || word[0] == std::byte{0}) return {};
  uint64_t count = 0;
  std::vector<std::string> codes;
  while (fits(8)) {
    VOX_TRY(const size_t got, stream.read(word));
    if (got < 8) break;
    uint32_t size, code;
    std::memcpy(&size, &word[0], 4);
    std::memcpy(&code, &word[4], 4);
    if (header.big_endian) size = __builtin_bswap32(size), code = __builtin_bswap32(code);
    if (size < 8 || size > INT32_MAX || !fits(size - 8)) break;  // no more extensions
    if (codes.size() < 8) codes.push_back(fmt::format("{}", code));
    ++count;
    if (header.pair) {
      // The end of the file says when to stop.
      std::vector<std::byte> rest(std::min<size_t>(size - 8, size_t{1} << 16));
      uint64_t left = size - 8;
      while (left > 0) {
        const auto want = std::span(rest).first(static_cast<size_t>(std::min<uint64_t>(left, rest.size())));
        VOX_TRY(const size_t part, stream.read(want));
        left -= part;
        if (part < want.size()) break;
      }
      if (left > 0) break;
    } else {
      VOX_CHECK(stream.skip(size - 8));
    }
  }
  if (count > 0)
    ctx.note(fmt::format("{}: {} NIfTI extension{} skipped (of code {}{})", header.name, count,
                         count == 1 ? " is" : "s are", listed(codes), count > codes.size() ? " ..." : ""));
  return {};
}

Result<SampleLayout> sample_layout(const Header& header) {
  for (const Type& t : types)
    if (t.code == header.datatype) return SampleLayout{t.type, t.components, header.big_endian};
  const char* const name = name_of(unsupported_types, header.datatype, "");
  return header.wrong(
      fmt::format("datatype {}{} is unsupported: expected integers of 8 to 64 bits, float32, float64, RGB24 "
                  "or RGBA32",
                  header.datatype, *name ? fmt::format(" ({})", name) : ""));
}

int16_t datatype_of(const SampleLayout& layout) {
  for (const Type& t : types)
    if (t.type == layout.type && t.components == layout.components) return static_cast<int16_t>(t.code);
  return DT_UNKNOWN;
}

void read_meaning(const Header& header, VolumeInfo& info, Context& ctx) {
  std::vector<std::string> dropped;
  if (header.slope != 0 && !is_color(info.format)) {
    if (std::isfinite(header.slope) && std::isfinite(header.intercept)) {
      info.slope = header.slope;
      info.intercept = header.intercept;
      if (header.kind == Kind::analyze && (info.slope != 1 || info.intercept != 0))
        ctx.note(
            fmt::format("{}: a slope of {} and an intercept of {} are assumed, as SPM puts them into an "
                        "Analyze header",
                        header.name, info.slope, info.intercept));
    } else {
      dropped.push_back("a slope or an intercept that is no number");
    }
  }
  info.description = header.description;
  const bool labels = header.intent == NIFTI_INTENT_LABEL || header.intent == NIFTI_INTENT_NEURONAME;
  const bool colors = header.intent == NIFTI_INTENT_RGB_VECTOR || header.intent == NIFTI_INTENT_RGBA_VECTOR ||
                      header.intent == NIFTI_INTENT_VECTOR;
  if (labels && !is_color(info.format)) info.is_labels = true;
  if (header.intent != 0 && !labels && !(colors && is_color(info.format)))
    dropped.push_back(fmt::format("the intent code {} ({})", header.intent,
                                  name_of(intents, header.intent, "another one")));
  if (!header.intent_name.empty())
    dropped.push_back(fmt::format("the intent name \"{}\"", header.intent_name));
  if ((header.cal_min != 0 || header.cal_max != 0) && header.kind != Kind::analyze)
    dropped.push_back(fmt::format("the range to display, {} to {}", header.cal_min, header.cal_max));
  if (!header.aux_file.empty() && header.aux_file != "none")
    dropped.push_back(fmt::format("the auxiliary file \"{}\"", header.aux_file));
  if (header.timing) dropped.push_back("the order and times of slices");
  if (header.analyze_origin) dropped.push_back("the origin that SPM may have put there");
  if (!dropped.empty()) ctx.note(fmt::format("{}: the header has {}: dropped", header.name, listed(dropped)));
}

}  // namespace voxkit::nifti
