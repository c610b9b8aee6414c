#include "formats/mesh/gltf_primitive.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace voxkit::gltf {
namespace {

class PrimitiveReader {
 public:
  PrimitiveReader(const Document& document, Buffers& buffers, const Primitive& primitive,
                  std::span<const double> weights, const std::string& path, Context& ctx)
      : document_(document),
        buffers_(buffers),
        primitive_(primitive),
        weights_(weights),
        path_(path),
        ctx_(ctx) {}

  Result<Geometry> read(bool skinned, bool normals) {
    const auto position = primitive_.attributes.find("POSITION");
    if (position == primitive_.attributes.end()) return std::move(out_);
    count_ = document_.accessors[position->second].count;
    VOX_CHECK(read_material_uses());
    if (primitive_.draco) VOX_CHECK(unpack());
    VOX_TRY(const auto places, attribute("POSITION", 3, 3));
    VOX_CHECK(hold(count_ * (sizeof(glm::dvec3) + 2 * sizeof(glm::vec2) + sizeof(glm::vec4))));
    out_.positions.resize(count_);
    for (uint64_t i = 0; i < count_; ++i)
      out_.positions[i] = {places.values[3 * i], places.values[3 * i + 1], places.values[3 * i + 2]};
    VOX_CHECK(add_targets("POSITION", 3, [&](uint64_t i, uint32_t c, double change) {
      out_.positions[i][static_cast<int>(c)] += change;
    }));
    if (primitive_.attributes.contains("COLOR_0")) VOX_CHECK(read_colors());
    if (normals && primitive_.attributes.contains("NORMAL")) VOX_CHECK(read_normals());
    if (first_.picture != none) VOX_CHECK(read_uvs(first_, out_.uvs));
    if (second_.picture != none) VOX_CHECK(read_uvs(second_, out_.emission_uvs));
    if (third_.picture != none) VOX_CHECK(read_uvs(third_, out_.rm_uvs));
    if (skinned) VOX_CHECK(read_joints());
    VOX_CHECK(read_corners());
    return std::move(out_);
  }

 private:
  tl::unexpected<Error> bad(const std::string& what) const {
    return bad_input(path_, "corrupt glTF file: a primitive: " + what);
  }
  Status hold(uint64_t bytes) {
    VOX_TRY(Reservation memory, Reservation::take(bytes, "attributes of the mesh", ctx_));
    out_.memory.push_back(std::move(memory));
    return {};
  }

  /// Which picture coordinates are wanted: of the first of colours, emission, roughness that has a picture;
  /// and of the others, where they are others.
  Status read_material_uses() {
    if (primitive_.material == none) return {};
    const Material& material = document_.materials[primitive_.material];
    const auto others = [](const PictureInfo& a, const PictureInfo& b) {
      return a.picture != none && (a.channel != b.channel || a.transform != b.transform);
    };
    for (const PictureInfo* info : {&material.rm, &material.emission, &material.color})
      if (info->picture != none) first_ = *info;
    if (others(material.emission, first_)) second_ = material.emission;
    if (others(material.rm, first_)) third_ = material.rm;
    for (const PictureInfo& info : {first_, second_, third_})
      out_.lacks_uvs |= info.picture != none && !primitive_.attributes.contains(name_of(info));
    if (out_.lacks_uvs) first_ = second_ = third_ = {};
    return {};
  }
  static std::string name_of(const PictureInfo& info) { return fmt::format("TEXCOORD_{}", info.channel); }

  /// The names that are packed, as far as they are wanted, and their values; whole numbers are made floats as
  /// their accessors say.
  Status unpack() {
    const Primitive::Draco& draco = *primitive_.draco;
    const auto module = load_module({"draco", "reading KHR_draco_mesh_compression", "libdraco-dev"}, path_);
    if (!module) {
      // Some files have both.
      const bool both = primitive_.indices != none &&
                        document_.accessors[primitive_.indices].values.view != none &&
                        document_.accessors[primitive_.attributes.at("POSITION")].values.view != none;
      if (both) return {};
      return tl::unexpected<Error>(module.error());
    }
    if (primitive_.mode != 4) return bad("Draco data of no triangles: expected mode 4");
    if (primitive_.indices == none) return bad("Draco data: expected an accessor of indices");
    const uint64_t triangles = document_.accessors[primitive_.indices].count / 3;
    std::vector<DracoAttribute> asked;
    for (const auto& [name, id] : draco.ids) {
      const auto at = primitive_.attributes.find(name);
      if (at == primitive_.attributes.end()) continue;
      const Accessor& accessor = document_.accessors[at->second];
      if (accessor.count != count_) return bad(fmt::format("{}: expected as many as POSITION", name));
      names_.push_back(name);
      asked.push_back({id, accessor.components});
    }
    uint64_t components = 0;
    for (const DracoAttribute& a : asked) components += a.components;
    VOX_CHECK(hold(count_ * components * sizeof(float) + triangles * 3 * sizeof(uint32_t)));
    VOX_TRY(const auto bytes, buffers_.view(draco.view));
    auto decoded = (*module)->mesh->decode_draco(bytes, asked, count_, triangles, ctx_);
    if (!decoded) return fail(decoded.error().code, path_, decoded.error().what);
    unpacked_ = std::move(*decoded);
    for (size_t i = 0; i < names_.size(); ++i) {
      const Accessor& accessor = document_.accessors[primitive_.attributes.at(names_[i])];
      const Component c = accessor.values.component;
      if (!accessor.normalized || c == Component::f32) continue;
      const float most = c == Component::i8    ? 127.0f
                         : c == Component::u8  ? 255.0f
                         : c == Component::i16 ? 32767.0f
                         : c == Component::u16 ? 65535.0f
                                               : 4294967295.0f;
      for (float& value : unpacked_->attributes[i]) value = std::max(value / most, -1.0f);
    }
    return {};
  }

  Result<Values<float>> attribute(const std::string& name, uint32_t least, uint32_t most) {
    const uint32_t index = primitive_.attributes.at(name);
    const Accessor& accessor = document_.accessors[index];
    if (accessor.count != count_ || accessor.components < least || accessor.components > most)
      return bad(fmt::format("{}: {} x {} numbers: expected {} x {}", name, accessor.count,
                             accessor.components, count_, most));
    if (unpacked_) {
      const auto at = std::find(names_.begin(), names_.end(), name);
      if (at != names_.end()) {
        Values<float> out;
        out.components = accessor.components;
        out.values = unpacked_->attributes[static_cast<size_t>(at - names_.begin())];
        VOX_TRY(out.memory,
                Reservation::take(out.values.size() * sizeof(float), "attributes of the mesh", ctx_));
        return out;
      }
    }
    return buffers_.floats(index);
  }

  /// Calls `add(vertex, component, change)` for the targets that count.
  template <class Add>
  Status add_targets(const std::string& name, uint32_t components, const Add& add) {
    for (size_t t = 0; t < primitive_.targets.size() && t < weights_.size(); ++t) {
      const auto at = primitive_.targets[t].find(name);
      if (weights_[t] == 0 || at == primitive_.targets[t].end()) continue;
      const Accessor& accessor = document_.accessors[at->second];
      if (accessor.count != count_ || accessor.components > components)
        return bad(fmt::format("a target's {}: {} x {} numbers: expected {} x {}", name, accessor.count,
                               accessor.components, count_, components));
      VOX_TRY(const auto change, buffers_.floats(at->second));
      for (uint64_t i = 0; i < count_; ++i)
        for (uint32_t c = 0; c < change.components; ++c)
          add(i, c, weights_[t] * static_cast<double>(change.values[i * change.components + c]));
    }
    return {};
  }

  Status read_colors() {
    VOX_TRY(const auto values, attribute("COLOR_0", 3, 4));
    out_.colors.resize(count_, glm::vec4(1));
    for (uint64_t i = 0; i < count_; ++i)
      for (uint32_t c = 0; c < values.components; ++c)
        out_.colors[i][static_cast<int>(c)] = values.values[i * values.components + c];
    return add_targets("COLOR_0", 4, [&](uint64_t i, uint32_t c, double change) {
      out_.colors[i][static_cast<int>(c)] += static_cast<float>(change);
    });
  }

  Status read_normals() {
    VOX_TRY(const auto values, attribute("NORMAL", 3, 3));
    VOX_CHECK(hold(count_ * sizeof(glm::dvec3)));
    out_.normals.resize(count_);
    for (uint64_t i = 0; i < count_; ++i)
      out_.normals[i] = {values.values[3 * i], values.values[3 * i + 1], values.values[3 * i + 2]};
    return add_targets("NORMAL", 3, [&](uint64_t i, uint32_t c, double change) {
      out_.normals[i][static_cast<int>(c)] += change;
    });
  }

  Status read_uvs(const PictureInfo& info, std::vector<glm::vec2>& to) {
    const std::string name = name_of(info);
    VOX_TRY(const auto values, attribute(name, 2, 2));
    to.resize(count_);
    for (uint64_t i = 0; i < count_; ++i) to[i] = {values.values[2 * i], values.values[2 * i + 1]};
    VOX_CHECK(add_targets(name, 2, [&](uint64_t i, uint32_t c, double change) {
      to[i][static_cast<int>(c)] += static_cast<float>(change);
    }));
    if (!info.transform) return {};
    const auto& m = *info.transform;
    for (glm::vec2& uv : to) {
      const double u = uv.x, v = uv.y;
      uv = {static_cast<float>(m[0][0] * u + m[0][1] * v + m[0][2]),
            static_cast<float>(m[1][0] * u + m[1][1] * v + m[1][2])};
    }
    return {};
  }

  Status read_joints() {
    for (int set = 0;; ++set) {
      const std::string joints = fmt::format("JOINTS_{}", set), weights = fmt::format("WEIGHTS_{}", set);
      if (!primitive_.attributes.contains(joints)) break;
      if (!primitive_.attributes.contains(weights)) return bad("joints without weights");
      VOX_TRY(auto numbers, attribute(joints, 4, 4));
      VOX_TRY(auto shares, attribute(weights, 4, 4));
      out_.joints.push_back(std::move(numbers));
      out_.weights.push_back(std::move(shares));
    }
    return {};
  }

  Status read_corners() {
    if (unpacked_) {
      out_.corners = std::move(unpacked_->indices);
    } else if (primitive_.indices == none) {
      if (count_ > UINT32_MAX) return bad("expected less than 2^32 vertices");
      VOX_CHECK(hold(count_ * sizeof(uint32_t)));
      out_.corners.resize(count_);
      for (uint32_t i = 0; i < count_; ++i) out_.corners[i] = i;
    } else {
      VOX_TRY(auto indices, buffers_.integers(primitive_.indices));
      out_.corners = std::move(indices.values);
      out_.memory.push_back(std::move(indices.memory));
    }
    for (const uint32_t corner : out_.corners)
      if (corner >= count_)
        return bad_input(path_,
                         fmt::format("corrupt mesh: vertex {}: expected one below {}", corner, count_));
    return {};
  }

  const Document& document_;
  Buffers& buffers_;
  const Primitive& primitive_;
  std::span<const double> weights_;
  const std::string& path_;
  Context& ctx_;
  uint64_t count_ = 0;
  PictureInfo first_, second_, third_;
  std::vector<std::string> names_;  ///< of what is unpacked
  std::optional<DracoMesh> unpacked_;
  Geometry out_;
};

}  // namespace

Result<Geometry> read_primitive(const Document& document, Buffers& buffers, const Primitive& primitive,
                                std::span<const double> weights, bool skinned, bool normals,
                                const std::string& path, Context& ctx) {
  return PrimitiveReader(document, buffers, primitive, weights, path, ctx).read(skinned, normals);
}

}  // namespace voxkit::gltf
