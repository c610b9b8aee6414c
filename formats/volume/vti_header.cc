// The elements of VTK's XML files, https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>

#include "formats/volume/facts.h"
#include "formats/volume/vti.h"
#include "formats/volume/words.h"

namespace voxkit::vti {
namespace {

constexpr size_t most_elements = 10000, most_tag = size_t{1} << 16;

struct TypeName {
  std::string_view name;
  SampleType type;
};
constexpr TypeName type_names[] = {
    {"UInt8", SampleType::u8},    {"Int8", SampleType::i8},    {"UInt16", SampleType::u16},
    {"Int16", SampleType::i16},   {"UInt32", SampleType::u32}, {"Int32", SampleType::i32},
    {"UInt64", SampleType::u64},  {"Int64", SampleType::i64},  {"Float32", SampleType::f32},
    {"Float64", SampleType::f64},
};

/// `<name attribute="value" …>`, `</name>` or `<name …/>`.
struct Tag {
  std::string name;
  std::map<std::string, std::string> attributes;
  bool closes = false, empty = false;
  size_t end = 0;  ///< behind the '>'

  /// Empty where there is none.
  std::string operator[](const std::string& attribute) const {
    const auto it = attributes.find(attribute);
    return it == attributes.end() ? std::string() : it->second;
  }
};

class Parser {
 public:
  explicit Parser(const MappedFile& file)
      : text_(reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size()) {
    document_.name = file.name();
  }

  Result<Document> read() {
    for (size_t at = 0, count = 0; !document_.appended; ++count) {
      at = text_.find('<', at);
      if (at == text_.npos) break;
      if (count == most_elements) return wrong(at, fmt::format("at most {} elements", most_elements));
      if (text_.substr(at, 4) == "<!--") {
        at = std::min(text_.size(), text_.find("-->", at));
        continue;
      }
      if (text_.substr(at, 2) == "<?" || text_.substr(at, 2) == "<!") {
        at = std::min(text_.size(), text_.find('>', at));
        continue;
      }
      VOX_TRY(const Tag tag, read_tag(at));
      VOX_CHECK(take(tag, at));
      at = tag.end;
      if (tag.name == "DataArray" && !tag.closes && !tag.empty) {
        at = text_.find('<', at);  // what an array holds is no element
        if (at == text_.npos) return wrong(tag.end, "</DataArray>");
      }
    }
    if (!is_vtk_) return bad_input(document_.name, "not a VTK file: expected an element VTKFile");
    if (!pieces_) return bad_input(document_.name, "XML: expected an element Piece in one ImageData");
    for (const Array& array : document_.arrays)
      if (array.appended && !document_.appended)
        return bad_input(document_.name, "XML: expected an element AppendedData");
    return document_;
  }

 private:
  Result<Tag> read_tag(size_t at) const {
    Tag tag;
    size_t i = at + 1;
    const auto blank = [&] {
      while (i < text_.size() && std::string_view(" \t\r\n").find(text_[i]) != std::string_view::npos) ++i;
    };
    const auto word = [&](std::string_view ends) {
      const size_t first = i;
      i = std::min(text_.size(), text_.find_first_of(ends, i));
      return text_.substr(first, i - first);
    };
    if (i < text_.size() && text_[i] == '/') tag.closes = true, ++i;
    tag.name = word(" \t\r\n/>").substr(0, 40);
    for (;;) {
      blank();
      if (i >= text_.size() || i - at > most_tag) return wrong(at, "an element with an end");
      if (text_[i] == '/') {
        tag.empty = true, ++i;
        continue;
      }
      if (text_[i] == '>') break;
      const std::string name(word(" \t\r\n=/>"));
      blank();
      if (i >= text_.size() || text_[i] != '=') return wrong(at, "attributes NAME=\"VALUE\"");
      ++i;
      blank();
      const char quote = i < text_.size() ? text_[i] : '\0';
      if (quote != '"' && quote != '\'') return wrong(at, "attributes NAME=\"VALUE\"");
      ++i;
      const size_t end = text_.find(quote, i);
      if (end == text_.npos || end - at > most_tag) return wrong(at, "attributes NAME=\"VALUE\"");
      tag.attributes[name] = text_.substr(i, end - i);
      i = end + 1;
    }
    tag.end = i + 1;
    return tag;
  }

  Status take(const Tag& tag, size_t at) {
    if (tag.closes) {
      if (tag.name == "PointData" || tag.name == "CellData") inside_.clear();
      return {};
    }
    if (tag.name == "VTKFile") return take_file(tag, at);
    if (!is_vtk_) return bad_input(document_.name, "not a VTK file: expected an element VTKFile");
    if (tag.name == "ImageData") return take_image(tag, at);
    if (tag.name == "Piece") {
      if (pieces_++) return wrong(at, "one piece of the whole");
      VOX_TRY(const Box piece, extent(tag["Extent"], at));
      if (!(piece == document_.extent)) return wrong(at, "one piece of the WholeExtent");
    }
    if ((tag.name == "PointData" || tag.name == "CellData") && pieces_ && !tag.empty) inside_ = tag.name;
    if (tag.name == "DataArray" && !inside_.empty()) return take_array(tag, at);
    if (tag.name == "AppendedData") {
      const std::string encoding = tag["encoding"];
      if (encoding != "raw" && encoding != "base64") return wrong(at, "encoding=\"raw\" or \"base64\"");
      document_.appended_base64 = encoding == "base64";
      const size_t mark = text_.find_first_not_of(" \t\r\n", tag.end);
      if (mark == text_.npos || text_[mark] != '_') return wrong(tag.end, "_ before the appended data");
      document_.appended = mark + 1;
    }
    return {};
  }

  Status take_file(const Tag& tag, size_t at) {
    if (tag["type"] != "ImageData") return wrong(at, "a VTKFile of type=\"ImageData\"");
    is_vtk_ = true;
    const std::string order = tag["byte_order"], header = tag["header_type"], compressor = tag["compressor"];
    if (!order.empty() && order != "LittleEndian" && order != "BigEndian")
      return wrong(at, "byte_order=\"LittleEndian\" or \"BigEndian\"");
    document_.big_endian = order == "BigEndian";
    if (!header.empty() && header != "UInt32" && header != "UInt64")
      return wrong(at, "header_type=\"UInt32\" or \"UInt64\"");
    document_.length_bytes = header == "UInt64" ? 8 : 4;
    document_.packing = compressor == "vtkZLibDataCompressor"  ? Packing::zlib
                        : compressor == "vtkLZ4DataCompressor" ? Packing::lz4
                                                               : Packing::none;
    if (!compressor.empty() && document_.packing == Packing::none)
      return bad_input(document_.name, fmt::format("data compressed by \"{}\" are unsupported: expected "
                                                   "vtkZLibDataCompressor or vtkLZ4DataCompressor",
                                                   text_field(compressor.substr(0, 40))));
    return {};
  }

  Status take_image(const Tag& tag, size_t at) {
    VOX_TRY(document_.extent, extent(tag["WholeExtent"], at));
    std::array<double, 3> origin{0, 0, 0}, spacing{1, 1, 1};
    std::array<double, 9> direction{1, 0, 0, 0, 1, 0, 0, 0, 1};
    const auto read = [&](const std::string& name, auto& out) {
      const std::string text = tag[name];
      const auto tokens = words(text);
      if (tokens.empty()) return true;
      if (tokens.size() != out.size()) return false;
      for (size_t i = 0; i < out.size(); ++i) {
        const auto value = number<double>(tokens[i]);
        if (!value) return false;
        out[i] = *value;
      }
      return true;
    };
    if (!read("Origin", origin) || !read("Spacing", spacing))
      return wrong(at, "Origin and Spacing of three numbers");
    if (!read("Direction", direction)) return wrong(at, "Direction of nine numbers");
    for (size_t k = 0; k < 3; ++k)
      for (size_t row = 0; row < 3; ++row)
        document_.affine.axes[k][row] = direction[3 * row + k] * spacing[k] + 0.0;
    document_.affine.origin = origin;
    if (!document_.affine.is_valid())
      return wrong(at, "Spacing that is not zero, and axes that do not lie in one plane");
    const Index3 lo = document_.extent.lo;
    document_.affine = document_.affine.moved_to(
        {static_cast<double>(lo.x), static_cast<double>(lo.y), static_cast<double>(lo.z)});
    return {};
  }

  Status take_array(const Tag& tag, size_t at) {
    Array array;
    array.name = tag["Name"];
    array.type_name = tag["type"];
    for (const TypeName& t : type_names)
      if (t.name == array.type_name) array.type = t.type;
    array.cells = inside_ == "CellData";
    if (const std::string count = tag["NumberOfComponents"]; !count.empty()) {
      array.components = number<int64_t>(trim(count)).value_or(0);
      if (array.components < 1 || array.components > 65536)
        return wrong(at, "NumberOfComponents of 1 to 65536");
    }
    const std::string format = tag["format"];
    if (format != "ascii" && format != "binary" && format != "appended")
      return wrong(at, "format=\"ascii\", \"binary\" or \"appended\"");
    array.coding = format == "ascii" ? Coding::text : Coding::base64;
    array.appended = format == "appended";
    array.at = tag.end;
    if (array.appended) {
      const auto offset = number<uint64_t>(trim(tag["offset"]));
      if (!offset) return wrong(at, "an offset");
      array.at = *offset;
    } else if (tag.empty) {
      return wrong(at, "data in the element");
    }
    document_.arrays.push_back(array);
    return {};
  }

  Result<Box> extent(const std::string& text, size_t at) const {
    const auto tokens = words(text);
    std::array<int64_t, 6> ends{};
    bool whole = tokens.size() == ends.size();
    for (size_t i = 0; whole && i < ends.size(); ++i) {
      const auto value = number<int32_t>(tokens[i]);
      whole = value.has_value();
      if (whole) ends[i] = *value;
    }
    if (!whole || ends[1] < ends[0] || ends[3] < ends[2] || ends[5] < ends[4])
      return wrong(at, "an extent of six whole numbers, FIRST LAST along each axis");
    return Box{{ends[0], ends[2], ends[4]}, {ends[1] + 1, ends[3] + 1, ends[5] + 1}};
  }
  tl::unexpected<Error> wrong(size_t at, const std::string& expected) const {
    return bad_input(document_.name, fmt::format("XML element at byte {}: expected {}", at, expected));
  }

  std::string_view text_;
  Document document_;
  bool is_vtk_ = false;
  int pieces_ = 0;
  std::string inside_;  ///< "PointData", "CellData" or nothing
};

}  // namespace

Result<Document> read_document(const MappedFile& file) {
  return Parser(file).read();
}

}  // namespace voxkit::vti
