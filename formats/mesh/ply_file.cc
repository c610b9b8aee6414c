#include "formats/mesh/ply_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <optional>
#include <utility>

#include "formats/mesh/voxel_grid.h"

namespace voxkit::ply {
namespace {

std::optional<Type> type_of(std::string_view name) {
  constexpr std::pair<std::string_view, Type> names[] = {
      {"char", Type::i8},   {"int8", Type::i8},     {"uchar", Type::u8},   {"uint8", Type::u8},
      {"short", Type::i16}, {"int16", Type::i16},   {"ushort", Type::u16}, {"uint16", Type::u16},
      {"int", Type::i32},   {"int32", Type::i32},   {"uint", Type::u32},   {"uint32", Type::u32},
      {"float", Type::f32}, {"float32", Type::f32}, {"double", Type::f64}, {"float64", Type::f64}};
  for (const auto& [text, type] : names)
    if (name == text) return type;
  return std::nullopt;
}

Role role_of(std::string_view element, std::string_view property, bool list) {
  using enum Role;
  constexpr std::pair<std::string_view, Role> of_vertices[] = {{"x", x},
                                                               {"y", y},
                                                               {"z", z},
                                                               {"red", red},
                                                               {"green", green},
                                                               {"blue", blue},
                                                               {"alpha", alpha},
                                                               {"r", red},
                                                               {"g", green},
                                                               {"b", blue},
                                                               {"a", alpha},
                                                               {"s", u},
                                                               {"t", v},
                                                               {"u", u},
                                                               {"v", v},
                                                               {"texture_u", u},
                                                               {"texture_v", v},
                                                               {"diffuse_red", red},
                                                               {"diffuse_green", green},
                                                               {"diffuse_blue", blue},
                                                               {"diffuse_alpha", alpha},
                                                               {"nx", nx},
                                                               {"ny", ny},
                                                               {"nz", nz},
                                                               {"normal_x", nx},
                                                               {"normal_y", ny},
                                                               {"normal_z", nz},
                                                               {"roughness", roughness},
                                                               {"metallic", metalness},
                                                               {"metalness", metalness},
                                                               {"metallicness", metalness},
                                                               {"emissive_red", emissive_red},
                                                               {"emissive_green", emissive_green},
                                                               {"emissive_blue", emissive_blue},
                                                               {"label", label},
                                                               {"class", label},
                                                               {"classification", label},
                                                               {"scalar_Label", label},
                                                               {"scalar_Classification", label},
                                                               {"intensity", intensity},
                                                               {"scalar_Intensity", intensity},
                                                               {"scalar_intensity", intensity}};
  constexpr std::pair<std::string_view, Role> of_faces[] = {
      {"vertex_indices", corners}, {"vertex_index", corners}, {"texcoord", texcoords}};
  const bool strips = element == "tristrips";
  if (element == "vertex" && !list)
    for (const auto& [name, role] : of_vertices)
      if (property == name) return role;
  if ((element == "face" || strips) && list)
    for (const auto& [name, role] : of_faces)
      if (property == name && (role == corners || !strips)) return role;
  if (element == "face" && !list) {
    if (property == "texnumber") return picture;
    for (const auto& [name, role] : of_vertices)
      if (property == name && role >= red && role <= alpha) return role;
  }
  return none;
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (size_t at = 0; (at = line.find_first_not_of(" \t\r", at)) != line.npos;) {
    const size_t end = std::min(line.find_first_of(" \t\r", at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

}  // namespace

size_t bytes_of(Type type) {
  constexpr std::array<size_t, 8> bytes{1, 1, 2, 2, 4, 4, 4, 8};
  return bytes[static_cast<size_t>(type)];
}

double load(const std::byte* bytes, Type type, bool big_endian) {
  const size_t size = bytes_of(type);
  std::array<std::byte, 8> raw{};
  for (size_t i = 0; i < size; ++i) raw[i] = bytes[big_endian ? size - 1 - i : i];
  const auto as = [&]<class T>(T value) {
    std::memcpy(&value, raw.data(), sizeof value);
    return static_cast<double>(value);
  };
  switch (type) {
    case Type::i8:
      return as(int8_t{});
    case Type::u8:
      return as(uint8_t{});
    case Type::i16:
      return as(int16_t{});
    case Type::u16:
      return as(uint16_t{});
    case Type::i32:
      return as(int32_t{});
    case Type::u32:
      return as(uint32_t{});
    case Type::f32:
      return as(float{});
    case Type::f64:
      break;
  }
  return as(double{});
}

double scale_of(Type type) {
  return type == Type::f32 || type == Type::f64 ? 1 : type == Type::u16 ? 1.0 / 65535 : 1.0 / 255;
}

Result<Header> read_header(std::span<const std::byte> bytes, const std::string& path) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  Header header;
  if (!text.starts_with("ply\n") && !text.starts_with("ply\r"))
    return bad_input(path, "not a PLY file: expected ply at byte 0");
  bool has_format = false;
  for (size_t at = 0;;) {
    const size_t end = text.find('\n', at);
    if (end == text.npos) return bad_input(path, "PLY file ends within its header: expected end_header");
    const std::string_view line = text.substr(at, end - at);
    const auto broken = [&](const char* why) {
      return bad_input(path, fmt::format("corrupt PLY file: header at byte {}: {}", at, why));
    };
    const auto words = words_of(line);
    at = end + 1;
    if (words.empty() || words[0] == "ply" || words[0] == "obj_info") continue;
    if (words[0] == "comment") {
      if (words.size() > 2 && words[1] == "TextureFile")
        header.pictures.emplace_back(words[2].data(), words.back().data() + words.back().size());
      if (words.size() > 2 && words[1] == voxel_grid_name)
        header.grid = parse_voxel_grid({words[2].data(), words.back().data() + words.back().size()});
    } else if (words[0] == "end_header") {
      header.end = at;
      if (!has_format) return broken("no format is named");
      return header;
    } else if (words[0] == "format" && words.size() == 3) {
      has_format = true;
      header.ascii = words[1] == "ascii";
      header.big_endian = words[1] == "binary_big_endian";
      if (!header.ascii && !header.big_endian && words[1] != "binary_little_endian")
        return broken("expected the format ascii, binary_little_endian or binary_big_endian");
    } else if (words[0] == "element" && words.size() == 3) {
      Element element{std::string(words[1]), 0, {}};
      const auto [last, error] =
          std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
      if (error != std::errc{} || last != words[2].data() + words[2].size())
        return broken("expected the number of elements");
      header.elements.push_back(std::move(element));
    } else if (words[0] == "property" && !header.elements.empty() &&
               (words.size() == 3 || words.size() == 5)) {
      Property property;
      property.list = words.size() == 5;
      const auto type = type_of(words[property.list ? 3 : 1]);
      const auto count_type = property.list ? type_of(words[2]) : Type::u8;
      if (!type || !count_type || (property.list && words[1] != "list"))
        return broken("expected the type of a property");
      property.type = *type;
      property.count_type = *count_type;
      property.name = words.back();
      Element& element = header.elements.back();
      property.role = role_of(element.name, words.back(), property.list);
      // Of several labels the first one counts.
      if (property.role == Role::label && element.has(Role::label)) property.role = Role::none;
      element.properties.push_back(std::move(property));
    } else {
      return broken("expected format, comment, element, property or end_header");
    }
  }
}

void Header::drop(Role first, Role last) {
  for (Element& element : elements)
    for (Property& property : element.properties)
      if (property.role >= first && property.role <= last) property.role = Role::none;
}

std::vector<std::string> Header::notes() const {
  constexpr size_t most = 16;
  std::vector<std::string> dropped;
  for (const Element& element : elements)
    for (const Property& property : element.properties)
      if (property.role == Role::none)
        dropped.push_back(fmt::format("{} of {}", property.name, element.name));
  if (dropped.empty()) return {};
  const std::span<const std::string> first(dropped.data(), std::min(dropped.size(), most));
  return {fmt::format("dropped: {}{}", fmt::join(first, ", "),
                      dropped.size() > most ? fmt::format(" and {} others", dropped.size() - most) : "")};
}

Result<double> Numbers::next_word() {
  const auto* text = reinterpret_cast<const char*>(bytes_.data());
  const auto is_space = [](char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; };
  while (at_ < bytes_.size() && is_space(text[at_])) ++at_;
  if (at_ < bytes_.size() && text[at_] == '+') ++at_;
  double value = 0;
  const auto [end, error] = std::from_chars(text + at_, text + bytes_.size(), value);
  const auto next = static_cast<size_t>(end - text);
  // What is too large or too small for a double is taken as what it is not: an error, as no mesh needs it.
  if (error != std::errc{} || (next < bytes_.size() && !is_space(text[next])))
    return at_end_or("expected a number");
  at_ = next;
  return value;
}
Result<double> Numbers::next_binary(Type type) {
  const size_t size = bytes_of(type);
  if (left() < size) return at_end_or("");
  const std::byte* const at = &bytes_[at_];
  at_ += size;
  return load(at, type, swap_);
}
tl::unexpected<Error> Numbers::at_end_or(const char* why) const {
  if (left() == 0 || !ascii_)
    return bad_input(path_,
                     fmt::format("PLY file ends after {} bytes: expected further elements", bytes_.size()));
  return bad_input(path_, fmt::format("corrupt PLY file: byte {}: {}", at_, why));
}

Status Numbers::check_count(const Element& element) const {
  uint64_t bytes = 0;
  for (const Property& p : element.properties) bytes += least(p.list ? p.count_type : p.type);
  if (element.count > left() / std::max<uint64_t>(bytes, 1))
    return bad_input(path_, fmt::format("corrupt PLY file: {} elements {}: {} bytes are left for them",
                                        element.count, element.name, left()));
  return {};
}

Result<uint64_t> Numbers::list_size(const Property& p) {
  VOX_TRY(const double count, next(p.count_type));
  if (!(count >= 0 && count <= static_cast<double>(left() / least(p.type))))
    return bad_input(path_, fmt::format("corrupt PLY file: byte {}: a list of {}: {} bytes are left for it",
                                        at_, count, left()));
  return static_cast<uint64_t>(count);
}

Status Numbers::pass(const Property& p) {
  uint64_t count = 1;
  if (p.list) {
    VOX_TRY(count, list_size(p));
  }
  for (uint64_t i = 0; i < count; ++i) VOX_CHECK(next(p.type));
  return {};
}

}  // namespace voxkit::ply
