#include "formats/mesh_ply.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "formats/mapped_file.h"

namespace voxkit {
namespace {

enum class Type : uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };
constexpr std::array<size_t, 8> type_bytes{1, 1, 2, 2, 4, 4, 4, 8};

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

/// What of a mesh a property is.
enum class Role : uint8_t { none, x, y, z, red, green, blue, alpha, u, v, corners, texcoords };

Role role_of(std::string_view element, std::string_view property, bool list) {
  using enum Role;
  constexpr std::pair<std::string_view, Role> of_vertices[] = {{"x", x},
                                                               {"y", y},
                                                               {"z", z},
                                                               {"red", red},
                                                               {"green", green},
                                                               {"blue", blue},
                                                               {"alpha", alpha},
                                                               {"s", u},
                                                               {"t", v},
                                                               {"u", u},
                                                               {"v", v},
                                                               {"texture_u", u},
                                                               {"texture_v", v},
                                                               {"diffuse_red", red},
                                                               {"diffuse_green", green},
                                                               {"diffuse_blue", blue}};
  constexpr std::pair<std::string_view, Role> of_faces[] = {
      {"vertex_indices", corners}, {"vertex_index", corners}, {"texcoord", texcoords}};
  if (element == "vertex" && !list)
    for (const auto& [name, role] : of_vertices)
      if (property == name) return role;
  if (element == "face" && list)
    for (const auto& [name, role] : of_faces)
      if (property == name) return role;
  return none;
}

struct Property {
  Type type = Type::f32, count_type = Type::u8;
  bool list = false;
  Role role = Role::none;
};
struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
  bool has(Role role) const {
    for (const Property& p : properties)
      if (p.role == role) return true;
    return false;
  }
};
struct Header {
  bool ascii = false, big_endian = false;
  std::vector<Element> elements;
  std::string texture;
  size_t end = 0;  ///< where the data begins
};

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (size_t at = 0; (at = line.find_first_not_of(" \t\r", at)) != line.npos;) {
    const size_t end = std::min(line.find_first_of(" \t\r", at), line.size());
    words.push_back(line.substr(at, end - at));
    at = end;
  }
  return words;
}

Result<Header> read_header(std::string_view text, const std::string& path) {
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
        header.texture = std::string(words[2].data(), words.back().data() + words.back().size());
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
      property.role = role_of(header.elements.back().name, words.back(), property.list);
      header.elements.back().properties.push_back(property);
    } else {
      return broken("expected format, comment, element, property or end_header");
    }
  }
}

/// The numbers of a file, one after the other.
class Numbers {
 public:
  Numbers(std::span<const std::byte> bytes, const Header& header, const std::string& path)
      : bytes_(bytes), at_(header.end), ascii_(header.ascii), swap_(header.big_endian), path_(path) {}

  size_t left() const { return bytes_.size() - at_; }
  /// Least bytes of a number of a type.
  size_t least(Type type) const { return ascii_ ? 1 : type_bytes[static_cast<size_t>(type)]; }
  size_t at() const { return at_; }

  Result<double> next(Type type) { return ascii_ ? next_word() : next_binary(type); }

 private:
  Result<double> next_word() {
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
  Result<double> next_binary(Type type) {
    const size_t size = type_bytes[static_cast<size_t>(type)];
    if (left() < size) return at_end_or("");
    std::array<std::byte, 8> raw{};
    for (size_t i = 0; i < size; ++i) raw[i] = bytes_[at_ + (swap_ ? size - 1 - i : i)];
    at_ += size;
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
  tl::unexpected<Error> at_end_or(const char* why) const {
    if (left() == 0 || !ascii_)
      return bad_input(path_,
                       fmt::format("PLY file ends after {} bytes: expected further elements", bytes_.size()));
    return bad_input(path_, fmt::format("corrupt PLY file: byte {}: {}", at_, why));
  }

  std::span<const std::byte> bytes_;
  size_t at_;
  bool ascii_, swap_;
  const std::string& path_;
};

double scale_of(Type type) {
  return type == Type::u8 ? 1.0 / 255 : type == Type::u16 ? 1.0 / 65535 : 1;
}

float light_of(double stored) {
  return static_cast<float>(stored <= 0.04045 ? stored / 12.92 : std::pow((stored + 0.055) / 1.055, 2.4));
}

class PlyReader {
 public:
  PlyReader(const Header& header, std::span<const std::byte> bytes, const std::string& path, Context& ctx)
      : header_(header), numbers_(bytes, header, path), path_(path), ctx_(ctx) {}

  Result<MeshParts> read() {
    for (const Element& element : header_.elements) {
      VOX_CHECK(check_count(element));
      if (element.name == "vertex") {
        VOX_CHECK(read_vertices(element));
      } else if (element.name == "face" && element.has(Role::corners)) {
        VOX_CHECK(read_faces(element));
      } else {
        VOX_CHECK(pass_over(element));
      }
    }
    Mesh& mesh = parts_.mesh;
    mesh.materials.resize(1);
    parts_.maps.resize(1);
    parts_.maps[0].color.name = mesh.uvs.empty() ? std::string() : header_.texture;
    return std::move(parts_);
  }

 private:
  /// That many elements fit into what is left of the file.
  Status check_count(const Element& element) const {
    uint64_t least = 0;
    for (const Property& p : element.properties) least += numbers_.least(p.list ? p.count_type : p.type);
    if (element.count > numbers_.left() / std::max<uint64_t>(least, 1))
      return bad_input(path_, fmt::format("corrupt PLY file: {} elements {}: {} bytes are left for them",
                                          element.count, element.name, numbers_.left()));
    return {};
  }
  Status hold(uint64_t bytes) {
    VOX_TRY(Reservation more, Reservation::take(bytes, "the mesh", ctx_));
    parts_.mesh.memory.push_back(std::move(more));
    return {};
  }
  Result<uint64_t> list_size(const Property& p) {
    VOX_TRY(const double count, numbers_.next(p.count_type));
    if (!(count >= 0 && count <= static_cast<double>(numbers_.left() / numbers_.least(p.type))))
      return bad_input(path_, fmt::format("corrupt PLY file: byte {}: a list of {}: {} bytes are left for it",
                                          numbers_.at(), count, numbers_.left()));
    return static_cast<uint64_t>(count);
  }
  Status pass(const Property& p) {
    uint64_t count = 1;
    if (p.list) {
      VOX_TRY(count, list_size(p));
    }
    for (uint64_t i = 0; i < count; ++i) VOX_CHECK(numbers_.next(p.type));
    return {};
  }
  Status pass_over(const Element& element) {
    for (uint64_t i = 0; i < element.count && !element.properties.empty(); ++i)
      for (const Property& p : element.properties) VOX_CHECK(pass(p));
    return {};
  }

  Status read_vertices(const Element& element) {
    Mesh& mesh = parts_.mesh;
    const bool colors = element.has(Role::red), uvs = element.has(Role::u) && element.has(Role::v);
    if (!mesh.positions.empty() || !element.has(Role::x) || !element.has(Role::y) || !element.has(Role::z))
      return bad_input(path_, "corrupt PLY file: expected one list of vertices with x, y and z");
    if (element.count > UINT32_MAX)
      return bad_input(path_, fmt::format("a mesh of {} vertices: expected less than 2^32", element.count));
    VOX_CHECK(
        hold(element.count * (sizeof(glm::dvec3) + uvs * sizeof(glm::vec2) + colors * sizeof(glm::vec4))));
    mesh.positions.resize(element.count);
    if (colors) mesh.colors.resize(element.count, glm::vec4(0, 0, 0, 1));
    if (uvs) mesh.uvs.resize(element.count);
    for (uint64_t i = 0; i < element.count; ++i)
      for (const Property& p : element.properties) {
        if (p.role == Role::none) {
          VOX_CHECK(pass(p));
          continue;
        }
        VOX_TRY(const double value, numbers_.next(p.type));
        const int offset = static_cast<int>(p.role);
        if (p.role <= Role::z)
          mesh.positions[i][offset - static_cast<int>(Role::x)] = value;
        else if (p.role == Role::alpha && colors)
          mesh.colors[i].a = static_cast<float>(value * scale_of(p.type));
        else if (p.role < Role::alpha && colors)
          mesh.colors[i][offset - static_cast<int>(Role::red)] = light_of(value * scale_of(p.type));
        else if (p.role == Role::u && uvs)
          mesh.uvs[i].x = static_cast<float>(value);
        else if (p.role == Role::v && uvs)
          mesh.uvs[i].y = static_cast<float>(1 - value);
      }
    return {};
  }

  Status read_faces(const Element& element) {
    std::vector<uint32_t> corners;
    std::vector<glm::vec2> texcoords;
    for (uint64_t i = 0; i < element.count; ++i) {
      corners.clear();
      texcoords.clear();
      for (const Property& p : element.properties) {
        if (p.role != Role::corners && p.role != Role::texcoords) {
          VOX_CHECK(pass(p));
          continue;
        }
        VOX_TRY(const uint64_t count, list_size(p));
        for (uint64_t j = 0; j < count; ++j) {
          VOX_TRY(const double value, numbers_.next(p.type));
          if (p.role == Role::corners) {
            // check_mesh says what is wrong with an index that is none.
            corners.push_back(value >= 0 && value < UINT32_MAX ? static_cast<uint32_t>(value) : UINT32_MAX);
          } else if (j % 2 == 0) {
            texcoords.push_back({static_cast<float>(value), 1});
          } else {
            texcoords.back().y = static_cast<float>(1 - value);
          }
        }
      }
      VOX_CHECK(add_face(corners, texcoords));
    }
    return {};
  }

  /// A fan. A face with texture coordinates of its own has vertices of its own.
  Status add_face(std::vector<uint32_t>& corners, const std::vector<glm::vec2>& texcoords) {
    Mesh& mesh = parts_.mesh;
    if (corners.size() < 3) return {};
    const bool own = texcoords.size() == corners.size();
    VOX_CHECK(make_room(corners.size(), own));
    if (own) {
      mesh.uvs.resize(mesh.positions.size());
      for (size_t j = 0; j < corners.size(); ++j) {
        if (corners[j] >= mesh.positions.size() || mesh.positions.size() >= UINT32_MAX)
          return bad_input(path_, fmt::format("corrupt mesh: vertex {}: expected one below {}", corners[j],
                                              mesh.positions.size()));
        mesh.positions.push_back(mesh.positions[corners[j]]);
        if (!mesh.colors.empty()) mesh.colors.push_back(mesh.colors[corners[j]]);
        mesh.uvs.push_back(texcoords[j]);
        corners[j] = static_cast<uint32_t>(mesh.positions.size() - 1);
      }
    }
    for (size_t j = 2; j < corners.size(); ++j)
      mesh.triangles.push_back({{corners[0], corners[j - 1], corners[j]}, 0});
    return {};
  }
  /// Lists double in size: memory is counted before they do.
  Status make_room(size_t corners, bool own) {
    Mesh& mesh = parts_.mesh;
    if (mesh.triangles.size() + corners > mesh.triangles.capacity()) {
      const size_t room = 2 * mesh.triangles.capacity() + corners + 1024;
      VOX_CHECK(hold((room - mesh.triangles.capacity()) * sizeof(MeshTriangle)));
      mesh.triangles.reserve(room);
    }
    if (own && mesh.positions.size() + corners > std::min(mesh.positions.capacity(), mesh.uvs.capacity())) {
      const size_t room = 2 * mesh.positions.size() + corners + 1024;
      VOX_CHECK(hold((room - mesh.positions.size()) *
                     (sizeof(glm::dvec3) + sizeof(glm::vec2) + !mesh.colors.empty() * sizeof(glm::vec4))));
      mesh.positions.reserve(room);
      mesh.uvs.reserve(room);
      if (!mesh.colors.empty()) mesh.colors.reserve(room);
    }
    return {};
  }

  const Header& header_;
  Numbers numbers_;
  const std::string& path_;
  Context& ctx_;
  MeshParts parts_;
};

}  // namespace

Result<MeshParts> read_ply(const std::string& path, Context& ctx) {
  VOX_TRY(const auto file, MappedFile::open(path));
  const auto bytes = file->bytes();
  VOX_TRY(const Header header,
          read_header({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path));
  return PlyReader(header, bytes, path, ctx).read();
}

}  // namespace voxkit
