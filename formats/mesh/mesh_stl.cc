#include "formats/mesh/mesh_stl.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "formats/lab.h"
#include "formats/little_endian.h"
#include "formats/mapped_file.h"
#include "formats/mesh/mesh_builder.h"
#include "formats/mesh/text_statements.h"

namespace voxkit {
namespace {

constexpr size_t head_bytes = 84, triangle_bytes = 50;

std::string_view text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

bool is_space(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == '\v' || c == '\f';
}

/// Whether a word is `lower` in letters of any case.
bool is_word(std::string_view word, std::string_view lower) {
  return std::equal(word.begin(), word.end(), lower.begin(), lower.end(),
                    [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; });
}

/// solid, facet normal, outer loop, three times vertex, endloop, endfacet; endsolid.
class AsciiStl {
 public:
  AsciiStl(std::string_view text, const std::string& path, Context& ctx)
      : text_(text), path_(path), builder_(path, ctx) {}

  Result<MeshParts> read() {
    const uint32_t material = builder_.add_material({});
    bool open = false;
    for (std::string_view word; !(word = next()).empty();) {
      if (is_word(word, open ? "endsolid" : "solid")) {
        open = !open;
        skip_line();  // its name
      } else if (open && is_word(word, "facet")) {
        VOX_CHECK(read_facet(material));
      } else {
        return bad(word, open ? "facet or endsolid" : "solid");
      }
    }
    if (open) return bad("", "endsolid");
    return std::move(builder_).finish();
  }

 private:
  tl::unexpected<Error> bad(std::string_view word, const char* expected) const {
    return bad_input(path_, word.empty()
                                ? fmt::format("STL file ends at line {}: expected {}", line_, expected)
                                : fmt::format("corrupt STL file: line {}: {}: expected {}", line_,
                                              word.substr(0, 40), expected));
  }
  /// Empty at the end.
  std::string_view next() {
    for (; at_ < text_.size() && is_space(text_[at_]); ++at_) line_ += text_[at_] == '\n';
    const size_t begin = at_;
    while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
    return text_.substr(begin, at_ - begin);
  }
  void skip_line() { at_ = std::min(text_.find('\n', at_), text_.size()); }

  Status expect(const char* keyword) {
    const std::string_view word = next();
    return is_word(word, keyword) ? Status() : bad(word, keyword);
  }
  Result<glm::dvec3> read_place() {
    glm::dvec3 place(0);
    for (int a = 0; a < 3; ++a) {
      const std::string_view word = next();
      const auto value = number_of(word);
      if (!value) return bad(word, "a number");
      place[a] = *value;
    }
    return place;
  }
  Status read_facet(uint32_t material) {
    VOX_CHECK(expect("normal"));
    VOX_CHECK(read_place());
    VOX_CHECK(expect("outer"));
    VOX_CHECK(expect("loop"));
    uint32_t corners[3];
    for (uint32_t& corner : corners) {
      VOX_CHECK(expect("vertex"));
      MeshVertex vertex;
      VOX_TRY(vertex.position, read_place());
      VOX_TRY(corner, builder_.add_vertex(vertex));
    }
    VOX_CHECK(expect("endloop"));
    VOX_CHECK(expect("endfacet"));
    return builder_.add_triangle(corners[0], corners[1], corners[2], material);
  }

  std::string_view text_;
  const std::string& path_;
  MeshBuilder builder_;
  size_t at_ = 0, line_ = 1;
};

class BinaryStl {
 public:
  BinaryStl(std::span<const std::byte> bytes, const std::string& path, Context& ctx)
      : bytes_(bytes), path_(path), builder_(path, ctx) {}

  Result<MeshParts> read() {
    const uint64_t count = load_le<uint32_t>(&bytes_[80]),
                   room = (bytes_.size() - head_bytes) / triangle_bytes;
    if (count > room)
      return bad_input(path_, fmt::format("STL file ends after {} bytes: it holds {} of {} triangles",
                                          bytes_.size(), room, count));
    read_head(count);
    VOX_CHECK(builder_.make_room(3 * count, count, 0));
    for (uint64_t i = 0; i < count; ++i) {
      const std::byte* const at = &bytes_[head_bytes + i * triangle_bytes];
      uint32_t corners[3];
      for (size_t c = 0; c < 3; ++c) {
        MeshVertex vertex;
        for (int a = 0; a < 3; ++a)
          vertex.position[a] = load_le<float>(at + 12 * (c + 1) + 4 * static_cast<size_t>(a));
        VOX_TRY(corners[c], builder_.add_vertex(vertex));
      }
      VOX_CHECK(builder_.add_triangle(corners[0], corners[1], corners[2], material_of(attribute_of(i))));
    }
    add_notes(count, bytes_.size() - head_bytes - count * triangle_bytes);
    return std::move(builder_).finish();
  }

 private:
  static constexpr uint32_t none = UINT32_MAX;

  /// COLOR= and four bytes: red, green, blue and alpha.
  void read_head(uint64_t count) {
    const std::string_view head = text_of(bytes_.first(80));
    const size_t at = head.find("COLOR=");
    magics_ = at <= 80 - 10;
    if (!magics_) return;
    for (int c = 0; c < 4; ++c) {
      const double stored = std::to_integer<int>(bytes_[at + 6 + static_cast<size_t>(c)]) / 255.0;
      common_[c] = static_cast<float>(c < 3 ? srgb_to_linear(stored) : stored);
    }
    has_reflection_ = head.find("MATERIAL=") != head.npos;
    // Some programs write such a header, and mark colours as others do: then bit 15 would say of all
    // triangles that they have none, and yet there are some.
    bool all = true, some = false;
    for (uint64_t i = 0; i < count && all; ++i) {
      const uint16_t attribute = attribute_of(i);
      all = (attribute & 0x8000) != 0;
      some |= !is_filling(attribute);
    }
    marks_ = all && some;
  }

  uint16_t attribute_of(uint64_t triangle) const {
    return load_le<uint16_t>(&bytes_[head_bytes + triangle * triangle_bytes + 48]);
  }
  /// Black and white are what programs write where there is no colour.
  static bool is_filling(uint16_t attribute) {
    return (attribute & 0x7fff) == 0 || (attribute & 0x7fff) == 0x7fff;
  }

  uint32_t material_of(uint16_t attribute) {
    const auto bits = static_cast<uint16_t>(attribute & 0x7fff);
    const bool colored = ((attribute & 0x8000) != 0) == marks_;
    colored_ += colored;
    odd_ += !colored && !is_filling(attribute);
    if (colored && material_of_.empty()) material_of_.resize(1 << 15, none);
    uint32_t& known = colored ? material_of_[bits] : without_;
    if (known != none) return known;
    MeshMaterial material;
    if (!colored) {
      material.color = common_;
      if (common_.a < 1) material.alpha_mode = AlphaMode::blend;
    } else {
      // Red is the lowest of three with Magics, and else the highest.
      for (int c = 0; c < 3; ++c)
        material.color[c] =
            static_cast<float>(srgb_to_linear((bits >> (5 * (magics_ ? c : 2 - c)) & 31) / 31.0));
    }
    return known = builder_.add_material(std::move(material));
  }

  void add_notes(uint64_t count, uint64_t behind) {
    if (odd_ > 0)
      builder_.note(fmt::format("dropped: attributes of {} of {} triangles: {}", odd_, count,
                                magics_ ? "the header says COLOR=, by which they are no colors of their own"
                                        : "they are not marked as colors"));
    if (magics_ && marks_)
      builder_.note(
          "all triangles are marked as having no color of their own, and have some: these are taken");
    if (!magics_ && colored_ > 0 && colored_ < count)
      builder_.note(fmt::format("{} of {} triangles have no color: they are white", count - colored_, count));
    if (has_reflection_) builder_.note("dropped: MATERIAL= of the header");
    if (behind > 0) builder_.note(fmt::format("dropped: {} bytes behind the triangles", behind));
  }

  std::span<const std::byte> bytes_;
  const std::string& path_;
  MeshBuilder builder_;
  bool marks_ = true;    ///< whether bit 15 is that of triangles with a colour, or of those without
  bool magics_ = false;  ///< whose colours they are
  glm::vec4 common_{1};  ///< the colour of triangles without their own
  bool has_reflection_ = false;
  std::vector<uint32_t> material_of_;  ///< of colours
  uint32_t without_ = none;            ///< of triangles without
  uint64_t colored_ = 0, odd_ = 0;     ///< triangles with a colour, and with something else
};

}  // namespace

Result<MeshParts> read_stl(const std::string& path, Context& ctx) {
  VOX_TRY(const auto file, MappedFile::open(path));
  const auto bytes = file->bytes();
  const uint64_t told =
      bytes.size() < head_bytes ? 0 : head_bytes + uint64_t{load_le<uint32_t>(&bytes[80])} * triangle_bytes;
  const std::string_view text = text_of(bytes);
  const size_t word = std::min(text.find_first_not_of(" \t\r\n"), text.size());
  // A binary file may begin so, too; text has no zeros.
  const bool is_text = told != bytes.size() && is_word(text.substr(word, 5), "solid") &&
                       text.substr(0, 512).find('\0') == text.npos;
  if (is_text) return AsciiStl(text, path, ctx).read();
  if (bytes.size() < head_bytes)
    return bad_input(path,
                     fmt::format("STL file ends after {} bytes: expected solid, or a header of {} bytes",
                                 bytes.size(), head_bytes));
  return BinaryStl(bytes, path, ctx).read();
}

}  // namespace voxkit
