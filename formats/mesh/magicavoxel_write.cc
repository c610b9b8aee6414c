// Writes MagicaVoxel files: cubes of up to 256 voxels a side as models, each moved to its place.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "formats/mesh/magicavoxel.h"
#include "formats/output_file.h"

namespace voxkit {
namespace {

constexpr int32_t most_side = 256;
constexpr uint64_t most_bytes = INT32_MAX;  // of what a chunk holds
constexpr int64_t furthest = 1 << 20;

/// Chunks, in memory. Hosts are little-endian, as the file is.
class Chunks {
 public:
  void number(uint32_t value) {
    char raw[4];
    std::memcpy(raw, &value, sizeof raw);
    bytes_.append(raw, sizeof raw);
  }
  void letters(std::string_view text) { bytes_ += text; }
  void text(std::string_view text) {
    number(static_cast<uint32_t>(text.size()));
    letters(text);
  }
  /// A chunk without chunks in it; `more` bytes of it come from elsewhere.
  void chunk(std::string_view kind, const Chunks& content, uint64_t more = 0) {
    letters(kind);
    number(static_cast<uint32_t>(content.bytes_.size() + more));
    number(0);
    letters(content.bytes_);
  }
  const std::string& all() const { return bytes_; }

 private:
  std::string bytes_;
};

/// The place of a node in its scene.
Chunks placing_node(uint32_t id, uint32_t child, uint32_t layer, const std::string& shift) {
  Chunks node;
  node.number(id);
  node.number(0);
  node.number(child);
  node.number(UINT32_MAX);
  node.number(layer);
  node.number(1);
  node.number(shift.empty() ? 0 : 1);
  if (!shift.empty()) {
    node.text("_t");
    node.text(shift);
  }
  return node;
}

class Writer final : public MagicaVoxelWriter {
 public:
  Writer(const Index3& dims, const Index3& corner, std::span<const std::array<uint8_t, 3>> palette,
         std::unique_ptr<OutputFile> out, Reservation memory)
      : dims_(dims),
        corner_(corner),
        palette_(palette.begin(), palette.end()),
        out_(std::move(out)),
        memory_(std::move(memory)) {}

  Status add(std::span<const IndexedVoxel> voxels) override {
    std::vector<std::byte>* model = nullptr;
    std::array<int32_t, 3> known{-1, -1, -1}, size{};
    for (const IndexedVoxel& v : voxels) {
      const std::array<int32_t, 3> cube{v.place[0] / most_side, v.place[1] / most_side,
                                        v.place[2] / most_side};
      if (model == nullptr || cube != known) {
        model = &models_[cube];
        known = cube;
        size = size_of(cube);
      }
      // The file's z points up, its y to the back.
      for (const int32_t at : {v.place[0] % most_side, size[2] - 1 - v.place[2] % most_side,
                               v.place[1] % most_side, int32_t{v.color} + 1})
        model->push_back(static_cast<std::byte>(at));
    }
    return {};
  }

  Status finish() override {
    Chunks palette, nodes, shapes;
    for (size_t i = 0; i < 256; ++i) {
      const std::array<uint8_t, 3> color = i < palette_.size() ? palette_[i] : std::array<uint8_t, 3>{};
      palette.number(uint32_t{color[0]} | uint32_t{color[1]} << 8 | uint32_t{color[2]} << 16 | 255u << 24);
    }
    nodes.chunk("nTRN", placing_node(0, 1, UINT32_MAX, {}));
    Chunks group;
    group.number(1);
    group.number(0);
    group.number(static_cast<uint32_t>(models_.size()));
    uint32_t number = 0;
    uint64_t model_bytes = 0;
    for (const auto& [cube, voxels] : models_) {
      const uint32_t id = 2 + 2 * number;
      group.number(id);
      const auto size = size_of(cube);
      // A model turns, and moves, about its middle.
      shapes.chunk("nTRN", placing_node(id, id + 1, 0,
                                        fmt::format("{} {} {}", corner_.x + cube[0] * most_side + size[0] / 2,
                                                    -corner_.z - size[2] - cube[2] * most_side + size[2] / 2,
                                                    corner_.y + cube[1] * most_side + size[1] / 2)));
      Chunks shape;
      for (const uint32_t value : {id + 1, 0u, 1u, number++, 0u}) shape.number(value);
      shapes.chunk("nSHP", shape);
      model_bytes += model_head + voxels.size();
    }
    nodes.chunk("nGRP", group);
    Chunks colors;
    colors.chunk("RGBA", palette);
    const uint64_t bytes = model_bytes + nodes.all().size() + shapes.all().size() + colors.all().size();
    if (bytes > most_bytes)
      return fail(
          ErrorCode::limit, out_->name(),
          fmt::format("a MagicaVoxel file of {} bytes: its chunks have at most {}", bytes, most_bytes));
    Chunks head;
    head.letters("VOX ");
    head.number(150);
    head.letters("MAIN");
    head.number(0);
    head.number(static_cast<uint32_t>(bytes));
    VOX_CHECK(out_->write(head.all()));
    for (const auto& [cube, voxels] : models_) {
      const auto size = size_of(cube);
      Chunks model, extent, count;
      for (const size_t axis : {0, 2, 1}) extent.number(static_cast<uint32_t>(size[axis]));
      model.chunk("SIZE", extent);
      count.number(static_cast<uint32_t>(voxels.size() / 4));
      model.chunk("XYZI", count, voxels.size());
      VOX_CHECK(out_->write(model.all()));
      VOX_CHECK(out_->write(voxels));
    }
    for (const Chunks* part : {&nodes, &shapes, &colors}) VOX_CHECK(out_->write(part->all()));
    return out_->commit();
  }

 private:
  static constexpr uint64_t model_head = 24 + 16;  // chunks SIZE and XYZI without voxels

  /// Of the part of a cube that is inside the volume.
  std::array<int32_t, 3> size_of(const std::array<int32_t, 3>& cube) const {
    std::array<int32_t, 3> size;
    for (size_t a = 0; a < 3; ++a)
      size[a] = static_cast<int32_t>(std::min<int64_t>(
          most_side, dims_[static_cast<Index3::length_type>(a)] - int64_t{cube[a]} * most_side));
    return size;
  }

  Index3 dims_, corner_;
  std::vector<std::array<uint8_t, 3>> palette_;
  std::unique_ptr<OutputFile> out_;
  Reservation memory_;
  std::map<std::array<int32_t, 3>, std::vector<std::byte>>
      models_;  ///< by cube: x, y, z and colour of voxels
};

/// Where the volume's corner is in a scene, in voxels; what of its place a scene cannot hold is said.
Index3 corner_of(const VolumeInfo& info, const std::string& path, Context& ctx) {
  const auto [x, y, z] = info.affine.spacing();
  const bool cubes = info.affine.is_plain() && x == y && y == z;
  Index3 corner(0);
  bool held = cubes;
  for (int a = 0; a < 3 && held; ++a) {
    const double at = info.affine.origin[static_cast<size_t>(a)] / x - 0.5;
    held =
        std::abs(at - std::round(at)) < 1e-6 && std::abs(at) + static_cast<double>(info.dims[a]) < furthest;
    if (held) corner[a] = std::llround(at);
  }
  if (!held) corner = Index3(0);
  std::vector<std::string> dropped;
  if (!info.affine.is_plain())
    dropped.push_back("the directions of axes");
  else if (!cubes || x != 1)
    dropped.push_back("the edges of voxels");
  if (!held) dropped.push_back("where the volume is");
  if (!dropped.empty())
    ctx.note(fmt::format("{}: MagicaVoxel cannot hold {}: dropped", path, fmt::join(dropped, " and ")));
  return corner;
}

}  // namespace

Status check_magicavoxel(const std::string& path, const Index3& dims, uint64_t voxels) {
  if (std::max({dims.x, dims.y, dims.z}) <= furthest && voxels <= most_bytes / 4) return {};
  return fail(ErrorCode::limit, path,
              fmt::format("{} voxels in {} x {} x {}: a MagicaVoxel file has at most {}, and {} a side",
                          voxels, dims.x, dims.y, dims.z, most_bytes / 4, furthest));
}

Result<std::unique_ptr<MagicaVoxelWriter>> create_magicavoxel(const std::string& path, const VolumeInfo& info,
                                                              uint64_t voxels,
                                                              std::span<const std::array<uint8_t, 3>> palette,
                                                              bool force, Context& ctx) {
  VOX_CHECK(check_magicavoxel(path, info.dims, voxels));
  VOX_TRY(Reservation memory, Reservation::take(voxels * 8, "voxels of models", ctx));
  VOX_TRY(auto out, OutputFile::create(path, force));
  return std::make_unique<Writer>(info.dims, corner_of(info, path, ctx), palette, std::move(out),
                                  std::move(memory));
}

}  // namespace voxkit
