// Faces of voxels as a GLB file (Khronos, "glTF 2.0 Specification", 4.4: binary glTF).
//
// Corners are counted in voxels from the centre of the first one: numbers that floats hold exactly. Where
// they are is said by the matrix of their node, in doubles. A matrix that shears is none that a node may
// have: then corners are where the axes have them, as floats, and the node moves them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "formats/mesh/face_files.h"
#include "formats/mesh/voxel_grid.h"
#include "formats/output_file.h"

namespace voxkit {
namespace {

using Json = nlohmann::ordered_json;

// Numbers of the specification.
constexpr int float_component = 5126, uint_component = 5125;
constexpr int array_buffer = 34962, element_array_buffer = 34963;
constexpr int nearest = 9728, clamp_to_edge = 33071;
constexpr int mode_points = 0, mode_triangles = 4;
constexpr uint64_t file_head = 12, chunk_head = 8;

/// A vertex as it lies in the buffer.
struct Vertex {
  std::array<float, 3> place;
  std::array<float, 2> uv;
};
static_assert(sizeof(Vertex) == 20);

/// Whether a node may have such axes: turned and scaled, mirrored or not. The numbers of files are rounded.
bool is_turned(const Affine& affine) {
  const auto spacing = affine.spacing();
  for (size_t a = 0; a < 3; ++a) {
    const size_t b = (a + 1) % 3;
    double dot = 0;
    for (size_t c = 0; c < 3; ++c) dot += affine.axes[a][c] * affine.axes[b][c];
    if (std::abs(dot) > 1e-5 * spacing[a] * spacing[b]) return false;
  }
  return true;
}

/// Bytes on their way to a file, handed over in large parts.
class Packer {
 public:
  explicit Packer(OutputFile& out) : out_(out) {}
  template <class T>
  Status put(const T& value) {
    const auto* const bytes = reinterpret_cast<const std::byte*>(&value);
    bytes_.insert(bytes_.end(), bytes, bytes + sizeof value);
    return bytes_.size() < (size_t{1} << 20) ? Status{} : flush();
  }
  Status flush() {
    VOX_CHECK(out_.write(bytes_));
    bytes_.clear();
    return {};
  }

 private:
  OutputFile& out_;
  std::vector<std::byte> bytes_;
};

class GlbWriter final : public FaceWriter {
 public:
  GlbWriter(const VolumeInfo& info, std::unique_ptr<OutputFile> out, Context& ctx)
      : out_(std::move(out)), ctx_(ctx), grid_(info), node_(info.affine) {
    // Of voxels, in the node's own coordinates.
    grid_.affine = Affine{};
    if (is_turned(node_)) return;
    grid_.affine.axes = node_.axes;
    node_.axes = Affine{}.axes;
  }

  Status add(std::span<const FaceRectangle> faces) override {
    for (const FaceRectangle& face : faces)
      for (const auto& corner : corners_of(face)) surface_.enclose(place_of(corner));
    VOX_CHECK(spool_.add(faces));
    return check_size(face_bytes * spool_.faces());
  }
  Status add_enclosed(std::span<const ModelVoxel> voxels) override {
    for (const ModelVoxel& voxel : voxels) enclosed_.enclose(centre_of(voxel));
    VOX_CHECK(spool_.add_enclosed(voxels));
    return check_size(face_bytes * spool_.faces() + sizeof(Vertex) * spool_.enclosed());
  }

  Status finish() override {
    VOX_CHECK(spool_.close());
    if (spool_.faces() == 0)
      return fail(ErrorCode::input, out_->name(), "there are no voxels: a mesh has at least one face");
    VOX_TRY(const std::vector<std::byte> picture, spool_.palette().png(ctx_));
    lay_out(picture.size());
    const std::string text = document();
    const uint64_t bytes = file_head + chunk_head + text.size() + chunk_head + end_;
    VOX_CHECK(check_size(bytes));
    Packer packer(*out_);
    VOX_CHECK(packer.put(std::array<char, 4>{'g', 'l', 'T', 'F'}));
    VOX_CHECK(packer.put(std::array{uint32_t{2}, static_cast<uint32_t>(bytes)}));
    VOX_CHECK(packer.put(static_cast<uint32_t>(text.size())));
    VOX_CHECK(packer.put(std::array<char, 4>{'J', 'S', 'O', 'N'}));
    VOX_CHECK(packer.flush());
    VOX_CHECK(out_->write(text));
    VOX_CHECK(packer.put(static_cast<uint32_t>(end_)));
    VOX_CHECK(packer.put(std::array<char, 4>{'B', 'I', 'N', 0}));
    VOX_CHECK(put_vertices(packer));
    for (uint64_t face = 0; face < spool_.faces(); ++face) {
      const auto first = static_cast<uint32_t>(4 * face);
      VOX_CHECK(packer.put(std::array{first, first + 1, first + 2, first, first + 2, first + 3}));
    }
    VOX_CHECK(packer.flush());
    VOX_CHECK(out_->write(picture));
    for (uint64_t at = picture_at_ + picture.size(); at < end_; ++at) VOX_CHECK(packer.put('\0'));
    VOX_CHECK(packer.flush());
    return out_->commit();
  }

 private:
  static constexpr uint64_t face_bytes = 4 * sizeof(Vertex) + 6 * sizeof(uint32_t);

  /// As soon as it is known to be too large.
  Status check_size(uint64_t bytes) const {
    if (bytes <= UINT32_MAX) return {};
    return fail(
        ErrorCode::limit, out_->name(),
        fmt::format("its rectangles take more than the {} bytes that a .glb file can have: --roi takes "
                    "a part, .obj has no such limit",
                    UINT32_MAX));
  }

  /// The box of vertices, as they are written.
  struct Bounds {
    std::array<float, 3> lo{INFINITY, INFINITY, INFINITY}, hi{-INFINITY, -INFINITY, -INFINITY};
    void enclose(const std::array<float, 3>& place) {
      for (size_t c = 0; c < 3; ++c) lo[c] = std::min(lo[c], place[c]), hi[c] = std::max(hi[c], place[c]);
    }
  };

  std::array<float, 3> local(const Affine::Vector& index) const {
    const Affine::Vector at = grid_.affine.place(index);
    return {static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])};
  }
  /// Of a corner, in edges of voxels.
  std::array<float, 3> place_of(const std::array<int32_t, 3>& corner) const {
    return local({corner[0] - 0.5, corner[1] - 0.5, corner[2] - 0.5});
  }
  std::array<float, 3> centre_of(const ModelVoxel& voxel) const {
    return local({static_cast<double>(voxel.place[0]), static_cast<double>(voxel.place[1]),
                  static_cast<double>(voxel.place[2])});
  }
  std::array<float, 2> uv_of(const std::array<uint8_t, 3>& color) const {
    const auto middle = spool_.palette().texel(spool_.palette().index_of(color));
    return {static_cast<float>(middle[0]), static_cast<float>(middle[1])};
  }

  /// Vertices of faces, those of points, three indices for each triangle, the picture.
  void lay_out(uint64_t picture_bytes) {
    points_at_ = 4 * sizeof(Vertex) * spool_.faces();
    indices_at_ = points_at_ + sizeof(Vertex) * spool_.enclosed();
    picture_at_ = indices_at_ + 6 * sizeof(uint32_t) * spool_.faces();
    picture_bytes_ = picture_bytes;
    end_ = (picture_at_ + picture_bytes + 3) / 4 * 4;
  }

  Status put_vertices(Packer& packer) {
    // Where the node mirrors, viewers turn triangles about; where the axes do, we do.
    const bool turn_about = grid_.affine.determinant() < 0;
    VOX_CHECK(spool_.each_face([&](std::span<const FaceRectangle> faces) -> Status {
      for (const FaceRectangle& face : faces) {
        auto corners = corners_of(face);
        if (turn_about) std::reverse(corners.begin(), corners.end());
        const auto uv = uv_of(face.color);
        for (const auto& corner : corners) VOX_CHECK(packer.put(Vertex{place_of(corner), uv}));
      }
      return {};
    }));
    return spool_.each_enclosed([&](std::span<const ModelVoxel> voxels) -> Status {
      for (const ModelVoxel& voxel : voxels)
        VOX_CHECK(packer.put(Vertex{centre_of(voxel), uv_of(voxel.color)}));
      return {};
    });
  }

  /// The JSON chunk, filled up with spaces.
  std::string document() const {
    Json views = Json::array(), accessors = Json::array(), nodes = Json::array(), meshes = Json::array();
    const auto view = [&](uint64_t from, uint64_t to) -> Json& {
      views.push_back({{"buffer", 0}, {"byteOffset", from}, {"byteLength", to - from}});
      return views.back();
    };
    const auto accessor = [&](int component, uint64_t count, const char* type, uint64_t offset = 0) -> Json& {
      accessors.push_back({{"bufferView", views.size() - 1},
                           {"byteOffset", offset},
                           {"componentType", component},
                           {"count", count},
                           {"type", type}});
      return accessors.back();
    };
    const auto vertices = [&](uint64_t from, uint64_t to, const Bounds& bounds) {
      Json& made = view(from, to);
      made["byteStride"] = sizeof(Vertex);
      made["target"] = array_buffer;
      const uint64_t count = (to - from) / sizeof(Vertex);
      const size_t first = accessors.size();
      Json& places = accessor(float_component, count, "VEC3");
      places["min"] = bounds.lo;
      places["max"] = bounds.hi;
      accessor(float_component, count, "VEC2", sizeof(Vertex::place));
      return Json{{"POSITION", first}, {"TEXCOORD_0", first + 1}};
    };
    const auto mesh = [&](const char* name, Json primitive) {
      primitive["material"] = 0;
      meshes.push_back({{"name", name}, {"primitives", Json::array({std::move(primitive)})}});
    };

    Json surface{{"mode", mode_triangles}, {"attributes", vertices(0, points_at_, surface_)}};
    view(indices_at_, picture_at_)["target"] = element_array_buffer;
    surface["indices"] = accessors.size();
    accessor(uint_component, 6 * spool_.faces(), "SCALAR");
    mesh("surface", std::move(surface));
    Json node{{"name", "surface"}, {"mesh", 0}};
    if (!(node_ == Affine{})) {
      const auto& [x, y, z] = node_.axes;
      const auto& at = node_.origin;
      node["matrix"] = {x[0], x[1], x[2], 0, y[0],  y[1],  y[2],  0,
                        z[0], z[1], z[2], 0, at[0], at[1], at[2], 1};
    }
    node["extras"][std::string(voxel_grid_name)] = Json::parse(voxel_grid_text(grid_));
    if (spool_.enclosed() > 0) {
      node["children"] = {1};
      mesh("enclosed", {{"mode", mode_points}, {"attributes", vertices(points_at_, indices_at_, enclosed_)}});
    }
    nodes.push_back(std::move(node));
    if (spool_.enclosed() > 0) nodes.push_back({{"name", "enclosed"}, {"mesh", 1}});
    view(picture_at_, picture_at_ + picture_bytes_);

    Json all;
    all["asset"] = {{"version", "2.0"}, {"generator", "Voxkit"}};
    all["scene"] = 0;
    all["scenes"] = Json::array({{{"nodes", {0}}}});
    all["nodes"] = std::move(nodes);
    all["meshes"] = std::move(meshes);
    all["materials"] = Json::array(
        {{{"name", "palette"},
          {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0}}}}});
    all["textures"] = Json::array({{{"sampler", 0}, {"source", 0}}});
    all["samplers"] = Json::array({{{"magFilter", nearest},
                                    {"minFilter", nearest},
                                    {"wrapS", clamp_to_edge},
                                    {"wrapT", clamp_to_edge}}});
    all["images"] = Json::array({{{"bufferView", views.size() - 1}, {"mimeType", "image/png"}}});
    all["accessors"] = std::move(accessors);
    all["bufferViews"] = std::move(views);
    all["buffers"] = Json::array({{{"byteLength", end_}}});
    std::string text = all.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    return text;
  }

  std::unique_ptr<OutputFile> out_;
  Context& ctx_;
  VolumeInfo grid_;
  Affine node_;
  FaceSpool spool_;
  Bounds surface_, enclosed_;
  uint64_t points_at_ = 0, indices_at_ = 0, picture_at_ = 0, picture_bytes_ = 0, end_ = 0;
};

}  // namespace

Result<std::unique_ptr<FaceWriter>> create_glb_faces(const std::string& path, const VolumeInfo& info,
                                                     bool force, Context& ctx) {
  VOX_TRY(auto out, OutputFile::create(path, force));
  if (info.unit != Unit::unknown && info.unit != Unit::metre)
    ctx.note(fmt::format("{}: places are in {}: they are written as they are, though glTF counts metres",
                         path, name(info.unit)));
  return std::make_unique<GlbWriter>(info, std::move(out), ctx);
}

}  // namespace voxkit
