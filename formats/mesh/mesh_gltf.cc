#include "formats/mesh/mesh_gltf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "formats/little_endian.h"
#include "formats/mapped_file.h"
#include "formats/names.h"

namespace voxkit {
namespace {

using Json = nlohmann::json;

/// The text of the file, and the bytes of its own buffer.
struct GltfParts {
  std::string_view json;
  std::optional<uint64_t> own_bytes;
};

/// GLB: a header of 12 bytes; chunks with a length, a type and data.
Result<GltfParts> parts_of(std::span<const std::byte> bytes, const std::string& path) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (!text.starts_with("glTF")) {
    if (has_ending(path, ".glb")) return bad_input(path, "not a GLB file: expected glTF at byte 0");
    return GltfParts{text, std::nullopt};
  }
  GltfParts parts;
  constexpr size_t header = 12, chunk_header = 8;
  if (bytes.size() < header || load_le<uint32_t>(bytes.data() + 4) != 2)
    return bad_input(path, "corrupt GLB file: byte 4: expected version 2");
  if (load_le<uint32_t>(bytes.data() + 8) != bytes.size())
    return bad_input(path, fmt::format("GLB file is {} bytes long: expected {}", bytes.size(),
                                       load_le<uint32_t>(bytes.data() + 8)));
  for (size_t at = header; at < bytes.size();) {
    if (bytes.size() - at < chunk_header ||
        load_le<uint32_t>(bytes.data() + at) > bytes.size() - at - chunk_header)
      return bad_input(
          path, fmt::format("corrupt GLB file: chunk at byte {}: it leads past the end of the file", at));
    const size_t length = load_le<uint32_t>(bytes.data() + at);
    const std::string_view type = text.substr(at + 4, 4);
    if ((at == header) != (type == "JSON"))
      return bad_input(path,
                       fmt::format("corrupt GLB file: chunk at byte {}: expected JSON first, and once", at));
    if (type == "JSON") parts.json = text.substr(at + chunk_header, length);
    if (type == std::string_view("BIN\0", 4) && !parts.own_bytes) parts.own_bytes = length;
    at += chunk_header + length;
  }
  return parts;
}

uint64_t component_bytes(uint64_t type) {
  return type == 5120 || type == 5121   ? 1
         : type == 5122 || type == 5123 ? 2
         : type == 5125 || type == 5126 ? 4
                                        : 0;
}
uint64_t components(std::string_view type) {
  return type == "SCALAR"                   ? 1
         : type == "VEC2"                   ? 2
         : type == "VEC3"                   ? 3
         : type == "VEC4" || type == "MAT2" ? 4
         : type == "MAT3"                   ? 9
         : type == "MAT4"                   ? 16
                                            : 0;
}

class GltfCheck {
 public:
  GltfCheck(const Json& file, std::optional<uint64_t> own_bytes, const std::string& path, const Context& ctx)
      : file_(file), own_bytes_(own_bytes), path_(path), ctx_(ctx) {}

  Result<std::vector<UvTransform>> run() {
    if (!file_.is_object()) return bad("the file", 0, "expected an object");
    VOX_CHECK(check_buffers());
    VOX_CHECK(check_views());
    VOX_CHECK(check_accessors());
    VOX_CHECK(check_nodes());
    return transforms();
  }

 private:
  tl::unexpected<Error> bad(const char* what, size_t index, const char* rule) const {
    return bad_input(path_, fmt::format("corrupt glTF file: {} {}: {}", what, index, rule));
  }
  /// An array of the file; empty where there is none.
  const Json& list(const char* name) const {
    static const Json none = Json::array();
    const auto at = file_.find(name);
    return at != file_.end() && at->is_array() ? *at : none;
  }
  /// A whole number of an object, or nothing where it is something else; `otherwise` where it is not said.
  static std::optional<uint64_t> whole(const Json& object, const char* name,
                                       std::optional<uint64_t> otherwise) {
    if (!object.is_object()) return std::nullopt;
    const auto at = object.find(name);
    if (at == object.end()) return otherwise;
    if (!at->is_number_unsigned() || at->get<uint64_t>() > uint64_t{1} << 53) return std::nullopt;
    return at->get<uint64_t>();
  }

  Status check_buffers() {
    size_t index = 0;
    for (const Json& buffer : list("buffers")) {
      const auto length = whole(buffer, "byteLength", std::nullopt);
      if (!length) return bad("buffer", index, "expected a byteLength");
      if (!buffer.contains("uri") && (index > 0 || !own_bytes_ || *length > *own_bytes_))
        return bad("buffer", index, "it is longer than the part of the file that holds it");
      if (*length > ctx_.memory->limit())
        return fail(
            ErrorCode::limit, path_,
            fmt::format("a buffer takes {} bytes: --max-memory allows {}", *length, ctx_.memory->limit()));
      buffers_.push_back(*length);
      ++index;
    }
    return {};
  }

  Status check_views() {
    size_t index = 0;
    for (const Json& view : list("bufferViews")) {
      const auto buffer = whole(view, "buffer", std::nullopt), offset = whole(view, "byteOffset", 0),
                 length = whole(view, "byteLength", std::nullopt), stride = whole(view, "byteStride", 0);
      if (!buffer || *buffer >= buffers_.size())
        return bad("buffer view", index, "expected the number of a buffer");
      if (!offset || !length || !stride || *offset + *length > buffers_[*buffer])
        return bad("buffer view", index, "it leads past the end of its buffer");
      views_.push_back({*length, *stride});
      ++index;
    }
    return {};
  }

  /// `count` elements of `size` bytes from `offset` of a view on.
  Status check_range(size_t index, uint64_t view, uint64_t offset, uint64_t count, uint64_t size) const {
    if (view >= views_.size()) return bad("accessor", index, "expected the number of a buffer view");
    const auto [length, stride] = views_[view];
    const uint64_t step = stride ? stride : size;
    if (step < size || offset > length ||
        (count && (length - offset < size || (count - 1) > (length - offset - size) / step)))
      return bad("accessor", index, "it leads past the end of its buffer view");
    return {};
  }

  Status check_accessors() {
    size_t index = 0;
    uint64_t zeros = 0;
    for (const Json& accessor : list("accessors")) {
      const auto count = whole(accessor, "count", std::nullopt), offset = whole(accessor, "byteOffset", 0),
                 type = whole(accessor, "componentType", std::nullopt);
      const auto shape = accessor.is_object() ? accessor.find("type") : accessor.end();
      const uint64_t size = count && offset && type && shape != accessor.end() && shape->is_string()
                                ? component_bytes(*type) * components(shape->get_ref<const std::string&>())
                                : 0;
      if (size == 0) return bad("accessor", index, "expected count, componentType and type");
      if (accessor.contains("bufferView")) {
        VOX_CHECK(check_range(index, whole(accessor, "bufferView", 0).value_or(views_.size()), *offset,
                              *count, size));
      } else {
        zeros += *count * size;
      }
      if (const auto sparse = accessor.find("sparse"); sparse != accessor.end()) {
        const auto changes = whole(*sparse, "count", std::nullopt);
        if (!changes || *changes > *count || !sparse->contains("indices") || !sparse->contains("values"))
          return bad("accessor", index, "expected a sparse part with count, indices and values");
        for (const char* name : {"indices", "values"}) {
          const Json& part = (*sparse)[name];
          const bool values = name[0] == 'v';
          const uint64_t bytes = values ? size : component_bytes(whole(part, "componentType", 0).value_or(0));
          const auto from = whole(part, "byteOffset", 0);
          if (bytes == 0 || !from)
            return bad("accessor", index, "expected a componentType of its sparse part");
          VOX_CHECK(check_range(index, whole(part, "bufferView", std::nullopt).value_or(views_.size()), *from,
                                *changes, bytes));
        }
        zeros += *count * size;
      }
      if (zeros > ctx_.memory->limit() / 4)
        return fail(ErrorCode::limit, path_,
                    fmt::format("accessors without a buffer take {} bytes: --max-memory allows {} in all",
                                zeros, ctx_.memory->limit()));
      ++index;
    }
    return {};
  }

  /// Each node has one parent at most, and following parents ends.
  Status check_nodes() const {
    const Json& nodes = list("nodes");
    constexpr size_t none = SIZE_MAX;
    std::vector<size_t> parent(nodes.size(), none);
    for (size_t i = 0; i < nodes.size(); ++i) {
      if (!nodes[i].is_object()) return bad("node", i, "expected an object");
      const auto children = nodes[i].find("children");
      if (children == nodes[i].end()) continue;
      if (!children->is_array()) return bad("node", i, "expected a list of children");
      for (const Json& child : *children) {
        if (!child.is_number_unsigned() || child.get<uint64_t>() >= nodes.size())
          return bad("node", i, "expected children that are there");
        size_t& of_child = parent[child.get<uint64_t>()];
        if (of_child != none) return bad("node", i, "expected children that no other node has");
        of_child = i;
      }
    }
    // A walk up from each node, which ends at the top or where one was that is known to end there. assimp
    // goes down with a call a level.
    constexpr uint32_t deepest = 1000;
    std::vector<uint32_t> depth(nodes.size(), 0);
    std::vector<size_t> way;
    for (size_t i = 0; i < nodes.size(); ++i) {
      way.clear();
      size_t at = i;
      for (; at != none && depth[at] == 0; at = parent[at]) {
        way.push_back(at);
        if (way.size() > deepest)
          return bad("node", i, "it is its own parent, or more than 1000 levels deep");
      }
      uint32_t level = at == none ? 0 : depth[at];
      while (!way.empty()) {
        depth[way.back()] = ++level;
        way.pop_back();
      }
      if (level > deepest) return bad("node", i, "it is more than 1000 levels deep");
    }
    return {};
  }

  Result<std::vector<UvTransform>> transforms() const {
    std::vector<UvTransform> out;
    for (const Json& material : list("materials")) {
      UvTransform& transform = out.emplace_back();
      const Json* at = &material;
      for (const char* name :
           {"pbrMetallicRoughness", "baseColorTexture", "extensions", "KHR_texture_transform"}) {
        const auto next = at->is_object() ? at->find(name) : at->end();
        at = at->is_object() && next != at->end() ? &*next : nullptr;
        if (!at) break;
      }
      if (!at || !at->is_object()) continue;
      const auto number = [&](const Json& value, double& to) {
        if (!value.is_number() || !std::isfinite(value.get<double>())) return false;
        to = value.get<double>();
        return true;
      };
      bool sound = true;
      for (const auto& [name, to] :
           {std::pair("offset", &transform.offset), std::pair("scale", &transform.scale)})
        if (const auto pair = at->find(name); pair != at->end())
          sound &= pair->is_array() && pair->size() == 2 && number((*pair)[0], (*to)[0]) &&
                   number((*pair)[1], (*to)[1]);
      if (const auto angle = at->find("rotation"); angle != at->end())
        sound &= number(*angle, transform.rotation);
      if (const auto channel = whole(*at, "texCoord", uint64_t{INT32_MAX}); channel && *channel < INT32_MAX)
        transform.uv_channel = static_cast<int>(*channel);
      if (!sound) return bad("material", out.size() - 1, "expected numbers in its texture transform");
    }
    return out;
  }

  const Json& file_;
  std::optional<uint64_t> own_bytes_;
  const std::string& path_;
  const Context& ctx_;
  std::vector<uint64_t> buffers_;
  std::vector<std::pair<uint64_t, uint64_t>> views_;  ///< length and stride
};

}  // namespace

Result<std::vector<UvTransform>> check_gltf(const std::string& path, const Context& ctx) {
  VOX_TRY(const auto file, MappedFile::open(path));
  VOX_TRY(const GltfParts parts, parts_of(file->bytes(), path));
  const Json json = Json::parse(parts.json.begin(), parts.json.end(), nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) return bad_input(path, "corrupt glTF file: its text is not JSON");
  return GltfCheck(json, parts.own_bytes, path, ctx).run();
}

}  // namespace voxkit
