// NumPy arrays, https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html: a literal of Python
// that says what the samples are, then the samples.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <optional>
#include <string_view>
#include <vector>

#include "formats/little_endian.h"
#include "formats/volume/dense_sink.h"
#include "formats/volume/dense_source.h"
#include "formats/volume/facts.h"
#include "formats/volume/parts.h"
#include "formats/volume/readers.h"
#include "formats/volume/strided_source.h"

namespace voxkit {
namespace {

constexpr std::string_view magic = "\x93NUMPY";
constexpr size_t most_header = size_t{1} << 20;  // the library's own files take 64 KiB with version 1
constexpr size_t most_axes = 5;

struct NpyType {
  std::string_view name;  ///< without the byte order
  SampleType type;
};
constexpr NpyType types[] = {
    {"u1", SampleType::u8},  {"i1", SampleType::i8},  {"b1", SampleType::bit}, {"u2", SampleType::u16},
    {"i2", SampleType::i16}, {"u4", SampleType::u32}, {"i4", SampleType::i32}, {"u8", SampleType::u64},
    {"i8", SampleType::i64}, {"f2", SampleType::f16}, {"f4", SampleType::f32}, {"f8", SampleType::f64},
};

/// What a header says.
struct Array {
  std::string type;  ///< "<f4"
  bool fortran = false;
  std::vector<int64_t> shape;
  bool has_type = false, has_order = false, has_shape = false;
};

/// Reads the literal from its first character on.
class Literal {
 public:
  Literal(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  Result<Array> read() {
    Array array;
    if (!take('{')) return wrong("{");
    while (!take('}')) {
      VOX_TRY(const std::string key, string());
      if (!take(':')) return wrong(":");
      if (key == "descr" && !array.has_type) {
        if (next() == '[')
          return bad_input(file_, "has records of several fields: expected an array of numbers");
        VOX_TRY(array.type, string());
        array.has_type = true;
      } else if (key == "fortran_order" && !array.has_order) {
        array.fortran = word("True");
        if (!array.fortran && !word("False")) return wrong("True or False");
        array.has_order = true;
      } else if (key == "shape" && !array.has_shape) {
        VOX_TRY(array.shape, tuple());
        array.has_shape = true;
      } else {
        return wrong("descr, fortran_order and shape, once each");
      }
      if (!take(',') && next() != '}') return wrong(", or }");
    }
    if (!array.has_type || !array.has_order || !array.has_shape || next() != '\0')
      return wrong("descr, fortran_order and shape alone");
    return array;
  }

 private:
  /// The next character that is no blank; 0 at the end.
  char next() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
    return at_ < text_.size() ? text_[at_] : '\0';
  }
  bool take(char c) {
    if (next() != c) return false;
    ++at_;
    return true;
  }
  bool word(std::string_view w) {
    next();
    if (text_.substr(at_, w.size()) != w) return false;
    at_ += w.size();
    return true;
  }
  Result<std::string> string() {
    const char quote = next();
    if (quote != '\'' && quote != '"') return wrong("a string");
    const size_t end = text_.find(quote, at_ + 1);
    if (end == text_.npos) return wrong("a string with an end");
    const size_t first = at_ + 1;
    at_ = end + 1;
    return std::string(text_.substr(first, end - first));
  }
  Result<std::vector<int64_t>> tuple() {
    std::vector<int64_t> sides;
    if (!take('(')) return wrong("(");
    while (!take(')')) {
      next();
      int64_t side = 0;
      const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), side);
      if (error != std::errc{} || side < 0) return wrong("a side of the array");
      at_ = static_cast<size_t>(end - text_.data());
      take('L');  // of Python 2
      if (sides.size() == most_axes + 1) return wrong(fmt::format("1 to {} axes", most_axes));
      sides.push_back(side);
      if (!take(',') && next() != ')') return wrong(", or )");
    }
    return sides;
  }
  tl::unexpected<Error> wrong(const std::string& expected) const {
    return bad_input(file_, fmt::format("NumPy header, character {}: expected {}", at_, expected));
  }

  std::string_view text_;
  size_t at_ = 0;
  const std::string& file_;
};

Result<Array> read_header(InputStream& stream) {
  std::array<std::byte, 12> head{};
  const auto first = std::span(head).first(8);
  VOX_TRY(const size_t count, stream.read(first));
  if (count < first.size() || std::memcmp(head.data(), magic.data(), magic.size()) != 0)
    return bad_input(stream.name(), "not a NumPy array: expected the magic \\x93NUMPY at byte 0");
  const int version = std::to_integer<int>(head[6]);
  if (version < 1 || version > 3 || head[7] != std::byte{0})
    return bad_input(stream.name(), fmt::format("NumPy format {}.{} is unsupported: expected 1.0 to 3.0",
                                                version, std::to_integer<int>(head[7])));
  const auto length = std::span(head).subspan(8, version == 1 ? 2 : 4);
  VOX_CHECK(stream.read_exactly(length, "the length of the header"));
  const size_t bytes = version == 1 ? load_le<uint16_t>(length.data()) : load_le<uint32_t>(length.data());
  if (bytes > most_header)
    return bad_input(stream.name(),
                     fmt::format("NumPy header of {} bytes: expected at most {}", bytes, most_header));
  std::string text(bytes, '\0');
  VOX_CHECK(stream.read_exactly(std::as_writable_bytes(std::span(text)), "the header"));
  return Literal(text, stream.name()).read();
}

/// What an array is as a volume, and where in its data that begins.
struct Npy {
  VolumeInfo info;
  SampleLayout layout;
  Strides strides;
  uint64_t bytes = 0, offset = 0;
};

tl::unexpected<Error> wrong_type(const std::string& file, const std::string& type) {
  return bad_input(file,
                   fmt::format("elements of type \"{}\": expected u1 i1 u2 i2 u4 i4 u8 i8 f2 f4 f8 or b1, {}",
                               text_field(type.substr(0, 80)), "with < > | or = before it"));
}

Result<Npy> interpret(const Array& array, const std::string& file, const OpenOptions& options) {
  Npy npy;
  const std::string& type = array.type;
  const auto* const found = std::find_if(std::begin(types), std::end(types), [&](const NpyType& t) {
    return type.size() == 3 && type.substr(1) == t.name;
  });
  if (found == std::end(types) || std::string_view("<>|=").find(type[0]) == std::string_view::npos)
    return wrong_type(file, type);
  npy.layout = {found->type == SampleType::bit ? SampleType::u8 : found->type, 1, type[0] == '>'};
  npy.info.sample_type = found->type;
  npy.info.format = scalar_format(found->type);

  std::string shape;
  for (const int64_t side : array.shape) shape += fmt::format("{}{}", shape.empty() ? "" : ", ", side);
  const auto axes = array.shape.size();
  if (axes < 1 || axes > most_axes)
    return bad_input(file, fmt::format("shape ({}): expected 1 to {} axes", shape, most_axes));
  std::array<int64_t, most_axes> steps{};  // bytes to the next element along each axis
  uint64_t bytes = static_cast<uint64_t>(sample_bytes(npy.layout.type));
  for (size_t i = 0; i < axes; ++i) {
    const size_t axis = array.fortran ? i : axes - 1 - i;
    steps[axis] = static_cast<int64_t>(bytes);
    if (array.shape[axis] == 0) return bad_input(file, fmt::format("shape ({}): there are no voxels", shape));
    if (__builtin_mul_overflow(bytes, static_cast<uint64_t>(array.shape[axis]), &bytes) || bytes >> 62 != 0)
      return bad_input(file, fmt::format("shape ({}): expected at most 2^62 bytes", shape));
  }
  npy.bytes = bytes;

  // [time, channel,] z, y, x [, colours]
  size_t last = axes;
  if (axes > 3 && npy.info.sample_type == SampleType::u8 &&
      (array.shape.back() == 3 || array.shape.back() == 4)) {
    npy.layout.components = static_cast<int>(array.shape.back());
    npy.info.format = npy.layout.components == 4 ? VoxelFormat::rgba32 : VoxelFormat::rgb24;
    npy.strides.component = steps[--last];
  } else {
    npy.strides.component = sample_bytes(npy.layout.type);
  }
  const auto side = [&](size_t from_last) { return last >= from_last ? array.shape[last - from_last] : 1; };
  npy.info.dims = {side(1), side(2), side(3)};
  npy.strides.x = steps[last - 1];
  npy.strides.y = last >= 2 ? steps[last - 2] : npy.strides.x * npy.info.dims.x;
  npy.strides.z = last >= 3 ? steps[last - 3] : npy.strides.y * npy.info.dims.y;
  VOX_TRY(const auto chosen, choose_parts(file,
                                          {{"--time", "time steps", side(5), options.time},
                                           {"--channel", "channels", side(4), options.channel}},
                                          options, npy.info));
  if (last >= 5) npy.offset += static_cast<uint64_t>(chosen[0] * steps[last - 5]);
  if (last >= 4) npy.offset += static_cast<uint64_t>(chosen[1] * steps[last - 4]);
  return npy;
}

}  // namespace

SourceResult open_npy(std::unique_ptr<InputStream> stream, const OpenOptions& options, Context& ctx) {
  VOX_TRY(const Array array, read_header(*stream));
  VOX_TRY(const Npy npy, interpret(array, stream->name(), options));
  VOX_CHECK(stream->skip(npy.offset));
  return strided_source(std::move(stream), npy.strides, npy.info, npy.layout, options, ctx);
}

SourceResult open_npy(const std::string& path, const OpenOptions& options, Context& ctx) {
  VOX_TRY(auto file, MappedFile::open(path));
  const auto stream = stream_of(file);
  VOX_TRY(const Array array, read_header(*stream));
  VOX_TRY(Npy npy, interpret(array, path, options));
  const uint64_t first = stream->position(), there = file->bytes().size() - first;
  if (there < npy.bytes)
    return bad_input(
        path, fmt::format("voxel data at byte {} end after {} bytes: expected {}", first, there, npy.bytes));
  if (there > npy.bytes)
    ctx.note(fmt::format("{}: {} bytes after the array are dropped", path, there - npy.bytes));
  npy.info.files = {path};
  return strided_source(std::move(file), first + npy.offset, npy.strides, npy.info, npy.layout, options, ctx);
}

SinkResult create_npy(const std::string& path, const VolumeInfo& info, bool force, Context& ctx) {
  SampleLayout layout = storage_layout(info, true);
  const auto* const type = std::find_if(std::begin(types), std::end(types),
                                        [&](const NpyType& t) { return t.type == layout.type; });
  if (layout.type == SampleType::bit) layout.type = SampleType::u8;
  VOX_TRY(auto file, OutputFile::create(path, force));
  note_dropped(path, "NumPy", not_held(info, {}), ctx);
  // As the library writes it: the data begin at a multiple of 64 bytes.
  std::string text =
      fmt::format("{{'descr': '{}{}', 'fortran_order': False, 'shape': ({}, {}, {}{}), }}",
                  sample_bytes(layout.type) > 1 ? '<' : '|', type->name, info.dims.z, info.dims.y,
                  info.dims.x, layout.components > 1 ? fmt::format(", {}", layout.components) : "");
  constexpr size_t before = 10;
  text.resize((before + text.size() + 1 + 63) / 64 * 64 - before - 1, ' ');
  text += '\n';
  std::string head(magic);
  head += {'\1', '\0', static_cast<char>(text.size() & 0xff), static_cast<char>(text.size() >> 8)};
  VOX_CHECK(file->write(head + text));
  return std::make_unique<DenseSink>(std::move(file), info, layout);
}

}  // namespace voxkit
