#include "formats/mesh/gltf_document.h"

#include <algorithm>
#include <set>

#include "formats/mesh/gltf_json.h"
#include "formats/mesh/voxel_grid.h"

namespace voxkit::gltf {
namespace {

constexpr const char* known_extensions[] = {
    "EXT_mesh_gpu_instancing",    "EXT_meshopt_compression",         "EXT_texture_webp",
    "KHR_draco_mesh_compression", "KHR_materials_emissive_strength", "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",        "KHR_mesh_quantization",           "KHR_texture_transform"};
bool is_known(const std::string& extension) {
  return std::any_of(std::begin(known_extensions), std::end(known_extensions),
                     [&](const char* known) { return extension == known; });
}

std::optional<Component> component_of(std::optional<uint64_t> type) {
  if (!type || *type < 5120 || *type > 5126 || *type == 5124) return std::nullopt;
  return static_cast<Component>(*type);
}

class Reader {
 public:
  Reader(const Json& file, std::optional<uint64_t> own_bytes, const std::string& path, Context& ctx, bool rm)
      : file_(file), own_bytes_(own_bytes), path_(path), ctx_(ctx), rm_(rm) {}

  Result<Document> read() {
    if (!file_.is_object()) return Item{file_, "the file", 0, path_}.bad("expected an object");
    VOX_CHECK(check_version());
    VOX_CHECK(check_extensions());
    VOX_CHECK(read_buffers());
    VOX_CHECK(read_views());
    VOX_CHECK(read_accessors());
    VOX_CHECK(read_images());
    VOX_CHECK(read_pictures(file_, path_, out_));
    VOX_CHECK(read_materials(file_, path_, out_, rm_));
    VOX_CHECK(read_meshes());
    VOX_CHECK(read_nodes());
    VOX_CHECK(check_trees());
    VOX_CHECK(read_skins());
    VOX_CHECK(read_scene());
    note_rest();
    return std::move(out_);
  }

 private:
  Item item(const Json& json, const char* kind, size_t index) const { return {json, kind, index, path_}; }

  Status check_version() const {
    const Item file = item(file_, "the file", 0);
    const Json* const asset = file.find("asset");
    if (!asset) return {};
    for (const char* name : {"version", "minVersion"}) {
      const std::string version = text_of(file.below(*asset), name);
      if (!version.empty() && (name[0] == 'v' ? !version.starts_with("2.") : version != "2.0"))
        return bad_input(path_, fmt::format("glTF {}: expected 2.0", version));
    }
    return {};
  }

  Status check_extensions() {
    for (const Json& name : list_of(file_, "extensionsRequired"))
      if (!name.is_string() || !is_known(name.get<std::string>()))
        return bad_input(path_, fmt::format("it requires the glTF extension {}: expected one of {}",
                                            name.is_string() ? name.get<std::string>() : name.dump(),
                                            fmt::join(known_extensions, ", ")));
    // Those that change no more than what is seen of materials in light are left out, with a word.
    std::set<std::string> unknown;
    for (const Json& name : list_of(file_, "extensionsUsed"))
      if (name.is_string() && !is_known(name.get<std::string>())) unknown.insert(name.get<std::string>());
    if (!unknown.empty())
      out_.notes.push_back(fmt::format("extensions that are left out: {}", fmt::join(unknown, ", ")));
    return {};
  }

  Status read_buffers() {
    for (const Json& json : list_of(file_, "buffers")) {
      const Item buffer = item(json, "buffer", out_.buffers.size());
      const auto length = whole(buffer, "byteLength");
      if (!length) return buffer.bad("expected a byteLength");
      Buffer made{std::nullopt, *length};
      bool fallback = false;
      if (const Json* const packed = buffer.extension("EXT_meshopt_compression"))
        if (const Json* const flag = buffer.below(*packed).find("fallback"))
          fallback = flag->is_boolean() && flag->get<bool>();
      if (buffer.find("uri")) {
        made.uri = text_of(buffer, "uri");
      } else if (fallback) {
        made.length = 0;  // nothing is there; its views are packed
        fallback_.insert(static_cast<uint32_t>(out_.buffers.size()));
      } else if (!out_.buffers.empty() || !own_bytes_ || *length > *own_bytes_) {
        return buffer.bad("it is longer than the part of the file that holds it");
      }
      if (*length > ctx_.memory->limit())
        return fail(
            ErrorCode::limit, path_,
            fmt::format("a buffer takes {} bytes: --max-memory allows {}", *length, ctx_.memory->limit()));
      out_.buffers.push_back(std::move(made));
    }
    return {};
  }

  Status read_views() {
    for (const Json& json : list_of(file_, "bufferViews")) {
      const Item view = item(json, "buffer view", out_.views.size());
      View made;
      VOX_CHECK(read_range(view, made.buffer, made.offset, made.length));
      const auto stride = whole(view, "byteStride", 0);
      if (!stride || *stride > 65536) return view.bad("expected a byteStride up to 65536");
      made.stride = *stride;
      if (const Json* const packed = view.extension("EXT_meshopt_compression")) {
        VOX_CHECK(read_packed(view.below(*packed), made));
      } else if (made.length > out_.buffers[made.buffer].length ||
                 made.offset > out_.buffers[made.buffer].length - made.length) {
        return view.bad("it leads past the end of its buffer");
      }
      out_.views.push_back(made);
    }
    return {};
  }
  Status read_range(const Item& view, uint32_t& buffer, uint64_t& offset, uint64_t& length) const {
    VOX_TRY(buffer, index_of(view, "buffer", out_.buffers.size(), "buffer"));
    const auto from = whole(view, "byteOffset", 0), bytes = whole(view, "byteLength");
    if (buffer == none) return view.bad("expected the number of a buffer");
    if (!from || !bytes) return view.bad("expected a byteLength, and a byteOffset");
    offset = *from, length = *bytes;
    return {};
  }
  Status read_packed(const Item& packed, View& view) {
    PackedView made;
    VOX_CHECK(read_range(packed, made.buffer, made.offset, made.length));
    if (fallback_.contains(made.buffer) || made.length > out_.buffers[made.buffer].length ||
        made.offset > out_.buffers[made.buffer].length - made.length)
      return packed.bad("its packed bytes lead past the end of their buffer");
    const auto count = whole(packed, "count"), stride = whole(packed, "byteStride");
    if (!count || !stride || *stride < 1 || *stride > 256 || *count > UINT32_MAX ||
        *count * *stride > view.length)
      return packed.bad("expected a count and a byteStride up to 256, within its byteLength");
    made.how.count = *count;
    made.how.stride = *stride;
    view.length = *count * *stride;
    using enum MeshoptView::Mode;
    const std::string mode = text_of(packed, "mode"), filter = text_of(packed, "filter");
    if (mode != "ATTRIBUTES" && mode != "TRIANGLES" && mode != "INDICES")
      return packed.bad("expected the mode ATTRIBUTES, TRIANGLES or INDICES");
    made.how.mode = mode == "ATTRIBUTES" ? attributes : mode == "TRIANGLES" ? triangles : indices;
    if (!filter.empty() && filter != "NONE" && filter != "OCTAHEDRAL" && filter != "QUATERNION" &&
        filter != "EXPONENTIAL")
      return packed.bad("expected the filter NONE, OCTAHEDRAL, QUATERNION or EXPONENTIAL");
    made.how.filter = filter == "OCTAHEDRAL"    ? MeshoptView::Filter::octahedral
                      : filter == "QUATERNION"  ? MeshoptView::Filter::quaternion
                      : filter == "EXPONENTIAL" ? MeshoptView::Filter::exponential
                                                : MeshoptView::Filter::none;
    view.packed = made;
    return {};
  }

  /// `count` elements of `size` bytes from `offset` of a view on.
  Status check_range(const Item& accessor, uint32_t index, uint64_t offset, uint64_t count, uint64_t size,
                     bool strided = true) const {
    const View& view = out_.views[index];
    const uint64_t step = strided && view.stride ? view.stride : size;
    if (step < size || offset > view.length ||
        (count && (view.length - offset < size || (count - 1) > (view.length - offset - size) / step)))
      return accessor.bad("it leads past the end of its buffer view");
    return {};
  }

  Status read_accessors() {
    for (const Json& json : list_of(file_, "accessors")) {
      const Item accessor = item(json, "accessor", out_.accessors.size());
      Accessor made;
      const auto count = whole(accessor, "count"), offset = whole(accessor, "byteOffset", 0);
      const auto component = component_of(whole(accessor, "componentType"));
      static const std::map<std::string, std::array<uint32_t, 2>> shapes{
          {"SCALAR", {1, 1}}, {"VEC2", {2, 2}}, {"VEC3", {3, 3}}, {"VEC4", {4, 4}},
          {"MAT2", {4, 2}},   {"MAT3", {9, 3}}, {"MAT4", {16, 4}}};
      const auto shape = shapes.find(text_of(accessor, "type"));
      if (!count || !offset || !component || shape == shapes.end())
        return accessor.bad("expected count, componentType and type");
      made.count = *count;
      made.components = shape->second[0];
      made.rows = shape->second[1];
      VOX_TRY(const uint32_t view, index_of(accessor, "bufferView", out_.views.size(), "buffer view"));
      made.values = {view, *offset, *component};
      if (const Json* const flag = accessor.find("normalized"))
        made.normalized = flag->is_boolean() && flag->get<bool>();
      if (view != none) VOX_CHECK(check_range(accessor, view, *offset, *count, made.element_bytes()));
      if (const Json* const sparse = accessor.find("sparse"))
        VOX_CHECK(read_sparse(accessor.below(*sparse), made));
      // Zeros have no bytes that their number could be compared with.
      if (view == none && *count * 4 * made.components > ctx_.memory->limit() / 4)
        return fail(ErrorCode::limit, path_,
                    fmt::format("an accessor without a buffer takes {} bytes: --max-memory allows {} in all",
                                *count * 4 * made.components, ctx_.memory->limit()));
      out_.accessors.push_back(made);
    }
    return {};
  }
  Status read_sparse(const Item& sparse, Accessor& accessor) const {
    const auto count = whole(sparse, "count");
    const Json *const indices = sparse.find("indices"), *const values = sparse.find("values");
    if (!count || *count > accessor.count || !indices || !values)
      return sparse.bad("expected a sparse part with count, indices and values");
    Accessor::Sparse made{*count, {}, {}};
    const auto part = [&](const Json& json, Accessor::Values& to) -> Status {
      const Item item = sparse.below(json);
      VOX_TRY(to.view, index_of(item, "bufferView", out_.views.size(), "buffer view"));
      const auto offset = whole(item, "byteOffset", 0);
      if (to.view == none || !offset)
        return item.bad("expected the number of a buffer view of its sparse part");
      to.offset = *offset;
      return {};
    };
    VOX_CHECK(part(*indices, made.indices));
    VOX_CHECK(part(*values, made.values));
    const auto component = component_of(whole(sparse.below(*indices), "componentType"));
    if (component != Component::u8 && component != Component::u16 && component != Component::u32)
      return sparse.bad("expected a componentType of its sparse part");
    made.indices.component = *component;
    made.values.component = accessor.values.component;
    VOX_CHECK(
        check_range(sparse, made.indices.view, made.indices.offset, *count, bytes_of(*component), false));
    VOX_CHECK(
        check_range(sparse, made.values.view, made.values.offset, *count, accessor.element_bytes(), false));
    accessor.sparse = made;
    return {};
  }

  Status read_images() {
    for (const Json& json : list_of(file_, "images")) {
      const Item image = item(json, "image", out_.images.size());
      Image made{text_of(image, "uri"), none};
      VOX_TRY(made.view, index_of(image, "bufferView", out_.views.size(), "buffer view"));
      if (made.uri.empty() == (made.view == none)) return image.bad("expected either a uri or a bufferView");
      out_.images.push_back(std::move(made));
    }
    return {};
  }

  Result<Attributes> read_attributes(const Item& owner, const Json& json, size_t count,
                                     const char* what) const {
    Attributes attributes;
    if (!json.is_object()) return owner.bad("expected attributes by name");
    for (const auto& [name, value] : json.items()) {
      if (!value.is_number_unsigned() || value.template get<uint64_t>() >= count)
        return owner.bad(fmt::format("attribute {}: expected the number of {}", name, what));
      attributes[name] = static_cast<uint32_t>(value.template get<uint64_t>());
    }
    return attributes;
  }

  Status read_meshes() {
    for (const Json& json : list_of(file_, "meshes")) {
      const Item mesh = item(json, "mesh", out_.meshes.size());
      Mesh made;
      for (const Json& part : list_of(json, "primitives")) {
        const Item primitive = mesh.below(part);
        Primitive& to = made.primitives.emplace_back();
        const auto mode = whole(primitive, "mode", 4);
        if (!mode || *mode > 6) return mesh.bad("expected a mode up to 6");
        to.mode = static_cast<uint32_t>(*mode);
        VOX_TRY(to.indices, index_of(primitive, "indices", out_.accessors.size(), "accessor"));
        VOX_TRY(to.material, index_of(primitive, "material", out_.materials.size(), "material"));
        const Json* const attributes = primitive.find("attributes");
        if (!attributes) return mesh.bad("expected attributes");
        VOX_TRY(to.attributes, read_attributes(mesh, *attributes, out_.accessors.size(), "an accessor"));
        for (const Json& target : list_of(part, "targets")) {
          VOX_TRY(auto changes, read_attributes(mesh, target, out_.accessors.size(), "an accessor"));
          to.targets.push_back(std::move(changes));
        }
        if (const Json* const draco = primitive.extension("KHR_draco_mesh_compression")) {
          const Item packed = primitive.below(*draco);
          VOX_TRY(const uint32_t view, index_of(packed, "bufferView", out_.views.size(), "buffer view"));
          const Json* const ids = packed.find("attributes");
          if (view == none || !ids) return mesh.bad("expected a bufferView and attributes of Draco data");
          VOX_TRY(auto numbers, read_attributes(mesh, *ids, UINT32_MAX, "a Draco attribute"));
          to.draco = {view, std::move(numbers)};
        }
      }
      if (!read_weights(mesh, made.weights)) return mesh.bad("expected numbers for its weights");
      out_.meshes.push_back(std::move(made));
    }
    return {};
  }
  static bool read_weights(const Item& owner, std::vector<double>& to) {
    for (const Json& weight : list_of(owner.json, "weights")) {
      if (!is_finite_number(weight)) return false;
      to.push_back(weight.get<double>());
    }
    return true;
  }

  Status read_nodes() {
    const size_t count = list_of(file_, "nodes").size();
    for (const Json& json : list_of(file_, "nodes")) {
      const Item node = item(json, "node", out_.nodes.size());
      if (!json.is_object()) return node.bad("expected an object");
      Node made;
      VOX_TRY(made.mesh, index_of(node, "mesh", out_.meshes.size(), "mesh"));
      VOX_TRY(made.skin, index_of(node, "skin", list_of(file_, "skins").size(), "skin"));
      if (const Json* const children = node.find("children")) {
        if (!children->is_array()) return node.bad("expected a list of children");
        for (const Json& child : *children) {
          if (!child.is_number_unsigned() || child.get<uint64_t>() >= count)
            return node.bad("expected children that are there");
          made.children.push_back(static_cast<uint32_t>(child.get<uint64_t>()));
        }
      }
      double m[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
      glm::dvec3 translation(0), scale(1);
      std::array<double, 4> rotation{0, 0, 0, 1};
      if (!numbers<16>(node, "matrix", m) || !numbers<3>(node, "translation", translation) ||
          !numbers<4>(node, "rotation", rotation) || !numbers<3>(node, "scale", scale) ||
          !read_weights(node, made.weights))
        return node.bad("expected numbers for its place and weights");
      if (node.find("matrix"))
        made.local = {{{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}}, {m[12], m[13], m[14]}};
      else
        made.local = placement_of(translation, rotation, scale);
      if (const Json* const instancing = node.extension("EXT_mesh_gpu_instancing"))
        VOX_CHECK(read_instances(node.below(*instancing), made));
      if (const Json* const extras = node.find("extras"))
        if (const Json* const grid = node.below(*extras).find(voxel_grid_name.data()))
          made.grid = voxel_grid_of(*grid);
      out_.nodes.push_back(std::move(made));
    }
    return {};
  }
  Status read_instances(const Item& instancing, Node& node) const {
    const Json* const attributes = instancing.find("attributes");
    if (!attributes) return instancing.bad("expected attributes of its instances");
    VOX_TRY(const auto by_name,
            read_attributes(instancing, *attributes, out_.accessors.size(), "an accessor"));
    Node::Instances made;
    std::optional<uint64_t> count;
    for (const auto& [name, to, components] :
         {std::tuple("TRANSLATION", &made.translation, 3u), std::tuple("ROTATION", &made.rotation, 4u),
          std::tuple("SCALE", &made.scale, 3u)}) {
      const auto at = by_name.find(name);
      if (at == by_name.end()) continue;
      const Accessor& accessor = out_.accessors[at->second];
      if (accessor.components != components || (count && *count != accessor.count))
        return instancing.bad(
            fmt::format("{} of its instances: expected as many of each, of {} numbers", name, components));
      count = accessor.count;
      *to = at->second;
    }
    if (!count) return instancing.bad("expected TRANSLATION, ROTATION or SCALE of its instances");
    node.instances = made;
    return {};
  }

  /// Each node has one parent at most, and following parents ends.
  Status check_trees() const {
    const auto& nodes = out_.nodes;
    std::vector<uint32_t> parent(nodes.size(), none);
    const auto bad = [&](size_t index, const char* rule) { return item(file_, "node", index).bad(rule); };
    for (uint32_t i = 0; i < nodes.size(); ++i)
      for (const uint32_t child : nodes[i].children) {
        if (parent[child] != none) return bad(i, "expected children that no other node has");
        parent[child] = i;
      }
    // Walks from the tops down come to all nodes, if there are no circles.
    std::vector<uint32_t> stack;
    size_t seen = 0;
    for (uint32_t i = 0; i < nodes.size(); ++i)
      if (parent[i] == none) stack.push_back(i);
    std::vector<bool> reached(nodes.size());
    while (!stack.empty()) {
      const uint32_t at = stack.back();
      stack.pop_back();
      reached[at] = true;
      ++seen;
      for (const uint32_t child : nodes[at].children) stack.push_back(child);
    }
    if (seen < nodes.size())
      return bad(static_cast<size_t>(std::find(reached.begin(), reached.end(), false) - reached.begin()),
                 "it is its own parent");
    return {};
  }

  Status read_skins() {
    for (const Json& json : list_of(file_, "skins")) {
      const Item skin = item(json, "skin", out_.skins.size());
      Skin made;
      for (const Json& joint : list_of(json, "joints")) {
        if (!joint.is_number_unsigned() || joint.get<uint64_t>() >= out_.nodes.size())
          return skin.bad("expected joints that are nodes");
        made.joints.push_back(static_cast<uint32_t>(joint.get<uint64_t>()));
      }
      VOX_TRY(made.inverse_bind, index_of(skin, "inverseBindMatrices", out_.accessors.size(), "accessor"));
      if (made.inverse_bind != none) {
        const Accessor& accessor = out_.accessors[made.inverse_bind];
        if (accessor.components != 16 || accessor.count < made.joints.size())
          return skin.bad("expected a matrix for each joint");
      }
      out_.skins.push_back(std::move(made));
    }
    return {};
  }

  Status read_scene() {
    const Json& scenes = list_of(file_, "scenes");
    const Item file = item(file_, "the file", 0);
    VOX_TRY(uint32_t scene, index_of(file, "scene", scenes.size(), "scene"));
    if (scenes.empty()) {
      // All that is nobody's child.
      std::vector<bool> below(out_.nodes.size());
      for (const Node& node : out_.nodes)
        for (const uint32_t child : node.children) below[child] = true;
      for (uint32_t i = 0; i < out_.nodes.size(); ++i)
        if (!below[i]) out_.roots.push_back(i);
      return {};
    }
    if (scene == none) scene = 0;
    if (scenes.size() > 1) out_.notes.push_back(fmt::format("scene {} of {} is read", scene, scenes.size()));
    std::set<uint64_t> known;
    for (const Json& root : list_of(scenes[scene], "nodes")) {
      if (!root.is_number_unsigned() || root.get<uint64_t>() >= out_.nodes.size())
        return item(file_, "scene", scene).bad("expected nodes that are there");
      if (known.insert(root.get<uint64_t>()).second)
        out_.roots.push_back(static_cast<uint32_t>(root.get<uint64_t>()));
    }
    return {};
  }

  void note_rest() {
    std::vector<const char*> rest;
    if (!list_of(file_, "animations").empty()) rest.push_back("animations");
    if (!list_of(file_, "cameras").empty()) rest.push_back("cameras");
    if (!rest.empty()) out_.notes.push_back(fmt::format("dropped: {}", fmt::join(rest, ", ")));
  }

  const Json& file_;
  std::optional<uint64_t> own_bytes_;
  const std::string& path_;
  Context& ctx_;
  bool rm_;  ///< roughness and metalness are wanted
  std::set<uint32_t> fallback_;
  Document out_;
};

}  // namespace

Placement placement_of(const glm::dvec3& translation, const std::array<double, 4>& rotation,
                       const glm::dvec3& scale) {
  auto [x, y, z, w] = rotation;
  const double length = std::sqrt(x * x + y * y + z * z + w * w);
  if (length > 0) x /= length, y /= length, z /= length, w /= length;
  Placement out;
  out.linear[0] = glm::dvec3(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)) * scale.x;
  out.linear[1] = glm::dvec3(2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)) * scale.y;
  out.linear[2] = glm::dvec3(2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)) * scale.z;
  out.shift = translation;
  return out;
}

Result<Document> read_document(std::string_view text, std::optional<uint64_t> own_bytes,
                               const std::string& path, Context& ctx, bool rm) {
  // What the parser makes of it: 80 bytes for each value at most, and the text of strings.
  const auto values = static_cast<uint64_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return c == '[' || c == '{' || c == ',' || c == ':'; }));
  VOX_TRY(const Reservation memory,
          Reservation::take(96 * values + 2 * text.size(), "the text of the mesh", ctx));
  Json json;
  try {
    json = Json::parse(text.begin(), text.end(), nullptr, /*allow_exceptions=*/false);
    if (json.is_discarded()) return bad_input(path, "corrupt glTF file: its text is not JSON");
    VOX_TRY(Document document, Reader(json, own_bytes, path, ctx, rm).read());
    VOX_TRY(document.memory, Reservation::take(text.size(), "the text of the mesh", ctx));
    return document;
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::limit, path, "not enough memory to read the mesh");
  } catch (const std::exception& error) {
    return bad_input(path, fmt::format("corrupt glTF file: {}", error.what()));
  }
}

}  // namespace voxkit::gltf
